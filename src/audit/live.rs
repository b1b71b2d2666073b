//! `live.basis`: a small copy of the transport basis of a run, with the description of its scene, from which
//! the report makes pictures. Its bytes are listed in `docs/formats.md`.

use std::{fs, path::Path};

use base64::prelude::{BASE64_STANDARD, Engine};
use serde::{Deserialize, Serialize};

use super::{AuditError, stored::About, write_whole};
use crate::{
    lighting::Lighting,
    math::hash::hash_bytes,
    objective::{Objective, ObjectiveError, Target},
    transport::{
        Brought,
        compact::{Compact, CopyError, Header},
    },
    variables::Tie,
};

/// First bytes of the file, the last of which is its version.
const MAGIC: &[u8] = b"LIGHTOPTLIVE\x02";

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
    /// Share with which each pixel is the main object's, in the place of the mask; `None` without such weights.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weights: Option<Shares>,
    /// Difference of the copy from its basis.
    pub error: CopyError,
}

/// Numbers in [0, 1], row by row: little-endian u16, in Base64, of which the largest is 1.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Shares(String);

impl Shares {
    /// Numbers as they are stored.
    #[must_use]
    pub fn new(shares: &[f64]) -> Self {
        let code = |share: &f64| (share.clamp(0.0, 1.0) * f64::from(u16::MAX)).round() as u16;
        let bytes: Vec<u8> = shares.iter().flat_map(|share| code(share).to_le_bytes()).collect();
        Self(BASE64_STANDARD.encode(bytes))
    }

    /// The numbers; `None` where there are not as many as pixels.
    #[must_use]
    pub fn read(&self, n_pixels: usize) -> Option<Vec<f64>> {
        let bytes = BASE64_STANDARD.decode(&self.0).ok()?;
        let (codes, rest) = bytes.as_chunks::<2>();
        let is_whole = rest.is_empty() && codes.len() == n_pixels;
        let share = |code: &[u8; 2]| f64::from(u16::from_le_bytes(*code)) / f64::from(u16::MAX);
        is_whole.then(|| codes.iter().map(share).collect())
    }
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

    /// Objective of a target for the pictures of the copy.
    ///
    /// # Errors
    /// As [`Objective::new`].
    pub fn objective(&self, target: &Target) -> Result<Objective, ObjectiveError> {
        let [width, height] = self.copy.header.size.map(|n| n as usize);
        match self.facts.weights.as_ref().and_then(|weights| weights.read(width * height)) {
            Some(weights) => Objective::weighted(target, width, height, &weights),
            None => Objective::new(target, width, height, &self.facts.about.mask()),
        }
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
    let of_lighting = |x: &Lighting| [x.radiance.len(), x.size.len()];
    let [authored, fixed] = [&facts.authored, &facts.about.fixed].map(of_lighting);
    let lights = [header.bytes.len(), facts.about.lights.len(), authored[0], authored[1], fixed[0], fixed[1]];
    let pixels = u64::from(header.size[0]) * u64::from(header.size[1]);
    let masked = facts.about.mask.iter().try_fold(0_u64, |sum, &n| sum.checked_add(n as u64));
    if !is_whole || !header.is_sound() || lights != [n; 6] || masked != Some(pixels) {
        return None;
    }
    let About { white, ties, fixed, .. } = &facts.about;
    let of_lights = [white.len(), fixed.color.len(), facts.authored.color.len()];
    let is_tied = |tie: &Tie| {
        let is_sound = tie.brought.as_ref().is_none_or(|of| of.iter().all(Brought::is_sound));
        tie.light < n && tie.leader < n && tie.factor.is_finite() && is_sound
    };
    let weighted = |weights: &Shares| weights.read(usize::try_from(pixels).ok()?);
    if !of_lights.iter().all(|of| [0, n].contains(of))
        || !ties.iter().all(is_tied)
        || facts.weights.as_ref().is_some_and(|weights| weighted(weights).is_none())
    {
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
        let weights = Some(Shares::new(&[0.0, 1.0, 0.25, 0.5, 1.0, 0.125]));
        let facts = Facts { about, authored: fixed, weights, error: CopyError::default() };
        let live = Live { copy, facts };
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("live.basis");
        live.save(&path).unwrap();
        let read = Live::load(&path).unwrap();
        assert_eq!((read.copy, read.facts.about.mask), (live.copy.clone(), vec![2, 4]));
        let weights = read.facts.weights.unwrap();
        assert!(weights.read(6).unwrap().iter().zip([0.0, 1.0, 0.25]).all(|(a, b)| (a - b).abs() < 1e-5));
        assert!(weights.read(5).is_none() && weights.read(7).is_none());
        let broken = |change: &dyn Fn(&mut Facts)| {
            let mut other = live.clone();
            change(&mut other.facts);
            other.save(&path).unwrap();
            Live::load(&path).is_err()
        };
        assert!(broken(&|facts| facts.weights = Some(Shares::new(&[0.5]))));
        assert!(broken(&|facts| facts.about.white = vec![true; 2]));
        assert!(broken(&|facts| facts.authored.size.clear()));
        let tie = Tie { light: 0, leader: 1, factor: 1.0, brought: None };
        assert!(broken(&|facts| facts.about.ties = vec![tie.clone()]));
        live.save(&path).unwrap();
        let mut bytes = fs::read(&path).unwrap();
        let last = bytes.len() - 1;
        bytes[last] ^= 1;
        assert!(parse(&bytes).is_none() && parse(&bytes[..40]).is_none() && parse(b"LIGHTOPT").is_none());
        assert!(Live::load(&directory.path().join("none")).is_err());
    }
}
