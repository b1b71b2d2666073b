//! Halton sequence with Owen-scrambled digits.

use crate::math::{ONE_MINUS_EPSILON, hash::hash_words};

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

/// Bases; further dimensions reuse them under another seed.
static PRIMES: [u32; 128] = first_primes();

/// Value `index` of dimension `dimension` under scramble `seed`, in [0, 1).
///
/// \[PBRT4\] 8.6.4 (Owen-scrambled radical inverse): each digit is permuted at
/// random by a hash of the digits before it.
pub fn sample(index: u32, dimension: u32, seed: u64) -> f32 {
    let base = PRIMES[dimension as usize % PRIMES.len()];
    let seed = hash_words(&[seed, u64::from(dimension)]);
    let inv_base = 1.0 / f64::from(base);
    let (mut rest, mut reversed, mut scale) = (u64::from(index), 0_u64, 1.0_f64);
    // Until the remaining digits cannot change an f32.
    while scale > 1e-8 {
        let digit = (rest % u64::from(base)) as u32;
        rest /= u64::from(base);
        let p = permute(digit, base, hash_words(&[seed, reversed]) as u32);
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
