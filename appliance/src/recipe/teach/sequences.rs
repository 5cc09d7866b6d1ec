//! The sequences that a part can be measured with, and what is predicted of each: noise, where it
//! is safe, wrong orders.

use super::captures::Offsets;
use super::golden::GoldenPart;
use super::sides::SIDES;
use crate::recipe::file::archive::Arrays;
use crate::recipe::{SequenceFile, SequenceKind, UnseenFile};
use crate::system::headway::Headway;
use algo::inspect::ripple;
use algo::pattern::{Sequence, Shot, Slips, Waveform, Waveforms};
use algo::phase::Trust;
use algo::units::PhaseDelta;

/// A sequence that a part may be measured with: what it can unwrap, and what each frame shows.
pub(crate) type Candidate = (SequenceKind, Vec<Shot>);

/// All candidates, fewest frames first; the last is the full one.
pub(crate) fn candidates(waveforms: Waveforms, full: &[Shot]) -> Vec<Candidate> {
    let mut full = full.to_vec();
    // The finest level last: the coarser ones are decoded while it is being exposed.
    full.sort_by(|a, b| a.ratio.total_cmp(&b.ratio));
    // Levels of ratios 0.8 and 1 repeat together only after 5 turns: unambiguous within ± 2.5 turns
    // of golden, less a margin for noise ([`SequenceKind::reach`]).
    let level = |ratio, shifts| Shot::level_as(ratio, shifts, waveforms);
    vec![
        (SequenceKind::SingleLevel, level(1.0, 3).collect()),
        (SequenceKind::SingleLevel, level(1.0, 4).collect()),
        (
            SequenceKind::TwoLevels,
            level(0.8, 3).chain(level(1.0, 3)).collect(),
        ),
        (SequenceKind::Full, full),
    ]
}

impl GoldenPart<'_> {
    /// The candidates, each with its predicted noise, the share of the surface where it is safe
    /// (where no placement within the tolerance makes its phase ambiguous), and how often its
    /// orders are wrong unseen.
    pub(crate) fn sequences(&self, arrays: &Arrays, headway: Headway<'_>) -> Vec<SequenceFile> {
        let candidates = candidates(self.calibration.waveforms(), self.full);
        let all = 2.0 * candidates.len() as f64;
        let rated = |(at, (kind, frames))| {
            headway.done(at as f64 / all);
            self.rated(kind, frames, arrays)
        };
        let mut sequences: Vec<_> = (0..).zip(candidates).map(rated).collect();
        for ((at, sequence), offsets) in (1..).zip(&mut sequences).zip(&self.offsets) {
            headway.done(0.5 + at as f64 / all);
            sequence.ripple_mm = Some(self.ripple(offsets, arrays));
        }
        // Each other sequence's periodic error is measured against the full sequence, whose own is
        // not known. It is less than any of these, as the full sequence is the mean of three
        // levels: the least of them stands for it.
        let known = sequences.iter().filter_map(|sequence| sequence.ripple_mm);
        let least = known.reduce(f64::min);
        if let Some(full) = sequences.last_mut() {
            full.ripple_mm = least;
        }
        sequences
    }

    /// RMS of the periodic error of mean heights by the sequence with these offsets, mm.
    fn ripple(&self, offsets: &Offsets, arrays: &Arrays) -> f64 {
        let (width, pixels) = (self.phases.width, arrays.valid.len());
        let heights = |at: usize| {
            let turns = offsets
                .each_ref()
                .map(|of| PhaseDelta::from_bits(of[at].into()).turns());
            let valid = arrays.valid[at] != 0;
            valid.then(|| turns.map(|turns| turns * f64::from(arrays.height_slope[at])))
        };
        ripple((width, pixels), SIDES[SIDES.len() - 1], heights)
    }

    /// σ_z² in mm² of a pixel of golden, measured once with these frames.
    pub(crate) fn variance(
        &self,
        kind: SequenceKind,
        frames: &[Shot],
        arrays: &Arrays,
    ) -> impl Fn(usize) -> f64 {
        // Of a geometric sequence only the finest level contributes to the accuracy.
        let absolute = !self.decoder.unwrapping().needs_map() && kind == SequenceKind::Full;
        let carries = |ratio: f64| !absolute || ratio >= 0.999;
        // The modulation as taught is that of the finest level of the full sequence; a level with
        // another waveform has another share of it.
        let taught = finest_waveform(self.full).fundamental();
        let squares = frames
            .iter()
            .filter(|shot| carries(shot.ratio))
            .map(|shot| (shot.ratio * shot.waveform.fundamental() / taught).powi(2));
        let information: f64 = squares.sum();
        let noise = self.noise;
        move |at| {
            let counts = f64::from(arrays.modulation[at]);
            let turns = noise.at(counts) / std::f64::consts::TAU
                * (2.0 / (information * counts * counts)).sqrt();
            (turns * f64::from(arrays.height_slope[at])).powi(2)
        }
    }

    /// A sequence with its predicted noise (RMS over the compared pixels) and safe share.
    fn rated(&self, kind: SequenceKind, frames: Vec<Shot>, arrays: &Arrays) -> SequenceFile {
        let safe = |at: &usize| {
            kind.reach()
                .is_none_or(|reach| arrays.phase_reach[*at] < reach)
        };
        let valid = || (0..arrays.valid.len()).filter(|&at| arrays.valid[at] == 1);
        let variance = self.variance(kind, &frames, arrays);
        let unseen_orders = self.unseen_orders((kind, &frames), arrays, || valid().filter(safe));
        let count = valid().count().max(1) as f64;
        let sigma_mm = (valid().map(variance).sum::<f64>() / count).sqrt();
        SequenceFile {
            kind,
            frames,
            sigma_mm,
            safe_share: valid().filter(safe).count() as f64 / count,
            ripple_mm: None,
            unseen_orders,
        }
    }

    /// The share of the frame that one measurement with these frames is expected to resolve of a
    /// part that lies as taught. Golden, the mean of several, also has pixels that the noise of one
    /// measurement takes below the least modulation; and a sequence of limited reach leaves out
    /// what a placement could move further than that.
    pub(crate) fn expected_coverage(
        &self,
        sequence: &SequenceFile,
        phase_reach: &[f32],
    ) -> Option<f64> {
        let reach = sequence.kind.reach();
        let sequence = Sequence::from_frames(&sequence.frames).ok()?;
        let (least, full_scale) = (self.decoder.least_modulation(), self.decoder.full_scale());
        let taught = finest_waveform(self.full).fundamental();
        let chance = sequence.chance_of_trust(least, self.calibration.noise_counts, full_scale);
        let safe = |at: usize| reach.is_none_or(|reach| phase_reach[at] < reach);
        let resolved = |at: &usize| self.phases.trust[*at] == Trust::Resolved && safe(*at);
        let modulation = |at: usize| self.phases.modulation[at].counts(full_scale);
        let pixels = (0..self.phases.trust.len()).filter(resolved);
        let chances = pixels.map(|at| chance(modulation(at) / taught));
        Some(chances.sum::<f64>() / self.phases.trust.len().max(1) as f64)
    }

    /// How often these frames give one of some pixels a wrong order unseen, if they can be
    /// unwrapped; of a sequence that counts as safe for every placement, at the map.
    fn unseen_orders<P: Iterator<Item = usize>>(
        &self,
        (kind, frames): (SequenceKind, &[Shot]),
        arrays: &Arrays,
        pixels: impl Fn() -> P,
    ) -> Option<UnseenFile> {
        let sequence = Sequence::from_frames(frames).ok()?;
        let slips = Slips::of(&sequence, self.triangulator.function().range()).ok()?;
        let taught = finest_waveform(self.full).fundamental();
        let noise = self.calibration.noise_counts * taught;
        let reach = |at: usize| {
            kind.reach()
                .map_or(0.0, |_| f64::from(arrays.phase_reach[at]))
        };
        let rates =
            pixels().map(|at| slips.rate(noise / f64::from(arrays.modulation[at]), reach(at)));
        let farthest = pixels().map(reach).fold(0.0, f64::max);
        let least = self.decoder.least_modulation();
        Some(UnseenFile {
            part: rates.sum::<f64>() / pixels().count().max(1) as f64,
            darkest: slips.rate(noise / least.counts(self.decoder.full_scale()), farthest),
        })
    }
}

/// What the finest level shows.
fn finest_waveform(shots: &[Shot]) -> Waveform {
    let finest = shots.iter().max_by(|a, b| a.ratio.total_cmp(&b.ratio));
    finest.map(|shot| shot.waveform).unwrap_or_default()
}
