//! Automatic, aesthetics-driven lighting design with global illumination.
//!
//! # Bibliography
//!
//! - \[BT709\] Recommendation ITU-R BT.709-6, 2015.
//! - \[DLMF\] NIST Digital Library of Mathematical Functions, <https://dlmf.nist.gov>.
//! - \[Efron82\] B. Efron, *The Jackknife, the Bootstrap and Other Resampling Plans*, SIAM 1982.
//! - \[IEC61966\] IEC 61966-2-1:1999, *Default RGB colour space: sRGB*.
//! - \[Meisters75\] G. Meisters, *Polygons have ears*, Amer. Math. Monthly 82, 1975.
//! - \[PG14\] *Automatic Aesthetics-based Lighting Design with Global Illumination*, Pacific
//!   Graphics short papers, 2014.
//! - \[Steele14\] G. Steele, D. Lea, C. Flood, *Fast Splittable Pseudorandom Number Generators*,
//!   OOPSLA 2014.
//! - \[Thompson86\] I. Thompson, A. Barnett, *Coulomb and Bessel Functions of Complex Arguments
//!   and Order*, J. Comput. Phys. 64, 1986 (the modified Lentz algorithm).

pub mod audit;
pub mod bsdf;
pub mod camera;
pub mod cli;
pub mod design;
pub mod embree;
pub mod files;
pub mod film;
pub mod integrator;
pub mod light;
pub mod math;
pub mod objective;
pub mod optim;
pub mod params;
pub mod sampler;
pub mod scene;
