//! Golden's captures: the part, measured several times without a motion between, by every sequence
//! that production may use.
//!
//! Shifts of different numbers and levels of different ratios see the harmonics of an imperfect
//! response differently, so each sequence has a periodic error of its own. Production compares
//! phases with golden's by the same sequence, in which the error of a part that lies as taught is
//! the same: so the difference of each sequence from the full one is measured here.
//!
//! The captures are averaged as two means, from which follows what of that difference is noise.

use super::TeachError;
use crate::head::calibrated::CalibratedHead;
use crate::head::rasters::Illumination;
use crate::head::scan::Scan;
use crate::head::scan::mean_frames;
use crate::head::seam;
use crate::recipe::Refusal;
use crate::recipe::plan::light;
use crate::system::headway::Headway;
use algo::frame::{FrameError, SampleNoise};
use algo::geometry::Triangulator;
use algo::pattern::{PhaseFunction, Sequence, Shot};
use algo::phase::{Decoder, Trust};
use algo::pipeline;
use algo::pipeline::{HeightMap, PhaseMap};
use algo::units::{AbsolutePhase, Height};
use hal::frame::Frame;
use hal::replay::Recording;

/// Means of captures.
const MEANS: usize = 2;
/// All captures.
pub const CAPTURES: usize = MEANS * hal::frame::FrameSum::CAPTURES;

/// Edges of light on a part's faces that make it one that is printed on, as a share of the picture.
const PRINTED: f64 = 3e-4;
/// How far what lies on both sides of a pixel of a face may be apart there, mm, and by how much its slopes may
/// differ, mm per pixel.
const FLAT_MM: f64 = 0.15;
const FLAT_SLOPE_MM: f64 = 0.05;

/// For each mean, the phase of each pixel by a sequence less its phase by the full sequence,
/// 1/65536 turn; 0 where one of both phases is not resolved.
pub type Offsets = [Vec<i16>; MEANS];

/// The part by all captures.
#[derive(Debug)]
pub struct Captured {
    /// Phases by the full sequence.
    pub phases: PhaseMap,
    /// Heights by the full sequence, with σ as of one capture.
    pub heights: HeightMap,
    /// The decoder of one capture of the full sequence.
    pub decoder: Decoder,
    /// The geometry with its phase function.
    pub triangulator: Triangulator,
    /// Offsets of all sequences but the full one.
    pub offsets: Vec<Offsets>,
    /// Golden's signal, the mean of all captures.
    pub signal: Vec<i16>,
    /// The noise of a sample by the modulation of its pixel, by the full sequence.
    pub noise: SampleNoise,
    /// Median of the mean samples of its pixels by the full sequence, counts of the camera.
    pub offset_counts: Option<f64>,
}

impl Captured {
    /// Measures the part in this light with sequences of a phase function; the last is the full
    /// one. That is unwrapped about `expected`, the others about its result. It ends early where
    /// `headway` says so.
    ///
    /// # Errors
    /// As [`crate::recipe::teach::teach`].
    pub fn take(
        CalibratedHead {
            head,
            calibration,
            timeout,
            least,
        }: &mut CalibratedHead<'_>,
        illumination: &Illumination,
        function: &PhaseFunction,
        sequences: &[&[Shot]],
        expected: &[AbsolutePhase],
        headway: Headway<'_>,
    ) -> Result<Self, TeachError> {
        let [short @ .., full] = sequences else {
            return Err(TeachError::Rig("there is no sequence".into()));
        };
        let shots = distinct(sequences);
        let full_scale = f64::from((1_u32 << calibration.bit_depth) - 1);
        illumination.load(head, function, &shots, calibration)?;
        let mut all: Vec<(PhaseMap, Vec<Vec<i16>>)> = Vec::new();
        let (mut noise, mut offset_counts) = (calibration.noise, None);
        let mut signals: Vec<Vec<i16>> = Vec::new();
        for mean in 0..MEANS {
            let taking = headway.part(0.45 * mean as f64, 0.45 * (mean + 1) as f64);
            let taken = |share: f64| taking.tell(0.8 * share);
            let means = mean_frames(head, shots.len(), *timeout, &taken)?;
            let means = means.ok_or(TeachError::Ended)?;
            let decode = |shown: &[Shot], map: &[AbsolutePhase]| {
                let scan = scan(function, (&shots, shown), &means)?.trusting(*least);
                let phases = scan.phases(scan.needs_map().then_some(map))?;
                Ok::<_, Refusal>((scan, phases))
            };
            let (seen, phases) = decode(full, expected)?;
            taking.done(0.85);
            // Means of frames have more bits than the camera's samples.
            let most = seen.decoder.full_scale();
            let unit = full_scale / f64::from(most);
            let counts = light::offset_counts(&seen.frames, &phases);
            offset_counts = counts.map(|counts| counts * unit);
            noise = seen.noise(calibration, &phases);
            signals.push(pipeline::signal(full, &seen.frames, most));
            let offsets = (1..).zip(short).map(|(known, shown)| {
                let (_, by) = decode(shown, &phases.phase)?;
                taking.done(0.85 + 0.15 * known as f64 / short.len() as f64);
                Ok(by.offsets_from(&phases))
            });
            let offsets: Result<_, Refusal> = offsets.collect();
            all.push((phases, offsets?));
        }
        let sequence = Sequence::from_frames(full).map_err(TeachError::rig)?;
        let (_, _, bit_depth) = calibration.frames();
        let decoder = Decoder::new(&sequence, function.range(), bit_depth);
        let decoder = decoder
            .map_err(TeachError::rig)?
            .with_least_modulation(*least);
        let triangulator = calibration.triangulator(function.clone(), None);
        let triangulator = triangulator.map_err(TeachError::rig)?;
        let Ok([(mut phases, first), (other, second)]) = <[_; MEANS]>::try_from(all) else {
            return Err(TeachError::Ended);
        };
        phases.average(&other);
        let heights = pipeline::triangulate(
            &triangulator,
            &decoder,
            Some(noise),
            &mut phases,
            &|share| headway.part(0.9, 1.0).done(share),
        );
        Ok(Self {
            phases,
            heights,
            decoder,
            triangulator,
            offsets: first
                .into_iter()
                .zip(second)
                .map(<[_; MEANS]>::from)
                .collect(),
            signal: signals
                .into_iter()
                .reduce(|a, b| pipeline::mean_signal(&a, &b))
                .unwrap_or_default(),
            noise,
            offset_counts,
        })
    }

    /// Refuses pixels beside which light changes steeply, if the part `shines` or there are such on its
    /// faces, and returns whether it does so. Along creases and the part's end light changes on any part.
    pub fn refuse_light_edges(&mut self, shines: bool) -> bool {
        let decoder = self.decoder.clone().refusing_light_edges(self.noise);
        let mut phases = self.phases.clone();
        pipeline::refuse_light_edges(&decoder, &mut phases);
        let edges = (0..phases.trust.len()).filter(|&at| phases.trust[at] == Trust::LightEdge);
        let printed = edges.clone().filter(|&at| self.is_flat(at)).count();
        if !shines && (printed as f64) < PRINTED * phases.trust.len() as f64 {
            return false;
        }
        for at in edges {
            (self.heights.height[at], self.heights.sigma[at]) = (Height::UNKNOWN, f32::NAN);
        }
        self.phases = phases;
        true
    }

    /// Whether a face goes on through a pixel: what lies in its row on either side of it has one slope and meets.
    fn is_flat(&self, at: usize) -> bool {
        let mm = |off: isize| {
            let height = self.heights.height.get(at.checked_add_signed(off)?)?;
            height.is_known().then(|| height.mm())
        };
        let row = self.heights.width as isize;
        let [Some(before), Some(ahead), Some(behind), Some(beyond)] = [-5, -2, 2, 5].map(mm) else {
            return false;
        };
        // Pixels of the part's end are lit in part.
        if [-2 * row, 2 * row].map(mm).contains(&None) {
            return false;
        }
        let slopes = [ahead - before, beyond - behind].map(|rise| rise / 3.0);
        let apart = behind - ahead - 2.0 * (slopes[0] + slopes[1]);
        (slopes[1] - slopes[0]).abs() < FLAT_SLOPE_MM && apart.abs() < FLAT_MM
    }
}

/// The frames of the shots that a sequence has `shown`, of those that were taken of all `shots`.
fn scan<'a>(
    function: &PhaseFunction,
    (shots, shown): (&[Shot], &[Shot]),
    means: &'a [Frame],
) -> Result<Scan<'a>, Refusal> {
    let frame = |shot| shots.iter().position(|other| other == shot);
    let frames = shown.iter().filter_map(frame).map(|at| &means[at]);
    Ok(Scan::new(function.range(), shown, frames)?)
}

/// The shots of all sequences, each shot once.
fn distinct(sequences: &[&[Shot]]) -> Vec<Shot> {
    let mut shots: Vec<Shot> = Vec::new();
    for shot in sequences.iter().copied().flatten() {
        if !shots.contains(shot) {
            shots.push(*shot);
        }
    }
    shots
}

/// The signal of a pattern of a recording ([`pipeline::signal`]).
///
/// # Errors
/// If a frame's samples do not make up its size.
pub fn recorded_signal(recording: &Recording, pattern: usize) -> Result<Vec<i16>, FrameError> {
    let frames = recording.frames.iter();
    let frames = frames.filter(|frame| frame.pattern == pattern);
    let shots: Vec<Shot> = frames.clone().map(seam::shot).collect();
    let views: Result<Vec<_>, _> = frames.map(|frame| seam::view(&frame.frame)).collect();
    let full_scale = u16::try_from((1_u32 << recording.bit_depth) - 1).unwrap_or(u16::MAX);
    Ok(pipeline::signal(&shots, &views?, full_scale))
}
