//! The reference that kernels are compared with: the textbook's formulas in floating point, one
//! pass over whole frames per operation, as in a first implementation.
//!
//! The sums S and C, atan2, modulation and the unwrapping of each level each pass over the frame
//! and store an intermediate result of its size. The intermediate results are allocated once and
//! reused, which favours the reference. It runs in `f64` and in `f32`.

use super::frames::{Buffer, FrameSet};
use super::real::Real;
use super::timing::Kernel;
use algo::pattern::{Level, PhaseRange, Sequence, Unwrapping};
use algo::phase::{DecodeError, FULL_TRUST_SHIFTS, LeastModulation};
use algo::units::AbsolutePhase;

/// Largest residual of a level that is unwrapped, turns.
const MAX_RESIDUAL: f64 = 0.40;

/// A decoder of whole frames in the precision `T`.
pub struct Textbook<T> {
    levels: Vec<LevelWeights<T>>,
    unwrapping: Unwrapping,
    /// Lowest phase of the coarsest level of a geometric sequence, turns of that level.
    lowest: T,
    full_scale: T,
    least_modulation: T,
    sums: [Vec<T>; 2],
    wrapped: Vec<Vec<T>>,
    modulation: Vec<Vec<T>>,
    trusted: Vec<bool>,
    phase: Vec<T>,
    weights: Vec<T>,
}

/// One level: its frames, and what each sample counts in S and C.
struct LevelWeights<T> {
    frames: Vec<usize>,
    cos: Vec<T>,
    sin: Vec<T>,
    ratio: T,
}

impl<T: Real> LevelWeights<T> {
    fn new(level: &Level) -> Self {
        let shifts = level.shifts();
        let angles = (0..shifts).map(|k| {
            let turns = level.start + k as f64 / shifts as f64;
            std::f64::consts::TAU * turns
        });
        Self {
            frames: level.frames.iter().map(|&at| usize::from(at)).collect(),
            cos: angles.clone().map(|angle| T::of(angle.cos())).collect(),
            sin: angles.map(|angle| T::of(angle.sin())).collect(),
            ratio: T::of(level.ratio),
        }
    }

    fn shifts(&self) -> T {
        T::of(self.frames.len() as f64)
    }
}

impl<T: Real> Textbook<T> {
    /// A decoder for a sequence of a phase function with this range, and frames of `pixels`
    /// samples.
    ///
    /// # Errors
    /// If the ratios of the levels have none of the forms that can be unwrapped.
    pub fn new(
        sequence: &Sequence,
        range: PhaseRange,
        bit_depth: u8,
        pixels: usize,
    ) -> Result<Self, DecodeError> {
        let unwrapping = Unwrapping::recognise(sequence, range)?;
        let coarsest = sequence.levels()[0].ratio;
        let margin = (1.0 - coarsest * range.span()).max(0.0) / 2.0;
        let full_scale = f64::from((1_u32 << bit_depth) - 1);
        let count = sequence.levels().len();
        // Not zero, so that the system maps the memory before the first run.
        let buffer = || vec![T::of(1.0); pixels];
        Ok(Self {
            levels: sequence.levels().iter().map(LevelWeights::new).collect(),
            unwrapping,
            lowest: T::of(coarsest * range.min - margin),
            full_scale: T::of(full_scale),
            least_modulation: T::of(
                LeastModulation::default().eight_bit() * full_scale / 255.0 - 1e-3,
            ),
            sums: [buffer(), buffer()],
            wrapped: vec![buffer(); count],
            modulation: vec![buffer(); count],
            trusted: vec![true; pixels],
            phase: buffer(),
            weights: buffer(),
        })
    }

    fn demodulate<S: Copy + Into<u16>>(&mut self, frames: &[&[S]]) {
        let tau = T::of(std::f64::consts::TAU);
        self.trusted.fill(true);
        for (at, level) in self.levels.iter().enumerate() {
            for (sums, weights) in self.sums.iter_mut().zip([&level.cos, &level.sin]) {
                sums.fill(T::of(0.0));
                for (&frame, &weight) in level.frames.iter().zip(weights) {
                    for (sum, &sample) in sums.iter_mut().zip(frames[frame]) {
                        *sum = *sum + T::from(sample.into()) * weight;
                    }
                }
            }
            let [s, c] = &self.sums;
            for (wrapped, (&s, &c)) in self.wrapped[at].iter_mut().zip(s.iter().zip(c)) {
                *wrapped = s.atan2(c) / tau;
            }
            let scale = T::of(2.0) / level.shifts();
            for (modulation, (&s, &c)) in self.modulation[at].iter_mut().zip(s.iter().zip(c)) {
                *modulation = scale * (s * s + c * c).sqrt();
            }
            for (trusted, &modulation) in self.trusted.iter_mut().zip(&self.modulation[at]) {
                *trusted &= modulation >= self.least_modulation;
            }
            if level.frames.len() < FULL_TRUST_SHIFTS {
                for &frame in &level.frames {
                    for (trusted, &sample) in self.trusted.iter_mut().zip(frames[frame]) {
                        *trusted &= T::from(sample.into()) < self.full_scale;
                    }
                }
            }
        }
    }

    /// Coarse to fine: k = round(n Φ − φ), Φ = k + φ.
    fn geometric(&mut self) {
        let lowest = self.lowest;
        for (phase, &wrapped) in self.phase.iter_mut().zip(&self.wrapped[0]) {
            let above = wrapped - lowest;
            *phase = lowest + above - above.floor();
        }
        for at in 1..self.levels.len() {
            let n = self.levels[at].ratio / self.levels[at - 1].ratio;
            let pixels = self.phase.iter_mut().zip(&mut self.trusted);
            for ((phase, trusted), &wrapped) in pixels.zip(&self.wrapped[at]) {
                let (order, fits) = order(n * *phase - wrapped);
                *trusted &= fits;
                *phase = wrapped + order;
            }
        }
        let finest = self.levels[self.levels.len() - 1].ratio;
        for phase in &mut self.phase {
            *phase = *phase / finest;
        }
    }

    /// Relative to a map Φ₀: q = φ − frac(r Φ₀), D from the beats, then the weighted mean of the D
    /// of each level.
    fn about(&mut self, map: &[AbsolutePhase]) {
        for (level, wrapped) in self.levels.iter().zip(&mut self.wrapped) {
            for (wrapped, map) in wrapped.iter_mut().zip(map) {
                *wrapped = wrap(*wrapped - level.ratio * T::of(map.turns()));
            }
        }
        let q = &self.wrapped;
        let pixels = self.phase.iter_mut().zip(&mut self.trusted);
        for (at, (phase, trusted)) in pixels.enumerate() {
            *phase = match self.unwrapping {
                Unwrapping::DenseThree { n } => {
                    let n = T::of(n);
                    let fast = wrap(q[2][at] - q[0][at]);
                    let slow = wrap(q[2][at] - q[1][at]);
                    let (order, fits) = order(n * slow - fast);
                    *trusted &= fits;
                    n * (fast + order)
                }
                Unwrapping::DenseTwo { n } => T::of(n) * wrap(q[1][at] - q[0][at]),
                _ => q[0][at] / self.levels[0].ratio,
            };
        }
        if self.levels.len() > 1 {
            self.average();
        }
        for (phase, map) in self.phase.iter_mut().zip(map) {
            *phase = *phase + T::of(map.turns());
        }
    }

    /// Moves D to the mean of the D of each level, weighted by N r² B²: ratio 1 first, then coarse
    /// to fine.
    fn average(&mut self) {
        let last = self.levels.len() - 1;
        self.weights.fill(T::of(0.0));
        for at in std::iter::once(last).chain(0..last) {
            let level = &self.levels[at];
            let share = level.shifts() * level.ratio * level.ratio;
            for pixel in 0..self.phase.len() {
                let q = self.wrapped[at][pixel];
                let (order, fits) = order(level.ratio * self.phase[pixel] - q);
                self.trusted[pixel] &= fits;
                let here = (q + order) / level.ratio;
                let modulation = self.modulation[at][pixel];
                let weight = share * modulation * modulation;
                let before = self.weights[pixel];
                let sum = before + weight;
                self.phase[pixel] = (before * self.phase[pixel] + weight * here) / sum;
                self.weights[pixel] = sum;
            }
        }
    }
}

impl<T: Real> Kernel for Textbook<T> {
    /// Decodes packed frames.
    fn run(&mut self, set: &mut FrameSet) {
        let pixels = set.pixels();
        match set.samples() {
            Buffer::Eight(all) => self.demodulate(&all.frames(pixels).collect::<Vec<_>>()),
            Buffer::Sixteen(all) => self.demodulate(&all.frames(pixels).collect::<Vec<_>>()),
        }
        match set.parts().1 {
            Some(map) => self.about(map),
            None => self.geometric(),
        }
        for (phase, &trusted) in self.phase.iter_mut().zip(&self.trusted) {
            if !trusted {
                *phase = T::of(f64::NAN);
            }
        }
    }

    fn turns(&self, _: &FrameSet) -> Vec<f64> {
        self.phase.iter().map(|&phase| phase.into()).collect()
    }
}

/// The nearest whole number, and whether the residual is small enough.
fn order<T: Real>(turns: T) -> (T, bool) {
    let order = turns.round();
    let left = turns - order;
    (order, left * left <= T::of(MAX_RESIDUAL * MAX_RESIDUAL))
}

/// An angle in turns, brought to −½ ≤ x < ½ by whole turns.
fn wrap<T: Real>(turns: T) -> T {
    turns - (turns + T::of(0.5)).floor()
}
