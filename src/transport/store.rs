//! Stored bases: the file format, writing and reading.
//!
//! A file holds, little-endian: the magic `LIGHTOPTBASIS`, a version byte, the
//! length of a JSON header (u64) and the header, then the tables (f32): luminance
//! by replicate, colour of all or by replicate; at the end a hash (u64) of all that. The header describes the tables; its
//! `about` is the writer's. No memory is taken for what a header announces before the file is known
//! to be as long.

use std::{
    fs::File,
    io::{self, BufReader, BufWriter, Read, Write},
    path::{Path, PathBuf},
};

use glam::UVec2;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Knots, Layout, SizeBins, TransportBasis, ValueNodes, layout::COLOURS};
use crate::{
    files::{
        atomic::{AtomicWriteError, write_unsynced},
        write_atomically,
    },
    math::hash::hash_on,
};

/// First bytes of a file.
const MAGIC: &[u8; 13] = b"LIGHTOPTBASIS";
/// Version of the format and of what the tables mean.
pub const VERSION: u8 = 4;

/// A basis cannot be stored or read.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum StoreError {
    #[error("{path}: cannot read the transport basis", path = path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error("{path}: cannot write the transport basis", path = path.display())]
    Io { path: PathBuf, source: io::Error },
    #[error("{path}: not a transport basis (`run --cache DIR` or `--keep-basis` writes them)", path = path.display())]
    NotABasis { path: PathBuf },
    #[error("{path}: a transport basis of version {found}; this program reads version {VERSION}", path = path.display())]
    Version { path: PathBuf, found: u8 },
    #[error("{path}: the transport basis is damaged or cut short", path = path.display())]
    Damaged { path: PathBuf },
    #[error(transparent)]
    Write(#[from] AtomicWriteError),
}

/// Upper bound of the length of a header, bytes, against damaged files: names, variables and the mask
/// of a large picture take less.
const MAX_HEADER: u64 = 64 << 20;
/// Upper bound of the number of value nodes of a file, against damaged files: a basis has one for each
/// edge of its longest paths, of which there are 32 at most.
const MAX_NODES: usize = 64;

/// Upper bound of the weight of the next samples, against damaged files: it doubles when samples are aimed
/// anew, which a search does a few times.
const MAX_WEIGHT: u32 = 1 << 16;
/// Upper bound of the samples per pixel of a replicate, counted with their weights, against damaged files:
/// a thousand times what any option asks for, and more may be added in 32 bits.
const MAX_SAMPLES: u32 = 1 << 30;
/// Upper bound of the samples per pixel of all replicates, which are counted in 32 bits.
const MAX_COUNTED: usize = 1 << 31;

#[derive(Serialize, Deserialize)]
struct Header {
    /// Description of the scene, for whoever wrote the file.
    about: Value,
    /// Value of the background at the first node.
    largest_value: f64,
    /// Number of nodes of the background's value.
    n_nodes: usize,
    /// Planes of the pictures of a replicate, see [`Layout::planes`]; 1 where it is not said.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    planes: usize,
    /// Samples per pixel of each replicate, counted with their weights.
    n_samples: u32,
    /// Number of replicates, each with a table of luminance.
    replicates: usize,
    /// Film size, pixels.
    size: [u32; 2],
    /// Sizes of each light.
    sizes: Vec<Size>,
    /// Samples taken of the present sequence.
    taken: u32,
    /// Weight with which the next samples count.
    weight: u32,
}

fn one() -> usize {
    1
}

#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_one(n: &usize) -> bool {
    *n == 1
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Size {
    Fixed(f32),
    Free(Knots),
}

impl TransportBasis {
    /// Writes the basis, whole or not at all.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn save(&self, path: &Path, about: &Value) -> Result<(), StoreError> {
        write_atomically(path, |file| self.write(file, path, about))
    }

    /// Writes the basis as [`Self::save`] does, without waiting for the disk.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn save_unsynced(&self, path: &Path, about: &Value) -> Result<(), StoreError> {
        write_unsynced(path, |file| self.write(file, path, about))
    }

    fn write(&self, file: &mut BufWriter<File>, path: &Path, about: &Value) -> Result<(), StoreError> {
        let layout = &self.layout;
        let header = Header {
            about: about.clone(),
            largest_value: layout.nodes.values()[0],
            n_nodes: layout.nodes.len(),
            planes: layout.planes,
            n_samples: self.n_samples,
            replicates: self.n_replicates(),
            size: layout.size.to_array(),
            sizes: layout
                .lights
                .iter()
                .map(|l| l.knots.clone().map_or(Size::Fixed(l.size), Size::Free))
                .collect(),
            taken: self.taken,
            weight: self.weight,
        };
        let fail = |source| StoreError::Io { path: path.into(), source };
        let header = serde_json::to_vec(&header).map_err(|e| fail(e.into()))?;
        let mut out = Hashed { file, hash: 0 };
        let mut write = |bytes: &[u8]| out.write(bytes).map_err(fail);
        write(MAGIC)?;
        write(&[VERSION])?;
        write(&(header.len() as u64).to_le_bytes())?;
        write(&header)?;
        for table in self.luminance.iter().chain(&self.colour) {
            for part in table.chunks(CHUNK) {
                let bytes: Vec<u8> = part.iter().flat_map(|v| v.to_le_bytes()).collect();
                write(&bytes)?;
            }
        }
        let hash = out.hash.to_le_bytes();
        out.file.write_all(&hash).map_err(fail)
    }

    /// Reads a basis, and the description that was stored with it.
    ///
    /// # Errors
    /// When the file cannot be read, or is not a whole basis of this version.
    pub fn load(path: &Path) -> Result<(Self, Value), StoreError> {
        let unreadable = |source| StoreError::Read { path: path.into(), source };
        let file = File::open(path).map_err(unreadable)?;
        let length = file.metadata().map_err(unreadable)?.len();
        let mut reader = Hashing { file: BufReader::new(file), hash: 0 };
        match read(&mut reader, length) {
            Ok(read) => Ok(read),
            Err(Unread::Magic) => Err(StoreError::NotABasis { path: path.into() }),
            Err(Unread::Version(found)) => Err(StoreError::Version { path: path.into(), found }),
            Err(Unread::Damaged) => Err(StoreError::Damaged { path: path.into() }),
            Err(Unread::Io(e)) if e.kind() == io::ErrorKind::UnexpectedEof => {
                Err(StoreError::Damaged { path: path.into() })
            }
            Err(Unread::Io(source)) => Err(unreadable(source)),
        }
    }
}

/// Reason why a file is no basis.
enum Unread {
    Magic,
    Version(u8),
    Damaged,
    Io(io::Error),
}

impl From<io::Error> for Unread {
    fn from(e: io::Error) -> Self {
        Self::Io(e)
    }
}

/// Reads a basis, with the description stored with it, from a file of `length` bytes.
fn read(reader: &mut Hashing<impl Read>, length: u64) -> Result<(TransportBasis, Value), Unread> {
    let magic = reader.array::<13>().map_err(|_| Unread::Magic)?;
    if magic != *MAGIC {
        return Err(Unread::Magic);
    }
    let [version] = reader.array()?;
    if version != VERSION {
        return Err(Unread::Version(version));
    }
    let header_length = u64::from_le_bytes(reader.array()?);
    if header_length > MAX_HEADER.min(length) {
        return Err(Unread::Damaged);
    }
    let header = reader.bytes(header_length as usize)?;
    let header: Header = serde_json::from_slice(&header).map_err(|_| Unread::Damaged)?;
    let begin = MAGIC.len() as u64 + 1 + 8 + header_length;
    let rest = length.checked_sub(begin).ok_or(Unread::Damaged)?;
    let (layout, n) = checked_layout(&header, rest).ok_or(Unread::Damaged)?;
    let luminance = (0..header.replicates).map(|_| reader.table(n)).collect::<Result<_, _>>()?;
    let n_colours = layout.n_colour_tables(header.replicates);
    let colour = (0..n_colours).map(|_| reader.table(n * COLOURS)).collect::<Result<_, _>>()?;
    let hash = reader.hash;
    if reader.array()? != hash.to_le_bytes() {
        return Err(Unread::Damaged);
    }
    let Header { n_samples, weight, taken, about, .. } = header;
    Ok((TransportBasis { layout, luminance, colour, n_samples, weight, taken }, about))
}

/// Layout that a header describes, and the length of a table of luminance; `None` if its numbers are
/// senseless, or if tables and hash are not `rest` bytes long.
fn checked_layout(header: &Header, rest: u64) -> Option<(Layout, usize)> {
    let is_sound = |size: &Size| match size {
        Size::Fixed(size) => size.is_finite(),
        Size::Free(knots) => knots.is_sound(),
    };
    let n_cells = |size: &Size| match size {
        Size::Fixed(_) => 1,
        Size::Free(knots) => knots.len() as u64,
    };
    let numbers_fit = !header.sizes.is_empty()
        && header.sizes.iter().all(is_sound)
        && header.largest_value.is_finite()
        && header.largest_value >= 0.0
        && (1..=MAX_NODES).contains(&header.n_nodes)
        && [1, 1 + COLOURS].contains(&header.planes)
        && header.replicates >= 1
        && (1..=MAX_WEIGHT).contains(&header.weight)
        && (1..=MAX_SAMPLES).contains(&header.n_samples)
        && header.taken <= header.n_samples
        && (header.n_samples as usize).checked_mul(header.replicates).is_some_and(|n| n <= MAX_COUNTED);
    if !numbers_fit {
        return None;
    }
    let [width, height] = header.size.map(u64::from);
    let cells: u64 = header.sizes.iter().map(n_cells).sum();
    let n = width.checked_mul(height)?.checked_mul(cells)?.checked_mul(header.n_nodes as u64)?;
    let replicates = header.replicates as u64;
    let colours = if header.planes == 1 { 1 } else { replicates };
    let tables = colours.checked_mul(COLOURS as u64)?.checked_add(replicates)?;
    let wanted = n.checked_mul(tables)?.checked_mul(4)?.checked_add(8)?;
    if n == 0 || wanted != rest {
        return None;
    }
    let sizes = header.sizes.iter().map(|size| match size {
        Size::Fixed(size) => SizeBins::Fixed(*size),
        Size::Free(knots) => SizeBins::Free(knots.clone()),
    });
    let nodes = ValueNodes::new(header.largest_value, header.n_nodes);
    let layout = Layout::new(UVec2::from_array(header.size), sizes.collect(), nodes);
    let layout = layout.with_planes(header.planes);
    (layout.nodes.len() == header.n_nodes).then_some((layout, usize::try_from(n).ok()?))
}

/// Numbers that are written or read at a time: a part of 256 KiB, far from the size of a table, so that
/// no second copy of one is held.
const CHUNK: usize = 1 << 16;

/// A file to which bytes are written, with their hash.
struct Hashed<'a, W> {
    file: &'a mut W,
    hash: u64,
}

impl<W: Write> Hashed<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.hash = hash_on(self.hash, bytes);
        self.file.write_all(bytes)
    }
}

/// A file that is read in the parts in which it was written, with the hash of what was read.
struct Hashing<R> {
    file: R,
    hash: u64,
}

impl<R: Read> Hashing<R> {
    fn array<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        let mut bytes = [0; N];
        self.file.read_exact(&mut bytes)?;
        self.hash = hash_on(self.hash, &bytes);
        Ok(bytes)
    }

    fn bytes(&mut self, n: usize) -> io::Result<Vec<u8>> {
        let mut bytes = vec![0; n];
        self.file.read_exact(&mut bytes)?;
        self.hash = hash_on(self.hash, &bytes);
        Ok(bytes)
    }

    /// Reads a table of `n` numbers, which the file is known to hold.
    fn table(&mut self, n: usize) -> io::Result<Vec<f32>> {
        let mut table = Vec::with_capacity(n);
        let mut buffer = vec![0; 4 * CHUNK.min(n)];
        while table.len() < n {
            let part = &mut buffer[..4 * CHUNK.min(n - table.len())];
            self.file.read_exact(part)?;
            self.hash = hash_on(self.hash, part);
            table.extend(part.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)));
        }
        Ok(table)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// Bytes of a stored basis with other keys in its header, and the hash that fits them.
    fn forged(directory: &Path, keys: &Value) -> PathBuf {
        let layout = Layout::new(UVec2::new(2, 1), vec![SizeBins::Fixed(1.0)], ValueNodes::new(1.0, 1));
        let basis = TransportBasis { n_samples: 1, taken: 1, ..TransportBasis::new(layout, 2) };
        let path = directory.join("forged.basis");
        basis.save(&path, &json!({})).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let begin = MAGIC.len() + 1 + 8;
        let length = u64::from_le_bytes(bytes[begin - 8..begin].try_into().unwrap()) as usize;
        let mut header: Value = serde_json::from_slice(&bytes[begin..][..length]).unwrap();
        for (key, value) in keys.as_object().unwrap() {
            header[key] = value.clone();
        }
        let header = serde_json::to_vec(&header).unwrap();
        let tables = &bytes[begin + length..bytes.len() - 8];
        let mut out = Vec::new();
        let mut hashed = Hashed { file: &mut out, hash: 0 };
        // In the parts in which it is read.
        let n = tables.len() / 4;
        for part in [&MAGIC[..], &[VERSION], &(header.len() as u64).to_le_bytes(), &header] {
            hashed.write(part).unwrap();
        }
        for table in [&tables[..n], &tables[n..2 * n], &tables[2 * n..]] {
            hashed.write(table).unwrap();
        }
        let hash = hashed.hash.to_le_bytes();
        out.extend(hash);
        std::fs::write(&path, out).unwrap();
        path
    }

    #[test]
    fn counts_that_do_not_fit_are_damage_and_take_no_memory() {
        let directory = tempfile::tempdir().unwrap();
        let good = forged(directory.path(), &json!({}));
        assert_eq!(TransportBasis::load(&good).unwrap().0.n_samples(), 1);
        let (half, all) = (1_u64 << 32, u64::MAX);
        for keys in [
            json!({"n_samples": u32::MAX}),
            json!({"n_samples": 1 << 30, "replicates": half}),
            json!({"replicates": all}),
            json!({"replicates": all - 1}),
            json!({"size": [u32::MAX, u32::MAX]}),
            json!({"size": [65536, 65536], "replicates": half}),
            json!({"weight": u32::MAX}),
            json!({"taken": 2}),
            json!({"n_nodes": all}),
            json!({"sizes": []}),
        ] {
            let path = forged(directory.path(), &keys);
            let error = TransportBasis::load(&path).unwrap_err();
            assert!(matches!(error, StoreError::Damaged { .. }), "{keys}: {error}");
        }
    }
}
