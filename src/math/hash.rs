//! Integer hashing: seeds for independent sequences.

/// Finaliser of SplitMix64, a bijection of 64-bit words.
#[must_use]
pub fn mix64(mut z: u64) -> u64 {
    z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Hash of a sequence of bytes, the same on every machine.
#[must_use]
pub fn hash_bytes(bytes: impl Iterator<Item = u8>) -> u64 {
    let (mut hash, mut word, mut n) = (0, 0_u64, 0_u64);
    for b in bytes {
        word = word << 8 | u64::from(b);
        n += 1;
        if n.is_multiple_of(8) {
            (hash, word) = (mix64(hash ^ word), 0);
        }
    }
    hash_words(&[hash, word, n])
}

/// Hash of a sequence of words, which depends on their order.
#[must_use]
pub fn hash_words(words: &[u64]) -> u64 {
    words.iter().fold(0x243f_6a88_85a3_08d3, |h, &w| mix64(h ^ w))
}

/// Hash of what came before, `hash`, and of the bytes that follow, the same on every machine. It depends on
/// the parts in which bytes are handed over: whoever checks them must take the same.
#[must_use]
pub fn hash_on(hash: u64, bytes: &[u8]) -> u64 {
    let words = bytes.chunks(8).map(|c| c.iter().rev().fold(0, |word, &b| word << 8 | u64::from(b)));
    words.fold(hash_words(&[hash, bytes.len() as u64]), |h, w| hash_words(&[h, w]))
}
