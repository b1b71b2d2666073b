//! How much a scene file may ask for, by its own size.
//!
//! A glTF says with a few bytes how many elements an accessor has, and how often a mesh is placed. Every
//! such count is checked here before memory is reserved, so that reading a scene file takes at most
//! [`MEMORY_BASE`], and [`MEMORY_PER_BYTE`] for every byte of it and of its buffers; images come on top, with
//! a budget of their own ([`TEXTURE_BUDGET`](crate::scene::texture::TEXTURE_BUDGET)).

use std::cell::Cell;

/// Memory that reading the smallest scene file may take, bytes: 2 GiB. [`MAX_OBJECTS`] take up to 1 GiB, the
/// triangles of `MIN_TRIANGLES` 116 bytes each, 1 GiB.
pub const MEMORY_BASE: u64 = 1 << 31;
/// Memory that reading a scene file may take for every byte of it and of its buffers, bytes: what is read
/// from JSON is up to 100 times as large, and of 1 triangle a byte 116 bytes are kept while vertices of
/// three accessors (24 bytes each as they are decoded) are held.
pub const MEMORY_PER_BYTE: u64 = 400;

/// Objects in all lists of a glTF, at most. One takes up to a kilobyte; the largest scenes of films have some
/// ten thousand nodes.
pub const MAX_OBJECTS: usize = 1 << 20;
/// Depth of the tree of nodes, at most: names of all ancestors select a node's triangles. Skeletons are some
/// dozen deep.
pub const MAX_DEPTH: usize = 1 << 10;

/// Triangles, instances counted, that the smallest file may have.
const MIN_TRIANGLES: u64 = 1 << 23;
/// Elements without data, whose values are zero, that an accessor of the smallest file may have.
const MIN_ZEROS: u64 = 1 << 16;
/// Elements that the smallest file may ask to decode, all uses of accessors counted: half a second.
const MIN_ELEMENTS: u64 = 1 << 26;
/// Elements that a file may ask to decode, for every byte of it: exporters let some hundred primitives share
/// the accessors of their vertices.
const ELEMENTS_PER_BYTE: u64 = 64;
/// Bytes of names that the smallest file may have, those of ancestors counted for every node below them.
const MIN_NAMES: u64 = 1 << 26;
/// Bytes of names that a file may have, so counted, for every byte of it.
const NAMES_PER_BYTE: u64 = 64;

/// What a file has asked for so far.
#[derive(Debug, Default)]
pub struct Budget {
    /// Bytes of the file and of its buffers.
    bytes: Cell<u64>,
    elements: Cell<u64>,
    triangles: Cell<u64>,
    names: Cell<u64>,
}

/// Adds to what was spent; an error in words when it exceeds what is allowed.
fn charge(spent: &Cell<u64>, n: u64, most: u64, what: &str) -> Result<(), String> {
    spent.set(spent.get().saturating_add(n));
    if spent.get() <= most {
        return Ok(());
    }
    Err(format!("asks for more than {most} {what}, the most that a file of this size may have"))
}

impl Budget {
    /// Adds the bytes of a file or a buffer.
    pub fn extend(&self, bytes: usize) {
        self.bytes.set(self.bytes.get().saturating_add(bytes as u64));
    }

    /// Elements without data that an accessor may have.
    pub fn zeros(&self) -> u64 {
        MIN_ZEROS.max(self.bytes.get())
    }

    fn per_byte(&self, least: u64, per_byte: u64) -> u64 {
        least.saturating_add(self.bytes.get().saturating_mul(per_byte))
    }

    /// Counts elements that are to be decoded.
    ///
    /// # Errors
    /// In words, when they are too many.
    pub fn decode(&self, n: usize) -> Result<(), String> {
        let most = self.per_byte(MIN_ELEMENTS, ELEMENTS_PER_BYTE);
        charge(&self.elements, n as u64, most, "elements of accessors, each use counted")
    }

    /// Counts triangles that are to be placed.
    ///
    /// # Errors
    /// In words, when they are too many.
    pub fn place(&self, n: usize) -> Result<(), String> {
        charge(&self.triangles, n as u64, self.per_byte(MIN_TRIANGLES, 1), "triangles, each instance counted")
    }

    /// Counts bytes of names.
    ///
    /// # Errors
    /// In words, when they are too many.
    pub fn name(&self, n: usize) -> Result<(), String> {
        let most = self.per_byte(MIN_NAMES, NAMES_PER_BYTE);
        charge(&self.names, n as u64, most, "bytes of names, those of ancestors counted for every node")
    }
}
