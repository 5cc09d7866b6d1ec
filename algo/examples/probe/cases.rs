//! The sequences that the probe decodes.

use super::Outcome;
use algo::pattern::{PhaseRange, Sequence, Shot};
use algo::phase::Decoder;

/// A sequence and the depth of its samples.
pub struct Case {
    /// Form, levels × shifts, bits.
    pub name: &'static str,
    /// Ratio of each level, from coarse to fine.
    pub ratios: &'static [f64],
    /// Shifts of each level.
    pub shifts: usize,
    /// Bits of a sample.
    pub bits: u8,
}

/// Fringes of the phase function.
pub const FRINGES: i64 = 64;

const GEOMETRIC: &[f64] = &[1.0 / 64.0, 1.0 / 8.0, 1.0];
const GEOMETRIC_TWO: &[f64] = &[1.0 / 64.0, 1.0];
/// n = 6.
const DENSE: &[f64] = &[1.0 - 1.0 / 6.0, 1.0 - 1.0 / 36.0, 1.0];
/// n = 5.
const DENSE_TWO: &[f64] = &[1.0 - 1.0 / 5.0, 1.0];
const SINGLE: &[f64] = &[1.0];

/// Every form, numbers of shifts with and without a path of their own, every sample type.
pub const CASES: &[Case] = &[
    case("geometric-3x4-8", GEOMETRIC, 4, 8),
    case("geometric-3x3-8", GEOMETRIC, 3, 8),
    case("geometric-3x5-8", GEOMETRIC, 5, 8),
    case("geometric-2x8-8", GEOMETRIC_TWO, 8, 8),
    case("geometric-3x4-10", GEOMETRIC, 4, 10),
    case("geometric-3x3-12", GEOMETRIC, 3, 12),
    case("geometric-3x4-12", GEOMETRIC, 4, 12),
    case("geometric-3x4-16", GEOMETRIC, 4, 16),
    case("dense-3x4-8", DENSE, 4, 8),
    case("dense-3x3-8", DENSE, 3, 8),
    case("dense-2x4-8", DENSE_TWO, 4, 8),
    case("dense-3x4-12", DENSE, 4, 12),
    case("single-4-8", SINGLE, 4, 8),
    case("single-3-8", SINGLE, 3, 8),
    case("single-4-10", SINGLE, 4, 10),
    case("single-4-12", SINGLE, 4, 12),
];

const fn case(name: &'static str, ratios: &'static [f64], shifts: usize, bits: u8) -> Case {
    Case {
        name,
        ratios,
        shifts,
        bits,
    }
}

impl Case {
    /// Ratio and place k of the shift k/N of each frame, in the order in which they are taken.
    pub fn frames(&self) -> impl Iterator<Item = (f64, usize)> {
        let shifts = |&ratio| (0..self.shifts).map(move |k| (ratio, k));
        self.ratios.iter().flat_map(shifts)
    }

    /// Whether the levels are unwrapped about a map.
    pub fn needs_map(&self) -> bool {
        self.ratios[0] > 1.0 / FRINGES as f64
    }

    /// The decoder, on the machine's best back-end.
    pub fn decoder(&self) -> Outcome<Decoder> {
        let levels = self.ratios.iter();
        let frames: Vec<Shot> = levels
            .flat_map(|&ratio| Shot::level(ratio, self.shifts))
            .collect();
        let range = PhaseRange {
            min: 0.0,
            max: FRINGES as f64,
        };
        Ok(Decoder::new(
            &Sequence::from_frames(&frames)?,
            range,
            self.bits,
        )?)
    }
}
