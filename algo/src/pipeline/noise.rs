//! The noise of one sample, estimated from the redundancy of levels with 4 or more shifts.

use super::map_rows;
use crate::frame::{FrameView, Samples};
use crate::math::complex::Complex;
use crate::pattern::{Level, Sequence};
use crate::phase::Trust;
use alloc::vec::Vec;
use core::f64::consts::TAU;

/// σ_I, the noise of one sample in counts; `None` if no level has redundancy or no pixel is
/// resolved.
///
/// A level of N shifts has N − 3 degrees of freedom beside offset, modulation and phase: the places
/// 2 to N − 2 of the level's discrete Fourier transform X_p = Σ I_k e^(−2πi kp/N), of which p and
/// N − p are one another's mirror images. Noise has the expectation N σ_I² of |X_p|² there.
/// Averaged over all resolved pixels without clipped samples and all such levels.
///
/// **Harmonics.** A response that is not linear makes harmonics of the fringes, which N shifts
/// cancel in the phase, but not in these places: harmonic h, of r_h times the modulation, adds
/// r_h |X_1| e^(ihφ) to the place h mod N. φ and |X_1| are known in each pixel, and r_h changes
/// slowly, so in each run of 64 pixels of a row the two harmonics p and N − p of each place
/// are fitted by least squares and taken off, each with its degrees of freedom, and so is what the
/// noise of φ and |X_1| adds.
///
/// Harmonics of a *projected* waveform are large, and optics attenuate them by an unknown factor;
/// the places that they fall on are left out. The waveforms for 5, 7 and 9 shifts leave none, those
/// for 6 and 8 shifts 2 and 3.
///
/// **Accuracy.** A response of gamma 2, N = 4 to 12: within 6 %
/// (`harmonics_of_a_response_are_not_taken_for_noise`).
pub fn sample_noise(
    sequence: &Sequence,
    frames: &[FrameView<'_>],
    full_scale: u16,
    trust: &[Trust],
) -> Option<f64> {
    sine_residuals(sequence, frames, full_scale, trust)?.noise()
}

/// Pixels of a row over which the harmonics of a response are the same shares of the modulation.
const RUN: usize = 64;
/// Two harmonics cannot be separated where the squared sine between them, over the pixels of a
/// run, is below this.
const ALIKE: f64 = 1e-6;
/// From this squared sine on, the share of each harmonic is well determined by itself.
const CLEARLY: f64 = 0.1;

/// Sums of squares of what a sine leaves of the samples, counts².
#[derive(Clone, Copy, Debug, Default)]
pub struct SineResiduals {
    /// Without harmonics, and the degrees of freedom in it.
    noise: f64,
    freedom: f64,
    /// With them, and the number of samples.
    all: f64,
    samples: f64,
}

impl SineResiduals {
    /// σ_I as [`sample_noise`].
    fn noise(&self) -> Option<f64> {
        (self.freedom > 0.0).then(|| libm::sqrt(self.noise / self.freedom))
    }

    /// RMS of noise and harmonics together, counts.
    pub fn off_sine(&self) -> Option<f64> {
        (self.samples > 0.0).then(|| libm::sqrt(self.all / self.samples))
    }
}

impl core::ops::Add for SineResiduals {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            noise: self.noise + other.noise,
            freedom: self.freedom + other.freedom,
            all: self.all + other.all,
            samples: self.samples + other.samples,
        }
    }
}

/// What the sines that fit levels with 4 or more shifts best leave of their samples; `None` without frames.
pub fn sine_residuals(
    sequence: &Sequence,
    frames: &[FrameView<'_>],
    full_scale: u16,
    trust: &[Trust],
) -> Option<SineResiduals> {
    let levels: Vec<Transform> = sequence
        .levels()
        .iter()
        .filter_map(Transform::new)
        .collect();
    let width = frames.first()?.width();
    let rows = map_rows(frames[0].height(), |v| {
        let rows: Vec<Samples<'_>> = frames.iter().map(|frame| frame.row(v)).collect();
        let mut sum = SineResiduals::default();
        for from in (0..width).step_by(RUN) {
            let run = from..width.min(from + RUN);
            let is_whole = |u: usize| rows.iter().all(|row| row.at(u) < full_scale);
            let resolved = run.filter(|&u| trust[v * width + u] == Trust::Resolved && is_whole(u));
            let resolved: Vec<usize> = resolved.collect();
            for level in levels.iter().filter(|_| !resolved.is_empty()) {
                sum = sum + level.residuals(&rows, &resolved);
            }
        }
        sum
    });
    // Summed in the order of the rows, so that the result does not depend on the number of threads.
    Some(
        rows.into_iter()
            .fold(SineResiduals::default(), |sum, row| sum + row),
    )
}

/// The places of a level's discrete Fourier transform that have noise and harmonics of the
/// response.
struct Transform {
    /// Places of the frames in the sequence.
    frames: Vec<usize>,
    /// Cosine and sine of the fundamental for each frame.
    first: Vec<Complex>,
    /// Each place, with cosine and sine for each frame.
    places: Vec<(usize, Vec<Complex>)>,
}

/// Sums over the pixels of a run for one place: X is what is seen there, a and b what harmonics p
/// and N − p of a share of 1 would show.
#[derive(Clone, Copy, Default)]
struct HarmonicSums {
    xx: f64,
    aa: f64,
    bb: f64,
    ab: Complex,
    ax: Complex,
    bx: Complex,
}

impl HarmonicSums {
    fn add(&mut self, x: Complex, a: Complex, b: Complex) {
        self.xx += x.square();
        self.aa += a.square();
        self.bb += b.square();
        self.ab += a * b.conj();
        self.ax += a * x.conj();
        self.bx += b * x.conj();
    }

    /// Fits the harmonics `place` and `shifts` − `place`.
    fn fitted(&self, place: usize, shifts: usize) -> Fitted {
        // By how much noise of |X_1| and φ turns and stretches harmonic h of a share of 1.
        let stirred = |order: usize| (1.0 + (order * order) as f64) / 2.0;
        let by_one = if self.aa > 0.0 {
            self.ax.square() / self.aa
        } else {
            0.0
        };
        let real = if 2 * place == shifts { 0.5 } else { 1.0 };
        let stirred_one = real * stirred(place) * by_one / self.aa.max(1.0);
        let determinant = self.aa * self.bb - self.ab.square();
        let apart = determinant / (self.aa * self.bb);
        if !(apart > ALIKE) {
            return Fitted {
                left: self.xx - by_one,
                coefficients: 1.0,
                stirred: stirred_one,
            };
        }
        let crossed = (self.ax * self.bx.conj()).dot(self.ab);
        let explained = self.bb * self.ax.square() + self.aa * self.bx.square() - 2.0 * crossed;
        // a b* x and a* b x, the coefficients' numerators beside those of each alone.
        let across = self.bx * self.ab;
        let along = self.ax * self.ab.conj();
        let numerator_a = (self.ax * self.bb - across).square();
        let numerator_b = (self.bx * self.aa - along).square();
        let stirred_both = stirred(place) * numerator_a + stirred(shifts - place) * numerator_b;
        Fitted {
            left: self.xx - explained / determinant,
            coefficients: 2.0,
            stirred: match apart > CLEARLY {
                true => stirred_both / (determinant * determinant),
                false => stirred_one,
            },
        }
    }
}

/// What is found of one place in a run.
struct Fitted {
    /// Σ |X|² less what the harmonics explain of it.
    left: f64,
    /// How many complex coefficients explain it.
    coefficients: f64,
    /// What the noise of the fundamental, from which the harmonics are computed, adds to the place,
    /// as a share of its own noise.
    stirred: f64,
}

impl Transform {
    /// `None` if no place is left.
    fn new(level: &Level) -> Option<Self> {
        let shifts = level.shifts();
        let mirrored = |order: usize| (order % shifts).min(shifts - order % shifts);
        let taken: Vec<usize> = level
            .waveform
            .harmonics()
            .map(|(order, _)| mirrored(usize::from(order)))
            .collect();
        let taps = |place: usize| {
            let taps = (0..shifts).map(|k| {
                let angle = TAU * place as f64 * (level.start + k as f64 / shifts as f64);
                Complex::new(libm::cos(angle), libm::sin(angle))
            });
            taps.collect::<Vec<_>>()
        };
        let places = (2..=shifts / 2).filter(|place| !taken.contains(place));
        let places: Vec<_> = places.map(|place| (place, taps(place))).collect();
        (!places.is_empty()).then(|| Self {
            frames: level.frames.iter().map(|&at| usize::from(at)).collect(),
            first: taps(1),
            places,
        })
    }

    /// Of these pixels of a row.
    fn residuals(&self, rows: &[Samples<'_>], pixels: &[usize]) -> SineResiduals {
        let shifts = self.frames.len();
        let mut sums = alloc::vec![HarmonicSums::default(); self.places.len()];
        // What each harmonic of a share of 1 shows, from order 0.
        let mut harmonics = alloc::vec![Complex::default(); shifts - 1];
        for &u in pixels {
            // X of a place whose shifts begin at 0: I_k e^(−2πi pk/N) with the angle of the frame.
            let seen = |taps: &[Complex]| {
                let pairs = self.frames.iter().zip(taps);
                pairs.fold(Complex::default(), |sum, (&frame, &tap)| {
                    sum + tap.conj() * f64::from(rows[frame].at(u))
                })
            };
            let fundamental = seen(&self.first);
            let size = fundamental.length();
            let turn = match size > 0.0 {
                true => fundamental * (1.0 / size),
                false => Complex::default(),
            };
            harmonics[0] = Complex::new(size, 0.0);
            for order in 1..shifts - 1 {
                harmonics[order] = harmonics[order - 1] * turn;
            }
            for (sum, (place, taps)) in sums.iter_mut().zip(&self.places) {
                let (own, mirrored) = (harmonics[*place], harmonics[shifts - place]);
                sum.add(seen(taps), own, mirrored.conj());
            }
        }
        let mut found = SineResiduals::default();
        let count = pixels.len() as f64;
        for (sum, (place, _)) in sums.iter().zip(&self.places) {
            let fitted = sum.fitted(*place, shifts);
            // The mirror image has as much again; the place of half of all shifts is its own, and
            // real.
            let share = if 2 * place == shifts { 1.0 } else { 2.0 };
            found.noise += share * fitted.left.max(0.0) / (1.0 + fitted.stirred) / shifts as f64;
            found.freedom += share * (count - fitted.coefficients);
            found.all += share * sum.xx / shifts as f64;
        }
        found.samples = count * shifts as f64;
        found
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::pattern::{Shot, Waveform};

    /// Frames of a scene with a side of so many pixels, from the sample of each pixel under each
    /// shot.
    pub fn frames(
        side: usize,
        shots: &[Shot],
        mut light: impl FnMut(&Shot, usize) -> f64,
    ) -> Vec<Vec<u8>> {
        let mut sample = |shot, at| libm::rint(light(shot, at)) as u8;
        let frame = |shot| (0..side * side).map(|at| sample(shot, at)).collect();
        shots.iter().map(frame).collect()
    }

    pub fn views(side: usize, frames: &[Vec<u8>]) -> Vec<FrameView<'_>> {
        let frames = frames.iter();
        frames
            .map(|frame| FrameView::new(Samples::Eight(frame), side, side, side).unwrap())
            .collect()
    }

    /// σ of uniform noise of ±6 counts, from samples of a waveform with half of the harmonics'
    /// contrast.
    #[test]
    fn harmonics_of_a_waveform_are_not_taken_for_noise() {
        const SIDE: usize = 128;
        let mut state = 1_u64;
        let mut noise = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            12.0 * ((state >> 33) as f64 / f64::from(1_u32 << 31)) - 6.0
        };
        for (shifts, freedom) in [(3, 0), (4, 1), (5, 0), (6, 2), (7, 0), (8, 3), (9, 0)] {
            let shots: Vec<Shot> = Shot::level_as(1.0, shifts, Waveform::brightest).collect();
            let sequence = Sequence::from_frames(&shots).unwrap();
            let places = Transform::new(&sequence.levels()[0])
                .map_or(Vec::new(), |transform| transform.places);
            let free = places.iter().map(|(place, _)| match 2 * place == shifts {
                true => 1,
                false => 2,
            });
            assert_eq!(free.sum::<usize>(), freedom, "{shifts} shifts");
            let blurred = shots[0].waveform.harmonics();
            let blurred: Vec<_> = blurred.map(|(order, share)| (order, share / 2.0)).collect();
            let blurred = Waveform::of(&blurred);
            let frames = frames(SIDE, &shots, |shot, at| {
                120.0 + 80.0 * blurred.unscaled(at as f64 / 37.3 + shot.shift) + noise()
            });
            let views = views(SIDE, &frames);
            let trust = [Trust::Resolved; SIDE * SIDE];
            let found = sample_noise(&sequence, &views, u16::MAX, &trust);
            assert_eq!(found.is_some(), freedom > 0, "{shifts} shifts");
            // 6/√3, and rounding to whole counts.
            let expected = libm::sqrt(12.0 + 1.0 / 12.0);
            if let Some(found) = found {
                assert!((found / expected - 1.0).abs() < 0.03, "{shifts}: {found}");
            }
        }
    }

    /// σ of uniform noise of ±6 counts under a projector of gamma 2, whose second harmonic has a
    /// quarter of the modulation.
    #[test]
    fn harmonics_of_a_response_are_not_taken_for_noise() {
        const SIDE: usize = 128;
        let mut state = 7_u64;
        for shifts in 4..=12 {
            for ratio in [1.0 / 64.0, 1.0] {
                let shots: Vec<Shot> = Shot::level(ratio, shifts).collect();
                let sequence = Sequence::from_frames(&shots).unwrap();
                let frames = frames(SIDE, &shots, |shot, at| {
                    state = state
                        .wrapping_mul(6_364_136_223_846_793_005)
                        .wrapping_add(1);
                    let noise = 12.0 * ((state >> 33) as f64 / f64::from(1_u32 << 31)) - 6.0;
                    let turns = ratio * at as f64 / 37.3 + shot.shift;
                    let projected = 0.5 + 0.5 * libm::sin(TAU * turns);
                    30.0 + 180.0 * projected * projected + noise
                });
                let views = views(SIDE, &frames);
                let trust = [Trust::Resolved; SIDE * SIDE];
                let found = sample_noise(&sequence, &views, u16::MAX, &trust).unwrap();
                let expected = libm::sqrt(12.0 + 1.0 / 12.0);
                assert!(
                    (0.96..1.06).contains(&(found / expected)),
                    "{shifts} shifts, {ratio}: {found} for {expected}"
                );
                // The harmonic's amplitude is 22.5 counts; noise adds its share of the places.
                let left = sine_residuals(&sequence, &views, u16::MAX, &trust).unwrap();
                let off = left.off_sine().unwrap();
                let share = (shifts as f64 - 3.0) / shifts as f64;
                // Of an amplitude a the mean square is a²/2; the only place of 4 shifts has a².
                let harmonic = 22.5 * 22.5 / 2.0;
                let both = libm::sqrt(harmonic + share * expected * expected);
                assert!(
                    (off / both - 1.0).abs() < 0.03,
                    "{shifts}: {off} for {both}"
                );
            }
        }
    }
}
