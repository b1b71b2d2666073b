//! `live.basis`: a small copy of the transport basis of a run, with the description of its scene, from which
//! the report makes pictures. Its bytes are listed in `docs/formats.md`.

use std::{fs, path::Path};

use serde::{Deserialize, Serialize};

use super::{AuditError, stored::About, write_whole};
use crate::{
    lighting::Lighting,
    math::hash::hash_bytes,
    transport::compact::{Compact, CopyError, Header},
};

/// First bytes of the file, the last of which is its version.
const MAGIC: &[u8] = b"LIGHTOPTLIVE\x01";

/// A small copy of a basis with what it is of.
#[derive(Clone, Debug)]
pub struct Live {
    /// The copy.
    pub copy: Compact,
    /// What stands in front of the codes.
    pub facts: Facts,
}

/// What a small copy says of itself.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Facts {
    /// Description of the scene; its mask is that of the copy.
    pub about: About,
    /// Lighting that the scene's author gave it, within what the basis holds.
    pub authored: Lighting,
    /// Difference of the copy from its basis.
    pub error: CopyError,
}

/// Header of the file.
#[derive(Serialize, Deserialize)]
struct FileHeader {
    copy: Header,
    #[serde(flatten)]
    facts: Facts,
    /// Hash of the codes, in hexadecimal.
    hash: String,
}

impl Live {
    /// Writes the file, whole or not at all.
    ///
    /// # Errors
    /// When the destination is impossible.
    pub fn save(&self, path: &Path) -> Result<(), AuditError> {
        let codes = self.copy.codes.concat();
        let hash = format!("{:016x}", hash_bytes(codes.iter().copied()));
        let header = FileHeader { copy: self.copy.header.clone(), facts: self.facts.clone(), hash };
        let header = serde_json::to_vec(&header).map_err(|e| AuditError::Io {
            path: path.into(),
            action: "describe the copy of the basis in",
            source: e.into(),
        })?;
        let length = (header.len() as u64).to_le_bytes();
        write_whole(path, [MAGIC, &length, &header, &codes].concat())
    }

    /// Reads a file that [`Self::save`] wrote.
    ///
    /// # Errors
    /// When the file cannot be read, or is not such a file.
    pub fn load(path: &Path) -> Result<Self, AuditError> {
        let bytes = fs::read(path).map_err(|source| AuditError::Io {
            path: path.into(),
            action: "read the copy of the basis in",
            source,
        })?;
        parse(&bytes).ok_or_else(|| AuditError::Live { path: path.into() })
    }
}

/// The content of a file; `None` where it is damaged, or none of this version.
fn parse(bytes: &[u8]) -> Option<Live> {
    let rest = bytes.strip_prefix(MAGIC)?;
    let (length, rest) = rest.split_first_chunk::<8>()?;
    let (header, codes) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
    let FileHeader { copy: header, facts, hash } = serde_json::from_slice(header).ok()?;
    let is_whole = hash == format!("{:016x}", hash_bytes(codes.iter().copied()));
    let n = header.lights.len();
    let lights = [
        header.bytes.len(),
        facts.about.lights.len(),
        facts.authored.n_lights(),
        facts.about.fixed.n_lights(),
    ];
    let pixels = u64::from(header.size[0]) * u64::from(header.size[1]);
    let masked = facts.about.mask.iter().try_fold(0_u64, |sum, &n| sum.checked_add(n as u64));
    if !is_whole || !header.is_sound() || lights != [n; 4] || masked != Some(pixels) {
        return None;
    }
    let mut rest = codes;
    let mut parts = Vec::new();
    for &length in &header.bytes {
        let (part, after) = rest.split_at_checked(length)?;
        parts.push(part.to_vec());
        rest = after;
    }
    rest.is_empty().then_some(Live { copy: Compact { header, codes: parts }, facts })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        math::{ViewTransform, display::LuminanceMode},
        transport::{Layout, SizeBins, TransportBasis, ValueNodes},
    };

    #[test]
    fn a_file_comes_back_and_a_damaged_one_does_not() {
        let layout = Layout::new((3, 2).into(), vec![SizeBins::Fixed(1.0)], ValueNodes::new(1.0, 1));
        let fixed =
            Lighting { radiance: vec![1.0], size: vec![1.0], value: 1.0, exposure: 1.0, color: Vec::new() };
        let about = About {
            scene: "room".into(),
            lights: vec!["key".into()],
            fixed: fixed.clone(),
            luminance: LuminanceMode::Srgb,
            view: ViewTransform::Agx,
            mask: vec![2, 4],
            variables: Vec::new(),
            ties: Vec::new(),
            watts: Vec::new(),
            white: Vec::new(),
            features: None,
        };
        let copy = Compact::new(&TransportBasis::new(layout, 1)).unwrap();
        let live = Live { copy, facts: Facts { about, authored: fixed, error: CopyError::default() } };
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("live.basis");
        live.save(&path).unwrap();
        let read = Live::load(&path).unwrap();
        assert_eq!((read.copy, read.facts.about.mask), (live.copy.clone(), vec![2, 4]));
        let mut bytes = fs::read(&path).unwrap();
        let last = bytes.len() - 1;
        bytes[last] ^= 1;
        assert!(parse(&bytes).is_none() && parse(&bytes[..40]).is_none() && parse(b"LIGHTOPT").is_none());
        assert!(Live::load(&directory.path().join("none")).is_err());
    }
}
