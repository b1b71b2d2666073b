//! What the header of a JPEG says: about the memory that its decoder needs, and of a gain map.

use std::io::{self, BufRead, Read, Seek};

use super::array;

/// How the samples of a JPEG are spread over scans.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scans {
    /// Number of components: 1 is grey, 3 colour, 4 CMYK.
    pub components: u8,
    /// Whether the decoder keeps the coefficients of the whole picture: those of progressive files,
    /// and of files with a scan for each component.
    pub keeps_all: bool,
    /// Whether a gain map for brighter displays belongs to the picture.
    pub has_gain_map: bool,
}

/// Marks of a gain map in the metadata: \[ISO21496\], the XMP of Ultra HDR, and that of Apple.
const GAIN_MAPS: [&[u8]; 3] = [b"urn:iso:std:iso:ts:21496:-1", b"hdrgm:", b"hdrgainmap"];

/// What is taken for the worst.
const WORST: Scans = Scans { components: 3, keeps_all: true, has_gain_map: false };

impl Scans {
    /// Reads up to the first scan. What is damaged is taken for the worst, for the decoder to
    /// judge.
    #[must_use]
    pub fn read(source: &mut (impl BufRead + Seek + ?Sized)) -> Self {
        Self::parse(source).unwrap_or(WORST)
    }

    fn parse(source: &mut (impl Read + Seek + ?Sized)) -> io::Result<Self> {
        let mut found = WORST;
        source.read_exact(&mut [0; 2])?;
        loop {
            let [mut mark] = array(source)?;
            while mark == 0xff {
                [mark] = array(source)?;
            }
            // Markers without a segment.
            if matches!(mark, 0x00 | 0x01 | 0xd0..=0xd8) {
                continue;
            }
            let length = u16::from_be_bytes(array(source)?);
            let mut left = i64::from(length.max(2)) - 2;
            match mark {
                // [T81] table B.1: the frames, without DHT, JPG and DAC
                0xc0..=0xcf if !matches!(mark, 0xc4 | 0xc8 | 0xcc) => {
                    let [_, _, _, _, _, components] = array(source)?;
                    found = Self { components, keeps_all: !matches!(mark, 0xc0 | 0xc1), ..found };
                    left -= 6;
                }
                0xda => {
                    let [components] = array(source)?;
                    found.keeps_all |= components < found.components;
                    return Ok(found);
                }
                0xd9 => return Ok(found),
                // APP1 and APP2
                0xe1 | 0xe2 => {
                    let mut metadata = vec![0; left as usize];
                    source.read_exact(&mut metadata)?;
                    let has = |mark: &&[u8]| metadata.windows(mark.len()).any(|part| part == *mark);
                    found.has_gain_map |= GAIN_MAPS.iter().any(has);
                    left = 0;
                }
                _ => {}
            }
            source.seek_relative(left)?;
        }
    }

    /// Bytes of each pixel beside the result: 16-bit coefficients.
    #[must_use]
    pub fn working(&self) -> u64 {
        if self.keeps_all { 2 * u64::from(self.components) } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    /// SOI, an APP0, a frame of three components, and a scan of `scan` of them.
    fn jpeg(frame: u8, scan: u8) -> Vec<u8> {
        let mut bytes = b"\xff\xd8\xff\xe0\0\x04ab".to_vec();
        bytes.extend([0xff, frame, 0, 17, 8, 0, 1, 0, 1, 3]);
        bytes.extend([0; 9]);
        bytes.extend([0xff, 0xda, 0, 6 + 2 * scan, scan]);
        bytes
    }

    #[test]
    fn gain_maps_are_seen() {
        let scans = |bytes: Vec<u8>| Scans::read(&mut Cursor::new(bytes));
        assert!(!scans(jpeg(0xc0, 3)).has_gain_map);
        for mark in GAIN_MAPS {
            let mut bytes = b"\xff\xd8\xff\xe2".to_vec();
            bytes.extend((mark.len() as u16 + 4).to_be_bytes());
            bytes.push(b'x');
            bytes.extend(mark);
            bytes.push(0);
            bytes.extend(&jpeg(0xc0, 3)[2..]);
            assert_eq!(scans(bytes), Scans { components: 3, keeps_all: false, has_gain_map: true });
        }
    }

    #[test]
    fn progressive_files_and_separate_scans_keep_their_coefficients() {
        let working = |bytes: Vec<u8>| Scans::read(&mut Cursor::new(bytes)).working();
        assert_eq!(working(jpeg(0xc0, 3)), 0);
        assert_eq!(working(jpeg(0xc2, 3)), 6);
        assert_eq!(working(jpeg(0xc0, 1)), 6);
        let whole = jpeg(0xc0, 3);
        for n in 0..whole.len() {
            assert_eq!(working(whole[..n].to_vec()), 6, "{n}");
        }
    }
}
