//! embree
