//! The sequences that the probe decodes.

use super::Outcome;
use algo::pattern::{PhaseRange, Sequence, Shot};
use algo::phase::Decoder;

/// A sequence and the depth of its samples.
pub struct Case {
    /// Form, levels × shifts or the shifts of each level, bits.
    pub name: String,
    /// Ratio and number of shifts of each level, from coarse to fine.
    pub levels: Vec<(f64, usize)>,
    /// Bits of a sample.
    pub bits: u8,
}

/// Fringes of the phase function.
pub const FRINGES: i64 = 64;

/// Every form, every number of shifts with a path of its own and some without, every sample type.
pub const CASES: &[&str] = &[
    "geometric-3x4-8",
    "geometric-3x3-8",
    "geometric-3x5-8",
    "geometric-2x8-8",
    "geometric-3x4-10",
    "geometric-3x3-12",
    "geometric-3x4-12",
    "geometric-3x4-16",
    "dense-3x4-8",
    "dense-3x3-8",
    "dense-2x4-8",
    "dense-3x4-12",
    "single-4-8",
    "single-3-8",
    "single-4-10",
    "single-4-12",
    "geometric-3x6-8",
    "geometric-3x7-8",
    "geometric-3x8-8",
    "geometric-3x9-8",
    "geometric-2x10-8",
    "geometric-3x5-12",
    "geometric-3x6-12",
    "geometric-3x7-10",
    "geometric-3x8-12",
    "geometric-3x9-12",
    "geometric-3x3-16",
    "geometric-3x5-14",
    "geometric-3x6-16",
    "geometric-3x7-16",
    "geometric-3x8-16",
    "geometric-3x9-16",
    "dense-7+5-8",
    "dense-3x6-10",
    "single-5-8",
    "single-9-12",
];

/// All of [`CASES`].
pub fn all() -> impl Iterator<Item = Outcome<Case>> {
    CASES.iter().map(|name| Case::named(name))
}

impl Case {
    /// The case of a name, which need not be one of [`CASES`].
    pub fn named(name: &str) -> Outcome<Self> {
        let [form, levels, bits] = name.split('-').collect::<Vec<_>>()[..] else {
            return Err(format!("{name} is not FORM-LEVELS-BITS").into());
        };
        let shifts: Vec<usize> = match levels.split_once('x') {
            Some((levels, shifts)) => vec![shifts.parse()?; levels.parse()?],
            None => levels
                .split('+')
                .map(str::parse)
                .collect::<Result<_, _>>()?,
        };
        let ratios: &[f64] = match (form, shifts.len()) {
            ("geometric", 3) => &[1.0 / 64.0, 1.0 / 8.0, 1.0],
            ("geometric", 2) => &[1.0 / 64.0, 1.0],
            // n = 6 and n = 5.
            ("dense", 3) => &[1.0 - 1.0 / 6.0, 1.0 - 1.0 / 36.0, 1.0],
            ("dense", 2) => &[1.0 - 1.0 / 5.0, 1.0],
            ("single", 1) => &[1.0],
            _ => {
                return Err(
                    format!("{name} has a form or number of levels that is not known").into(),
                );
            }
        };
        Ok(Self {
            name: name.into(),
            levels: ratios.iter().copied().zip(shifts).collect(),
            bits: bits.parse()?,
        })
    }

    /// Ratio, place k of the shift k/N, and N of each frame, in the order in which they are taken.
    pub fn frames(&self) -> impl Iterator<Item = (f64, usize, usize)> {
        let shifts = |&(ratio, shifts)| (0..shifts).map(move |k| (ratio, k, shifts));
        self.levels.iter().flat_map(shifts)
    }

    /// Whether the levels are unwrapped about a map.
    pub fn needs_map(&self) -> bool {
        self.levels[0].0 > 1.0 / FRINGES as f64
    }

    /// The decoder, on the machine's best back-end.
    pub fn decoder(&self) -> Outcome<Decoder> {
        let levels = self.levels.iter();
        let frames: Vec<Shot> = levels
            .flat_map(|&(ratio, shifts)| Shot::level(ratio, shifts))
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
