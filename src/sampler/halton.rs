//! Halton sequence with Owen-scrambled digits.

use crate::math::{ONE_MINUS_EPSILON, hash::hash_words};

/// The first `N` primes.
const fn first_primes<const N: usize>() -> [u32; N] {
    let mut primes = [0; N];
    let (mut n, mut candidate) = (0, 2);
    while n < N {
        let mut i = 0;
        let mut is_prime = true;
        while i < n {
            if candidate % primes[i] == 0 {
                is_prime = false;
                break;
            }
            i += 1;
        }
        if is_prime {
            primes[n] = candidate;
            n += 1;
        }
        candidate += 1;
    }
    primes
}

/// Bases of the first 128 dimensions: a camera subpath of 32 edges takes 4 and 4 at each of its 31
/// scatterings. Further dimensions reuse them under another scramble.
static PRIMES: [u32; 128] = first_primes();

/// Value `index` of dimension `dimension` under scramble `seed`, in [0, 1).
///
/// \[PBRT4\] 8.6.4 (Owen-scrambled radical inverse): each digit is permuted at
/// random by a hash of the digits before it, and of their number: leading zeros
/// are digits too, without which index 0 would be 0 for every base-th scramble.
pub fn sample(index: u32, dimension: u32, seed: u64) -> f32 {
    let base = PRIMES[dimension as usize % PRIMES.len()];
    let seed = hash_words(&[seed, u64::from(dimension)]);
    let inv_base = 1.0 / f64::from(base);
    let (mut rest, mut reversed, mut scale) = (u64::from(index), 0_u64, 1.0_f64);
    // Until the remaining digits cannot change an f32: 1e-8 is a sixth of its spacing below 1.
    let mut n_digits = 0;
    while scale > 1e-8 {
        let digit = (rest % u64::from(base)) as u32;
        rest /= u64::from(base);
        let p = permute(digit, base, hash_words(&[seed.wrapping_add(n_digits), reversed]) as u32);
        n_digits += 1;
        reversed = reversed * u64::from(base) + u64::from(p);
        scale *= inv_base;
    }
    ((reversed as f64 * scale) as f32).min(ONE_MINUS_EPSILON)
}

/// Element `i` of a random permutation of `0..n` selected by `p`.
///
/// \[Kensler13\] listing 2: cycle-walking over a hash that is a bijection of
/// the next power of two.
fn permute(mut i: u32, n: u32, p: u32) -> u32 {
    let w = n.next_power_of_two() - 1;
    loop {
        i ^= p;
        i = i.wrapping_mul(0xe170_893d);
        i ^= p >> 16;
        i ^= (i & w) >> 4;
        i ^= p >> 8;
        i = i.wrapping_mul(0x0929_eb3f);
        i ^= p >> 23;
        i ^= (i & w) >> 1;
        i = i.wrapping_mul(1 | p >> 27);
        i = i.wrapping_mul(0x6935_fa69);
        i ^= (i & w) >> 11;
        i = i.wrapping_mul(0x74dc_b303);
        i ^= (i & w) >> 2;
        i = i.wrapping_mul(0x9e50_1cc3);
        i ^= (i & w) >> 2;
        i = i.wrapping_mul(0xc860_a3df);
        i &= w;
        i ^= i >> 5;
        if i < n {
            return (i.wrapping_add(p)) % n;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_index_is_uniform_over_the_scrambles() {
        const CELLS: usize = 64;
        const N: u64 = 64 * 256;
        for (index, dimension) in [(0, 0), (0, 1), (0, 20), (1, 0), (2, 2), (5, 7), (70_000, 3)] {
            let mut counts = [0_u32; CELLS];
            for seed in 0..N {
                counts[(sample(index, dimension, seed) * CELLS as f32) as usize] += 1;
            }
            let expected = N as f64 / CELLS as f64;
            let chi2: f64 = counts.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum();
            // 63 degrees of freedom: beyond 120 with probability 2e-5.
            assert!(chi2 < 120.0, "index {index}, dimension {dimension}: {chi2}");
        }
    }

    #[test]
    fn permutations_are_bijections() {
        for n in [2, 3, 5, 17, 64, 719] {
            for p in [0, 1, 0xdead_beef] {
                let mut seen = vec![false; n as usize];
                for i in 0..n {
                    seen[permute(i, n, p) as usize] = true;
                }
                assert!(seen.iter().all(|&s| s), "{n} {p}");
            }
        }
    }
}
