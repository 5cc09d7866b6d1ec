//! The largest difference between a decoded pixel and the textbook, and which pixels are too near a
//! threshold to compare.
//!
//! The bounds are those of a kernel in 16-bit lanes; they hold for every back-end.

use super::stack::Stack;
use algo::pipeline::PhaseMap;
use algo::units::{AbsolutePhase, Modulation};
use std::f64::consts::{SQRT_2, TAU};
use tests::oracle::demodulate::Demodulated;
use tests::oracle::unwrap::Form;
use tests::oracle::{Level, PixelTwin, Reason};

/// The arctangent: a polynomial of degree 5, with a reciprocal from one Newton iteration
/// (`algo/src/phase/fold.rs`).
pub const ARCTANGENT: f64 = 2.5e-5;
/// The arctangent of geometric levels below the finest, which give only orders: a cubic with a
/// cubic reciprocal. Every pair of 8-bit differences is within this bound
/// (`every_rough_angle_is_within_the_bound` of `algo`).
const ROUGH_ARCTANGENT: f64 = 3.4e-4;
/// Half a unit of 1/65536 turn.
pub const ROUNDING: f64 = 1.0 / 131_072.0;
/// S and C lie within ± N/2 of full scale; with 16 bits the rounding of each is 2⁻¹⁷ of N times
/// full scale.
const SUMS: f64 = 1.0 / 131_072.0;
/// Half the last bit of a weight in Q15.
const WEIGHTS: f64 = 1.0 / 65_536.0;
/// Half the last bit of a factor (a ratio, its inverse, n) in Q20: its effect on a phase of one
/// turn.
const FACTORS: f64 = 1.0 / 2_097_152.0;
/// Weights of 8 significant bits: the ratio of two is off by at most two parts in 256, so a mean
/// changes by at most this share of the range of its values.
const MEAN: f64 = 1.0 / 128.0;
/// B is reported to 8 significant bits at the threshold (16/255: 257 of 4095 units), off by up to
/// two units; σ_z has the same bound.
const MODULATION: f64 = 2.0 / 257.0;
/// Masks may differ on this share of the pixels, apart from those on a threshold.
const MASK_SHARE: f64 = 1e-4;
/// At most this share of the pixels may be on a threshold, or too little would be compared.
const TIE_SHARE: f64 = 0.03;
/// RMS of the error of the finest level of a geometric sequence, turns: 1e-5 for the arctangent,
/// and as much for sums and weights, whose worst case is 2.8e-5 at a quarter of full scale.
const RMS: f64 = 2e-5;

/// How much the rounding of a level's samples can change (S, C), in counts of B.
fn rounding_counts(level: &Level, seen: &Demodulated, stack: &Stack) -> f64 {
    if is_exact(level, stack) {
        return 0.0;
    }
    let full_scale = f64::from(stack.full_scale());
    // (2/N) · √2 · (N · SUMS · full scale + Σ I · WEIGHTS)
    2.0 * SQRT_2 * (SUMS * full_scale + WEIGHTS * seen.offset)
}

/// Differences of 8-bit samples with weights 0 and ± 1 need no rounding.
fn is_exact(level: &Level, stack: &Stack) -> bool {
    let quarter = |shift: &f64| (4.0 * shift).fract() == 0.0;
    stack.bit_depth == 8 && level.shifts.len() == 4 && level.shifts.iter().all(quarter)
}

/// Largest error of a level's wrapped phase, turns.
fn wrapped(level: &Level, seen: &Demodulated, stack: &Stack) -> f64 {
    let rounded = rounding_counts(level, seen, stack) / seen.modulation / TAU;
    ARCTANGENT + ROUNDING + rounded
}

/// Largest error of a resolved pixel's Φ, turns.
fn absolute(form: Form, levels: &[Level], twin: &PixelTwin, map: f64, stack: &Stack) -> f64 {
    let each = levels.iter().zip(&twin.levels);
    let each = each.map(|(level, seen)| (level.ratio, wrapped(level, seen, stack)));
    let worst = |pairs: &mut dyn Iterator<Item = (f64, f64)>| {
        pairs.fold(0.0_f64, |worst, (ratio, error)| worst.max(error / ratio))
    };
    if let Form::Geometric { .. } = form {
        let last = levels.len() - 1;
        let ratio = levels[last].ratio;
        let scaled = if ratio == 1.0 {
            0.0
        } else {
            (twin.phase * ratio).abs() * FACTORS + ROUNDING
        };
        worst(&mut each.skip(last)) + scaled
    } else {
        // r Φ₀ is rounded too, and then the sum and each step of the mean.
        let relative = worst(&mut each.map(|(ratio, error)| (ratio, error + ROUNDING)));
        let spread = twin.doubt.map_or(0.0, |doubt| doubt.spread);
        let factor = (twin.phase - map).abs() * FACTORS;
        relative + MEAN * spread + factor + 3.0 * ROUNDING
    }
}

/// Whether a pixel is so near a threshold that rounding may decide.
fn on_a_threshold(levels: &[Level], twin: &PixelTwin, stack: &Stack) -> bool {
    let each = || levels.iter().zip(&twin.levels);
    let counts = each().fold(0.0_f64, |worst, (level, seen)| {
        worst.max(rounding_counts(level, seen, stack))
    });
    if twin.on_the_threshold(counts) {
        return true;
    }
    let Some(doubt) = twin.doubt else {
        return false;
    };
    let error = each().fold(0.0_f64, |worst, (level, seen)| {
        worst.max(wrapped(level, seen, stack))
    });
    let rough = match stack.form() {
        Form::Geometric { .. } if levels.len() > 1 => ROUGH_ARCTANGENT - ARCTANGENT,
        _ => 0.0,
    };
    doubt.slack <= error + rough + ROUNDING + MEAN * doubt.spread + factors(levels, stack)
}

/// How much the rounding of the factors changes a decision, as an error of the wrapped phases,
/// turns.
fn factors(levels: &[Level], stack: &Stack) -> f64 {
    let turns = stack.range.max.abs().max(stack.range.min.abs());
    match stack.form() {
        // n · Φ of the coarser level, in a decision that weights wrapped phases by n + 1.
        Form::Geometric { .. } => levels.windows(2).fold(0.0_f64, |worst, pair| {
            let n = pair[1].ratio / pair[0].ratio;
            worst.max(FACTORS * turns * pair[0].ratio / (n + 1.0))
        }),
        // r · D, with D within ± n²/2.
        Form::DenseThree { n } => FACTORS * n * n / 2.0,
        Form::DenseTwo { n } => FACTORS * n / 2.0,
        Form::Single => 0.0,
    }
}

/// The results of comparing many stacks with the textbook.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    pub stacks: usize,
    pub pixels: usize,
    pub resolved: usize,
    /// Pixels on a threshold, which are not compared.
    pub ties: usize,
    /// Pixels whose masks differ.
    pub masks: usize,
    /// Squares of the errors of geometric levels of ratio 1.
    squares: f64,
    squared: usize,
    /// The largest error as a share of its bound.
    pub worst_share: f64,
    /// The largest error in turns.
    pub worst: f64,
}

impl Tally {
    /// Compares a decoded stack with the textbook: phases within their bound, which includes the
    /// fringe orders, modulations, and masks.
    pub fn add(&mut self, stack: &Stack, found: &PhaseMap) {
        let (levels, form, twins) = (stack.levels(), stack.form(), stack.twins());
        let full_scale = stack.full_scale();
        self.stacks += 1;
        for (pixel, twin) in twins.iter().enumerate() {
            self.pixels += 1;
            if on_a_threshold(&levels, twin, stack) {
                self.ties += 1;
                continue;
            }
            if found.trust[pixel].word() != twin.reason.word() {
                self.masks += 1;
                continue;
            }
            if twin.reason != Reason::Resolved {
                continue;
            }
            self.resolved += 1;
            let map = stack.map.as_ref().map_or(0.0, |map| map[pixel].turns());
            let bound = absolute(form, &levels, twin, map, stack);
            let error = error(found.phase[pixel], twin.phase);
            assert!(
                error <= bound,
                "pixel {pixel}: {} turns where the textbook has {}, off by {error:.2e} and not \
                 {bound:.2e}: {:?}, {} bit",
                found.phase[pixel].turns(),
                twin.phase,
                stack.frames,
                stack.bit_depth
            );
            self.worst_share = self.worst_share.max(error / bound);
            self.worst = self.worst.max(error);
            if matches!(form, Form::Geometric { .. }) && levels[levels.len() - 1].ratio == 1.0 {
                self.squares += error * error;
                self.squared += 1;
            }
            check_modulation(found.modulation[pixel], twin, full_scale);
        }
    }

    /// RMS error over geometric levels whose finest ratio is 1, turns.
    pub fn rms(&self) -> f64 {
        (self.squares / self.squared.max(1) as f64).sqrt()
    }

    /// Prints the figures and checks those over all pixels.
    pub fn conclude(&self, name: &str) {
        println!(
            "{name}: {} stacks, {} pixels, {} resolved, {} on a threshold, {} other masks; worst error \
             {:.2e} turn, {:.0} % of its bound at most, RMS (geometric) {:.2e}",
            self.stacks,
            self.pixels,
            self.resolved,
            self.ties,
            self.masks,
            self.worst,
            100.0 * self.worst_share,
            self.rms()
        );
        assert!(self.resolved > 0, "{name}: nothing was compared");
        assert!((self.ties as f64) < TIE_SHARE * self.pixels as f64);
        assert!(self.rms() <= RMS, "{name}: {:e}", self.rms());
        let allowed = (self.pixels as f64 * MASK_SHARE).floor() as usize;
        assert!(self.masks <= allowed, "{name}: {} masks", self.masks);
    }
}

/// |Φ − Φ_textbook|, turns.
fn error(found: AbsolutePhase, truth: f64) -> f64 {
    (found.turns() - truth).abs()
}

/// The modulation of the finest level.
fn check_modulation(found: Modulation, twin: &PixelTwin, full_scale: u16) {
    let truth = twin.levels[twin.levels.len() - 1].modulation;
    let found_counts = found.counts(full_scale);
    let off = found_counts / truth - 1.0;
    // Of a pixel with clipped samples it is no more than words hold, half of full scale or more.
    let most = 0.49 * f64::from(full_scale);
    if truth > most && (most..truth).contains(&found_counts) {
        return;
    }
    assert!(off.abs() <= MODULATION, "{found:?} where B is {truth}");
}
