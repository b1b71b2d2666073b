//! Mutations of seeds: the same at every run.

/// Numbers that are at the edge of something, as text.
const NUMBERS: [&str; 16] = [
    "0",
    "-1",
    "1",
    "1e40",
    "-1e-40",
    "nan",
    "inf",
    "65536",
    "2147483648",
    "4294967295",
    "4294967296",
    "18446744073709551615",
    "99999999999999999999",
    "1e308",
    "0.5",
    "",
];
/// Numbers that are at the edge of something, as words of four bytes.
const WORDS: [u32; 8] = [0, 1, 0xff, 0xffff, 0x7fff_ffff, 0x8000_0000, 0xffff_fffe, 0xffff_ffff];
/// Changes of one file, at most.
const MAX_CHANGES: usize = 4;
/// Longest file that mutations make, bytes.
const MAX_LENGTH: usize = 1 << 16;

/// An endless sequence of mutations.
pub struct Mutations<'a> {
    seeds: &'a [Vec<u8>],
    state: u64,
}

impl<'a> Mutations<'a> {
    /// Mutations of `seeds`, by a sequence that `name` chooses.
    pub fn new(name: &str, seeds: &'a [Vec<u8>]) -> Self {
        // FNV-1a.
        let state = name
            .bytes()
            .fold(0xcbf2_9ce4_8422_2325, |h: u64, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3));
        Self { seeds, state }
    }

    /// A number below `n`, or 0. [Steele14].
    fn below(&mut self, n: usize) -> usize {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % n.max(1) as u64) as usize
    }

    /// A part of a file of `n` bytes, mostly short.
    fn range(&mut self, n: usize) -> std::ops::Range<usize> {
        let start = self.below(n + 1);
        let most = if self.below(4) == 0 { n } else { 16 };
        let length = self.below(most + 1);
        start..(start + length).min(n)
    }

    fn change(&mut self, bytes: &mut Vec<u8>) {
        let n = bytes.len();
        match self.below(9) {
            0 if n > 0 => {
                let (at, bit) = (self.below(n), self.below(8));
                bytes[at] ^= 1 << bit;
            }
            1 if n > 0 => {
                let at = self.below(n);
                bytes[at] = [0, 0xff, 0x7f, 0x80, b' ', b'\n', b'"', b'{'][self.below(8)];
            }
            2 => bytes.truncate(self.below(n + 1)),
            3 => drop(bytes.drain(self.range(n))),
            4 => {
                let part = bytes[self.range(n)].to_vec();
                let at = self.below(n + 1);
                bytes.splice(at..at, part);
            }
            5 => {
                let seeds = self.seeds;
                let other = &seeds[self.below(seeds.len())];
                let part = other[self.range(other.len())].to_vec();
                let to = self.range(n);
                bytes.splice(to, part);
            }
            6 if n >= 4 => {
                let at = self.below(n - 3);
                let word = WORDS[self.below(WORDS.len())];
                let word = if self.below(2) == 0 { word.to_le_bytes() } else { word.to_be_bytes() };
                bytes[at..at + 4].copy_from_slice(&word);
            }
            _ => self.change_number(bytes),
        }
        bytes.truncate(MAX_LENGTH);
    }

    /// Replaces a number in a text.
    fn change_number(&mut self, bytes: &mut Vec<u8>) {
        let start = self.below(bytes.len());
        let Some(from) = bytes[start..].iter().position(u8::is_ascii_digit).map(|i| start + i) else {
            return;
        };
        let is_part = |b: &u8| b.is_ascii_digit() || *b == b'.';
        let to = bytes[from..].iter().position(|b| !is_part(b)).map_or(bytes.len(), |i| from + i);
        let number = NUMBERS[self.below(NUMBERS.len())];
        bytes.splice(from..to, number.bytes());
    }
}

impl Iterator for Mutations<'_> {
    type Item = Vec<u8>;

    fn next(&mut self) -> Option<Vec<u8>> {
        let seeds = self.seeds;
        let mut bytes = seeds[self.below(seeds.len())].clone();
        for _ in 0..=self.below(MAX_CHANGES) {
            self.change(&mut bytes);
        }
        Some(bytes)
    }
}
