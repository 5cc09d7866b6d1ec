//! The noise of one sample, estimated from the redundancy of levels with 4 or more shifts.

use super::{PhaseMap, map_rows};
use crate::frame::{FrameView, Samples};
use crate::pattern::{Level, Sequence};
use crate::phase::Trust;
use alloc::vec::Vec;
use core::f64::consts::TAU;

/// σ_I, the noise of one sample in counts; `None` if no level has redundancy or no pixel is
/// resolved.
///
/// A level of N shifts has N − 3 degrees of freedom beside offset, modulation and phase:
/// Σ I² − (ΣI)²/N − (2/N)(S² + C²) has the expectation (N − 3) σ_I²; for N = 4 it is
/// (I₀ + I₂ − I₁ − I₃)²/4. Averaged over all resolved pixels and all such levels.
///
/// A harmonic h of the projected waveform takes the place h mod N of the level's discrete Fourier
/// transform, and N − h mod N. What optics leave of it is not known, so these places are left out
/// as S and C are, each with its degree of freedom. The waveforms for 5, 7 and 9 shifts leave none,
/// those for 6 and 8 shifts 2 and 3.
pub fn sample_noise(sequence: &Sequence, frames: &[FrameView<'_>], trust: &[Trust]) -> Option<f64> {
    let levels: Vec<Fit> = sequence.levels().iter().filter_map(Fit::new).collect();
    let width = frames.first()?.width();
    let rows = map_rows(frames[0].height(), |v| {
        let rows: Vec<Samples<'_>> = frames.iter().map(|frame| frame.row(v)).collect();
        let (mut squares, mut freedom) = (0.0, 0.0);
        for u in (0..width).filter(|u| trust[v * width + u] == Trust::Resolved) {
            for level in &levels {
                squares += level.residual_square(&rows, u);
                freedom += level.freedom as f64;
            }
        }
        (squares, freedom)
    });
    // Summed in the order of the rows, so that the result does not depend on the number of threads.
    let (squares, freedom) = rows
        .into_iter()
        .fold((0.0, 0.0), |sum, row| (sum.0 + row.0, sum.1 + row.1));
    (freedom > 0.0).then(|| libm::sqrt(squares / freedom))
}

/// The mean signal of a resolved pixel by its modulation, both of the finest level: offset in
/// counts, and counts per count, neither below 0. It is the least-squares line, because not all
/// light is modulated: light from elsewhere is not, nor what blur takes. Samples have `full_scale`
/// counts at most.
pub fn signal_by_modulation(
    sequence: &Sequence,
    (frames, full_scale): (&[FrameView<'_>], u16),
    phases: &PhaseMap,
) -> [f64; 2] {
    let (Some(finest), Some(first)) = (sequence.levels().last(), frames.first()) else {
        return [0.0, 1.0];
    };
    let width = first.width();
    let finest = finest.frames.iter().map(|&at| frames[usize::from(at)]);
    let finest: Vec<FrameView<'_>> = finest.collect();
    let rows = map_rows(first.height(), |v| {
        let rows: Vec<Samples<'_>> = finest.iter().map(|frame| frame.row(v)).collect();
        // Whole numbers below 2⁶⁴: x is the modulation, y the sum of all samples.
        let mut sums = [0_u64; 5];
        for u in (0..width).filter(|u| phases.trust[v * width + u] == Trust::Resolved) {
            let x = u64::from(phases.modulation[v * width + u].to_bits());
            let y: u64 = rows.iter().map(|row| u64::from(count(row, u))).sum();
            for (sum, term) in sums.iter_mut().zip([1, x, y, x * x, x * y]) {
                *sum += term;
            }
        }
        sums
    });
    let mut sums = [0_u64; 5];
    for row in rows {
        sums.iter_mut()
            .zip(row)
            .for_each(|(sum, here)| *sum += here);
    }
    let [n, x, y, xx, xy] = sums.map(|sum| sum as f64);
    let slope = ((n * xy - x * y) / (n * xx - x * x)).max(0.0);
    let (offset, slope) = match (y - slope * x) / n {
        offset if offset > 0.0 => (offset, slope),
        _ if xx > 0.0 => (0.0, xy / xx),
        _ => return [0.0, 1.0],
    };
    let samples = finest.len() as f64;
    [
        offset / samples,
        slope / samples * f64::from(u16::MAX) / f64::from(full_scale),
    ]
}

/// A sample in counts.
fn count(row: &Samples<'_>, u: usize) -> u16 {
    match row {
        Samples::Eight(row) => row[u].into(),
        Samples::Sixteen(row) => row[u],
    }
}

/// What a level's samples are fitted by: offset, fundamental, and the places of the waveform's
/// harmonics.
struct Fit {
    /// Places of the frames in the sequence.
    frames: Vec<usize>,
    /// For each place of the transform that is fitted, its share of the sum of squares (2/N, or 1/N
    /// at N/2), and cosine and sine for each frame.
    places: Vec<(f64, Vec<(f64, f64)>)>,
    /// Degrees of freedom that are left.
    freedom: usize,
}

impl Fit {
    /// `None` if nothing is left.
    fn new(level: &Level) -> Option<Self> {
        let shifts = level.shifts();
        // Each place stands for its mirror image, too; the offset is place 0.
        let mut orders = alloc::vec![1];
        for (order, _) in level.waveform.harmonics() {
            let rest = usize::from(order) % shifts;
            let place = rest.min(shifts - rest);
            if place > 0 && !orders.contains(&place) {
                orders.push(place);
            }
        }
        let alone = |place: usize| 2 * place == shifts;
        let fitted = orders.iter().map(|&place| if alone(place) { 1 } else { 2 });
        let freedom = (shifts - 1).checked_sub(fitted.sum::<usize>())?;
        let places = orders.iter().map(|&place| {
            let taps = (0..shifts).map(|k| {
                let angle = TAU * place as f64 * (level.start + k as f64 / shifts as f64);
                (libm::cos(angle), libm::sin(angle))
            });
            let share = if alone(place) { 1.0 } else { 2.0 } / shifts as f64;
            (share, taps.collect())
        });
        (freedom > 0).then(|| Self {
            frames: level.frames.iter().map(|&at| usize::from(at)).collect(),
            places: places.collect(),
            freedom,
        })
    }

    /// Σ of the squared deviations of pixel `u` from its fitted waveform, in counts².
    fn residual_square(&self, rows: &[Samples<'_>], u: usize) -> f64 {
        let count = |frame: usize| f64::from(count(&rows[frame], u));
        let (mut sum, mut squares) = (0.0, 0.0);
        for &frame in &self.frames {
            sum += count(frame);
            squares += count(frame) * count(frame);
        }
        let mut left = squares - sum * sum / self.frames.len() as f64;
        for (share, taps) in &self.places {
            let (mut s, mut c) = (0.0, 0.0);
            for (&frame, (cos, sin)) in self.frames.iter().zip(taps) {
                s += count(frame) * cos;
                c += count(frame) * sin;
            }
            left -= share * (s * s + c * c);
        }
        left.max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pattern::{Shot, Waveform};
    use crate::units::Modulation;

    /// Frames of a scene with a side of so many pixels, from the sample of each pixel under each
    /// shot.
    fn frames(
        side: usize,
        shots: &[Shot],
        mut light: impl FnMut(&Shot, usize) -> f64,
    ) -> Vec<Vec<u8>> {
        let mut sample = |shot, at| libm::rint(light(shot, at)) as u8;
        let frame = |shot| (0..side * side).map(|at| sample(shot, at)).collect();
        shots.iter().map(frame).collect()
    }

    fn views(side: usize, frames: &[Vec<u8>]) -> Vec<FrameView<'_>> {
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
            let fit = Fit::new(&sequence.levels()[0]);
            assert_eq!(fit.map_or(0, |fit| fit.freedom), freedom, "{shifts} shifts");
            let blurred = shots[0].waveform.harmonics();
            let blurred: Vec<_> = blurred.map(|(order, share)| (order, share / 2.0)).collect();
            let blurred = Waveform::of(&blurred);
            let frames = frames(SIDE, &shots, |shot, at| {
                120.0 + 80.0 * blurred.unscaled(at as f64 / 37.3 + shot.shift) + noise()
            });
            let views = views(SIDE, &frames);
            let trust = [Trust::Resolved; SIDE * SIDE];
            let found = sample_noise(&sequence, &views, &trust);
            assert_eq!(found.is_some(), freedom > 0, "{shifts} shifts");
            // 6/√3, and rounding to whole counts.
            let expected = libm::sqrt(12.0 + 1.0 / 12.0);
            if let Some(found) = found {
                assert!((found / expected - 1.0).abs() < 0.03, "{shifts}: {found}");
            }
        }
    }

    /// A part of several shades in light from elsewhere: frames of two levels, and what is found in
    /// them.
    #[test]
    fn the_signal_follows_from_the_modulation_with_light_from_elsewhere() {
        const SIDE: usize = 64;
        let shots: Vec<Shot> = [0.25, 1.0]
            .iter()
            .flat_map(|&r| Shot::level(r, 4))
            .collect();
        let sequence = Sequence::from_frames(&shots).unwrap();
        for (elsewhere, shades) in [(12.0, 40), (0.0, 40), (30.0, 1)] {
            let modulation = |at: usize| 50.0 + (at % shades) as f64;
            // Blur takes a tenth of the modulation.
            let frames = frames(SIDE, &shots, |shot, at| {
                let turns = shot.ratio * at as f64 / 37.3 + shot.shift;
                elsewhere + modulation(at) / 0.9 * (1.0 + 0.9 * libm::sin(TAU * turns))
            });
            let views = views(SIDE, &frames);
            let mut phases = PhaseMap::new(SIDE, SIDE);
            phases.trust.fill(Trust::Resolved);
            for (at, here) in phases.modulation.iter_mut().enumerate() {
                *here = Modulation::from_bits((modulation(at) * 257.0) as u16);
            }
            let [offset, slope] = signal_by_modulation(&sequence, (&views, 255), &phases);
            let signal = |b: f64| offset + slope * b;
            for b in [50.0, 50.0 + (shades - 1) as f64] {
                let found = signal(b) - (elsewhere + b / 0.9);
                assert!(
                    found.abs() < 0.1,
                    "{elsewhere}, {shades} shades, {b}: {found}"
                );
            }
            // Beyond the shades only where there are several.
            let dark = signal(0.0) - elsewhere;
            assert_eq!(dark.abs() < 0.3, shades > 1, "{dark}");
        }
        let nothing = PhaseMap::new(SIDE, SIDE);
        assert_eq!(
            signal_by_modulation(&sequence, (&[], 255), &nothing),
            [0.0, 1.0]
        );
    }
}
