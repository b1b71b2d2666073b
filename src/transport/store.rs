//! A basis on disk.
//!
//! A file holds, little-endian: the magic `LIGHTOPTBASIS`, a version byte, the
//! length of a JSON header (u64) and the header, then the tables (f32): luminance
//! by replicate, colour; at the end a hash (u64) of all that. The header says what
//! the tables are; its `about` belongs to whoever wrote the file.

use std::{
    fs,
    io::{self, Write},
    path::{Path, PathBuf},
};

use glam::UVec2;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{COLOURS, Knots, Layout, SizeBins, TransportBasis, ValueNodes};
use crate::{
    files::{atomic::AtomicWriteError, write_atomically},
    math::hash::hash_words,
};

const MAGIC: &[u8; 13] = b"LIGHTOPTBASIS";
/// Version of the format and of what the tables mean.
pub const VERSION: u8 = 3;

/// A basis cannot be stored or read.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum StoreError {
    #[error("{path}: cannot read the transport basis", path = path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error("{path}: cannot write the transport basis", path = path.display())]
    Io { path: PathBuf, source: io::Error },
    #[error("{path}: not a transport basis (`run --cache DIR` writes them)", path = path.display())]
    NotABasis { path: PathBuf },
    #[error("{path}: a transport basis of version {found}; this program reads version {VERSION}", path = path.display())]
    Version { path: PathBuf, found: u8 },
    #[error("{path}: the transport basis is damaged or cut short", path = path.display())]
    Damaged { path: PathBuf },
    #[error(transparent)]
    Write(#[from] AtomicWriteError),
}

#[derive(Serialize, Deserialize)]
struct Header {
    about: Value,
    largest_value: f64,
    n_nodes: usize,
    n_samples: u32,
    replicates: usize,
    size: [u32; 2],
    sizes: Vec<Size>,
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
        let layout = &self.layout;
        let header = Header {
            about: about.clone(),
            largest_value: layout.nodes.values()[0],
            n_nodes: layout.nodes.len(),
            n_samples: self.n_samples,
            replicates: self.n_replicates(),
            size: layout.size.to_array(),
            sizes: layout
                .lights
                .iter()
                .map(|l| l.knots.clone().map_or(Size::Fixed(l.size), Size::Free))
                .collect(),
        };
        let fail = |source| StoreError::Io { path: path.into(), source };
        let header = serde_json::to_vec(&header).map_err(|e| fail(e.into()))?;
        write_atomically(path, |file| {
            let mut out = Hashed { file, hash: 0 };
            let mut write = |bytes: &[u8]| out.write(bytes).map_err(fail);
            write(MAGIC)?;
            write(&[VERSION])?;
            write(&(header.len() as u64).to_le_bytes())?;
            write(&header)?;
            for table in self.luminance.iter().chain([&self.colour]) {
                for part in table.chunks(CHUNK) {
                    let bytes: Vec<u8> = part.iter().flat_map(|v| v.to_le_bytes()).collect();
                    write(&bytes)?;
                }
            }
            let hash = out.hash.to_le_bytes();
            out.file.write_all(&hash).map_err(fail)
        })
    }

    /// Reads a basis and what was said about it.
    ///
    /// # Errors
    /// When the file is not a whole basis of this version.
    pub fn load(path: &Path) -> Result<(Self, Value), StoreError> {
        let bytes = fs::read(path).map_err(|source| StoreError::Read { path: path.into(), source })?;
        let damaged = || StoreError::Damaged { path: path.into() };
        let rest = bytes.strip_prefix(MAGIC).ok_or_else(|| StoreError::NotABasis { path: path.into() })?;
        let (&found, rest) = rest.split_first().ok_or_else(damaged)?;
        if found != VERSION {
            return Err(StoreError::Version { path: path.into(), found });
        }
        let (length, rest) = rest.split_at_checked(8).ok_or_else(damaged)?;
        let length = length.iter().rev().fold(0_u64, |n, &b| n << 8 | u64::from(b));
        let (header, rest) =
            rest.split_at_checked(usize::try_from(length).unwrap_or(usize::MAX)).ok_or_else(damaged)?;
        let header: Header = serde_json::from_slice(header).map_err(|_| damaged())?;
        let sizes = header.sizes.into_iter().map(|s| match s {
            Size::Fixed(size) => SizeBins::Fixed(size),
            Size::Free(knots) => SizeBins::Free(knots),
        });
        let mut sizes_sound = true;
        let sizes: Vec<SizeBins> = sizes
            .inspect(|s| {
                sizes_sound &=
                    matches!(s, SizeBins::Fixed(_)) || matches!(s, SizeBins::Free(k) if k.is_sound())
            })
            .collect();
        if !sizes_sound || sizes.is_empty() || header.largest_value.is_nan() || header.largest_value < 0.0 {
            return Err(damaged());
        }
        let nodes = ValueNodes::new(header.largest_value, header.n_nodes.clamp(1, 64));
        let layout = Layout::new(UVec2::from_array(header.size), sizes, nodes);
        let n = layout.n_rows().checked_mul(layout.n_pixels()).ok_or_else(damaged)?;
        let wanted =
            n.checked_mul(header.replicates + COLOURS).and_then(|n| n.checked_mul(4)).ok_or_else(damaged)?;
        if n == 0 || rest.len() != wanted + 8 || header.n_nodes != layout.nodes.len() || header.n_samples == 0
        {
            return Err(damaged());
        }
        let (tables, hash) = rest.split_at(wanted);
        let begin = bytes.len() - rest.len();
        let head = MAGIC.len() + 1 + 8;
        let mut hashed = 0;
        for part in [
            &bytes[..MAGIC.len()],
            &bytes[MAGIC.len()..=MAGIC.len()],
            &bytes[head - 8..head],
            &bytes[head..begin],
        ] {
            hashed = fold(hashed, part);
        }
        let mut floats = tables.chunks(n * 4).collect::<Vec<_>>();
        let colour = floats.split_off(header.replicates).concat();
        let mut table = |bytes: &[u8]| -> Vec<f32> {
            bytes
                .chunks(4 * CHUNK)
                .flat_map(|part| {
                    hashed = fold(hashed, part);
                    part.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
                })
                .collect()
        };
        let luminance = floats.iter().map(|t| table(t)).collect();
        let colour = table(&colour);
        if hash != hashed.to_le_bytes() {
            return Err(damaged());
        }
        let n_samples = header.n_samples;
        Ok((Self { layout, luminance, colour, n_samples, weight: 1, taken: n_samples }, header.about))
    }
}

/// Numbers written at a time.
const CHUNK: usize = 1 << 16;

struct Hashed<'a, W> {
    file: &'a mut W,
    hash: u64,
}

impl<W: Write> Hashed<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.hash = fold(self.hash, bytes);
        self.file.write_all(bytes)
    }
}

fn fold(hash: u64, bytes: &[u8]) -> u64 {
    let words = bytes.chunks(8).map(|c| c.iter().rev().fold(0, |word, &b| word << 8 | u64::from(b)));
    words.fold(hash_words(&[hash, bytes.len() as u64]), |h, w| hash_words(&[h, w]))
}
