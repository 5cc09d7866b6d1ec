//! Whole frames: frames → phase map → height map, the wrapped phase of a single level, and a head's
//! reference map and rays of all pixels.

use super::{Done, Progress, for_each, for_each_row, for_each_row_of_two};
use crate::frame::{FrameView, SampleNoise};
use crate::geometry::{Pinhole, Triangulator};
use crate::pattern::{Level, MAX_SHIFTS, PhaseRange, Sequence, Shot};
use crate::phase::{Arrived, DecodeError, Decoder, LeastModulation, PhaseRow, Trust};
use crate::units::{AbsolutePhase, Height, Modulation};
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// Absolute phase, modulation and trust of every pixel, row-major.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PhaseMap {
    /// Pixels per row.
    pub width: usize,
    /// Φ, [`AbsolutePhase::UNKNOWN`] where the phase is rejected.
    pub phase: Vec<AbsolutePhase>,
    /// The finest level's modulation, 0 where the phase is rejected.
    pub modulation: Vec<Modulation>,
    /// Resolved, or the first reason why not.
    pub trust: Vec<Trust>,
}

impl PhaseMap {
    /// A map without any phase: every pixel is dark.
    pub fn new(width: usize, height: usize) -> Self {
        let pixels = width * height;
        Self {
            width,
            phase: vec![AbsolutePhase::UNKNOWN; pixels],
            modulation: vec![Modulation::default(); pixels],
            trust: vec![Trust::default(); pixels],
        }
    }

    /// For each pixel, its phase less that of the same pixel by another sequence, 1/65536 turn; 0
    /// where one of both is not resolved, or they differ by more than half a turn: a wrong order.
    pub fn offsets_from(&self, other: &Self) -> Vec<i16> {
        let offset = |at: usize| {
            let offset = (self.phase[at] - other.phase[at]).to_bits();
            let both = [self, other].map(|map| map.trust[at]) == [Trust::Resolved; 2];
            i16::try_from(offset).ok().filter(|_| both).unwrap_or(0)
        };
        (0..self.phase.len()).map(offset).collect()
    }

    /// Makes this the mean of two maps by the same sequence. A pixel is resolved if it is in both,
    /// with the same fringe order.
    pub fn average(&mut self, other: &Self) {
        const QUARTER_TURN: i32 = 1 << 14;
        for at in 0..self.phase.len() {
            let (a, b) = (self.phase[at], other.phase[at]);
            let apart = (b - a).to_bits();
            let trust = match (self.trust[at], other.trust[at]) {
                (Trust::Resolved, Trust::Resolved) if apart.abs() > QUARTER_TURN => Trust::Residual,
                (Trust::Resolved, other) => other,
                (own, _) => own,
            };
            let counts = [&*self, other].map(|map| u32::from(map.modulation[at].to_bits()));
            self.trust[at] = trust;
            (self.phase[at], self.modulation[at]) = match trust == Trust::Resolved {
                true => (
                    AbsolutePhase::from_bits(a.to_bits() + apart / 2),
                    Modulation::from_bits(counts.iter().sum::<u32>().div_ceil(2) as u16),
                ),
                false => (AbsolutePhase::UNKNOWN, Modulation::default()),
            };
        }
    }

    pub(crate) fn rows(&mut self) -> Vec<PhaseRow<'_>> {
        let width = self.width.max(1);
        self.phase
            .chunks_mut(width)
            .zip(self.modulation.chunks_mut(width))
            .zip(self.trust.chunks_mut(width))
            .map(|((phase, modulation), trust)| PhaseRow {
                phase,
                modulation,
                trust,
            })
            .collect()
    }

    /// Number of pixels with this trust.
    pub fn count(&self, trust: Trust) -> usize {
        self.trust.iter().filter(|&&here| here == trust).count()
    }
}

/// Height and its predicted error of every pixel, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightMap {
    /// Pixels per row.
    pub width: usize,
    /// z, [`Height::UNKNOWN`] where not resolved.
    pub height: Vec<Height>,
    /// σ_z in mm, NaN where not resolved or the frames' noise is not known.
    pub sigma: Vec<f32>,
}

/// The columns of each row that are needed; the others are not computed.
pub type Window<'a> = &'a [Range<usize>];

/// Decodes the frames of a sequence to absolute phase. `map` is the known map (row-major) for
/// sequences that are unwrapped about one. Pixels outside `window` are not decoded and stay dark.
///
/// # Errors
/// If the frames do not fit the decoder. Nothing else can fail.
pub fn decode(
    decoder: &Decoder,
    frames: &[FrameView<'_>],
    map: Option<&[AbsolutePhase]>,
    window: Option<Window<'_>>,
) -> Result<PhaseMap, DecodeError> {
    decoder.check(frames)?;
    let (width, height) = (frames[0].width(), frames[0].height());
    let mut arrived = decoder.arrived(width, height);
    let last = arrive_rest(decoder, frames, &mut arrived)?;
    let mut phases = PhaseMap::new(width, height);
    let map = map.unwrap_or(&[]);
    for_each(phases.rows(), |v, row| {
        let known = map.get(v * width..(v + 1) * width).unwrap_or(&[]);
        let columns = window.map_or(0..width, |window| window[v].clone());
        decoder.row(&arrived, &last, v, known, columns, row);
    });
    Ok(phases)
}

/// Refuses the pixels of a decoded map beside which light changes steeply, if the decoder does so
/// ([`Decoder::refusing_light_edges`]).
pub fn refuse_light_edges(decoder: &Decoder, phases: &mut PhaseMap) {
    let columns = 0..phases.width;
    for_each(phases.rows(), |_, row| {
        decoder.refuse_light_edges(row, columns.clone());
    });
}

/// Decodes the frames of the next level on arrival, while those of finer levels are being exposed.
/// Levels arrive from coarse to fine, frames are in the order of their shifts.
///
/// # Errors
/// If the frames do not fit the level, or `arrived` was made for frames of another size.
pub fn arrive(
    decoder: &Decoder,
    frames: &[FrameView<'_>],
    arrived: &mut Arrived,
) -> Result<(), DecodeError> {
    let level = arrived.levels();
    decoder.check_arrival(frames, arrived)?;
    let (layout, words, bytes) = arrived.maps_mut();
    let (words, bytes) = ((words, layout.words()), (bytes, layout.bytes()));
    for_each_row_of_two(words, bytes, |v, words, bytes| {
        decoder.arrive_row(level, frames, v, layout.row_mut(words, bytes));
    });
    arrived.add_level();
    Ok(())
}

/// Decodes the levels that have not arrived yet, all but the finest, of all frames of a sequence,
/// which [`Decoder::check`] has passed; returns the frames of the finest level.
///
/// # Errors
/// If `arrived` was made for frames of another size.
pub fn arrive_rest<'a>(
    decoder: &Decoder,
    frames: &[FrameView<'a>],
    arrived: &mut Arrived,
) -> Result<heapless::Vec<FrameView<'a>, MAX_SHIFTS>, DecodeError> {
    let mut level = heapless::Vec::new();
    for (at, places) in decoder.levels().enumerate().skip(arrived.levels()) {
        if at > arrived.levels() {
            arrive(decoder, &level, arrived)?;
        }
        level.clear();
        level.extend(places.iter().map(|&place| frames[place]));
    }
    Ok(level)
}

/// Triangulates every resolved pixel, and marks those without a height in the working range as
/// [`Trust::OutOfRange`]. `noise` is that of one sample, for σ_z; `progress` gets the share of the
/// rows that are done.
pub fn triangulate(
    triangulator: &Triangulator,
    decoder: &Decoder,
    noise: Option<SampleNoise>,
    phases: &mut PhaseMap,
    progress: Progress<'_>,
) -> HeightMap {
    let sigma = |modulation| noise.map(|noise| decoder.phase_noise(modulation, noise));
    triangulate_with(triangulator, phases, sigma, progress)
}

/// As [`triangulate`], with σ of the phase in turns as any function of the modulation; `None` where
/// it is not known.
pub fn triangulate_with(
    triangulator: &Triangulator,
    phases: &mut PhaseMap,
    sigma: impl Fn(Modulation) -> Option<f64> + Sync + Send,
    progress: Progress<'_>,
) -> HeightMap {
    let width = phases.width;
    let done = Done::new(progress, phases.phase.len() / width.max(1));
    let mut map = HeightMap {
        width,
        height: vec![Height::UNKNOWN; phases.phase.len()],
        sigma: vec![f32::NAN; phases.phase.len()],
    };
    let heights = map.height.chunks_mut(width.max(1));
    let rows = heights
        .zip(map.sigma.chunks_mut(width.max(1)))
        .zip(phases.rows())
        .collect();
    for_each(rows, |v, ((heights, sigmas), phases)| {
        for u in 0..heights.len() {
            if phases.trust[u] != Trust::Resolved {
                continue;
            }
            match triangulator.solve(u as f64, v as f64, phases.phase[u].turns()) {
                None => phases.trust[u] = Trust::OutOfRange,
                Some(solution) => {
                    heights[u] = Height::from_mm(solution.point.z);
                    if let Some(turns) = sigma(phases.modulation[u]) {
                        sigmas[u] = (turns / libm::fabs(solution.slope)) as f32;
                    }
                }
            }
        }
        done.row();
    });
    map
}

impl Triangulator {
    /// The whole reference phase map, row-major, for unwrapping dense sequences about it.
    pub fn reference_map(&self) -> Vec<AbsolutePhase> {
        let (width, height) = (self.camera().width(), self.camera().height());
        let mut map = vec![AbsolutePhase::UNKNOWN; width * height];
        for_each_row(&mut map, width, |v, row| self.reference_row(v, row));
        map
    }
}

impl Pinhole {
    /// The same device, which has worked out the rays of its pixels: [`Self::ray`] then takes the
    /// time of a look-up, with the same bits, for 16 bytes a pixel that clones share.
    #[must_use]
    pub fn with_rays(self) -> Self {
        if self.knows_rays() {
            return self;
        }
        let (lens, width) = (*self.lens(), self.width());
        let mut directions = vec![(f64::NAN, f64::NAN); width * self.height()];
        for_each_row(&mut directions, width, |v, row| {
            for (u, direction) in row.iter_mut().enumerate() {
                if let Some(found) = lens.undistorted(u as f64, v as f64) {
                    *direction = found;
                }
            }
        });
        self.knowing(directions)
    }
}

/// Decodes one level of a sequence to its wrapped phase: `phase` is φ, 0 ≤ φ < 1 turn of that
/// level, modulation and trust are the level's. `frames` are those of the whole sequence.
///
/// A level of ratio 1 over a phase function of one turn is absolute by itself, so the production
/// kernels decode it, with their accuracy ([`Decoder`]). Modulations are trusted from `least` on.
///
/// # Errors
/// If the frames do not fit the level, or `bit_depth` is not 8 to 16.
pub fn wrapped(
    level: &Level,
    frames: &[FrameView<'_>],
    bit_depth: u8,
    least: LeastModulation,
) -> Result<PhaseMap, DecodeError> {
    let shifts = level.shifts();
    let shots = (0..shifts).map(|k| Shot::sine(1.0, level.start + k as f64 / shifts as f64));
    let sequence = Sequence::from_frames(&shots.collect::<Vec<_>>())?;
    let one_turn = PhaseRange { min: 0.0, max: 1.0 };
    let decoder = Decoder::new(&sequence, one_turn, bit_depth)?.with_least_modulation(least);
    let of_level: Vec<_> = level
        .frames
        .iter()
        .filter_map(|&at| frames.get(usize::from(at)).copied())
        .collect();
    decode(&decoder, &of_level, None, None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Samples;
    use crate::phase::Trust;
    use std::vec::Vec;

    /// The bound of the arctangent for 8-bit samples and their rounding (B = 100 counts): 2.4e-5 +
    /// √2 · 0.5 / (2π · 100) turn.
    const TOLERANCE: f64 = 1.2e-3;

    #[test]
    fn a_level_alone_gives_its_fraction_of_a_turn_whatever_its_ratio_and_first_shift() {
        for (shifts, start) in [(3, 0.0), (4, 0.25), (5, -1.0 / 3.0), (8, 0.1)] {
            let shot = |k: usize| Shot::sine(0.37, start + k as f64 / shifts as f64);
            let shots: Vec<_> = (0..shifts).map(shot).collect();
            let turns = |u: usize| u as f64 / 64.0 * 3.0;
            let sample = |shot: &Shot, u: usize| {
                let sine = libm::sin(core::f64::consts::TAU * (turns(u) + shot.shift));
                libm::rint(120.0 + 100.0 * sine) as u8
            };
            let rows: Vec<Vec<u8>> = shots
                .iter()
                .map(|shot| (0..64).map(|u| sample(shot, u)).collect())
                .collect();
            let view = |row| FrameView::new(Samples::Eight(row), 64, 1, 64).unwrap();
            let frames: Vec<_> = rows.iter().map(|row| view(row)).collect();
            let sequence = Sequence::from_frames(&shots).unwrap();
            let map = wrapped(
                &sequence.levels()[0],
                &frames,
                8,
                LeastModulation::default(),
            )
            .unwrap();
            for u in 0..64 {
                assert_eq!(map.trust[u], Trust::Resolved);
                let phase = map.phase[u].turns();
                assert!((0.0..1.0).contains(&phase), "{phase}");
                let error = phase - turns(u);
                let error = error - libm::rint(error);
                assert!(error.abs() < TOLERANCE, "{shifts} shifts, {u}: {error}");
            }
        }
    }
}
