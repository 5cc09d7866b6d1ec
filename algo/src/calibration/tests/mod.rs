//! Synthetic twins of boards and heads, whose truth is known.

mod heads;
mod pictures;

use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// Random numbers from a seed.
struct Random(SplitMix64);

impl Random {
    fn new(seed: u64) -> Self {
        Self(SplitMix64::seed_from_u64(seed))
    }

    /// Uniform between −1 and 1.
    fn signed(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// Normal, of mean 0 and σ 1 (Box and Muller, 1958).
    fn normal(&mut self) -> f64 {
        let radius = libm::sqrt(-2.0 * libm::log((self.signed() + 1.0) / 2.0 + 1e-300));
        radius * libm::cos(core::f64::consts::PI * self.signed())
    }
}
