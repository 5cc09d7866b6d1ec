//! The sequences that a part can be measured with, what is predicted of each (noise, where it is
//! safe, wrong orders), and the cheapest that is good enough for a part's gauges.
//!
//! A longer sequence in the same cycle is chosen by `step_up` in `plan/judge.rs`.

use super::captures::Offsets;
use super::golden::GoldenPart;
use super::sides::SIDES;
use crate::recipe::file::archive::Arrays;
use crate::recipe::{GaugeFile, SequenceFile, SequenceKind, UnseenFile};
use crate::system::headway::Headway;
use algo::inspect::{Basis, ripple};
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
        let chance = sequence.chance_of_trust(least, (self.calibration.noise_counts, full_scale));
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

/// A sequence is good enough if its noise, after a gauge's smoothing, stays this many times inside
/// the gauge's limit: a frame has some thousand independent places, whose extremes reach 4 σ.
pub(crate) const SIGMAS: f64 = 6.0;
/// Share of the golden surface that must be safe for a sequence that is not full.
const SAFE_SHARE: f64 = 0.98;

/// Rates of wrong orders below this count as zero.
const LEAST_RATE: f64 = 1e-12;

/// The chosen sequence.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The index of the sequence.
    pub production: usize,
    /// One line per sequence, cheapest first: its noise, its safe share and how often its fringe
    /// orders are wrong unseen, and why it was chosen or not.
    pub reasons: Vec<String>,
}

/// The largest σ_z, RMS over the surface, in mm, that is allowed by the limits of gauges with a
/// smoothing square (deviations, flatness, peak-to-valley). Squares of deviations have `widest`
/// pixels where they must. Gauges that average over regions are far less noisy and do not count.
pub fn allowed_sigma(gauges: &[GaugeFile], widest: usize) -> f64 {
    let allowed = gauges.iter().filter_map(|gauge| {
        let facts = gauge.measures.facts();
        let side = match facts.basis {
            Basis::Squares(side) => widest.max(side),
            other => other.side()?,
        };
        let limits = match facts.noise_limit {
            None => [gauge.low, gauge.high],
            limit => [limit, None],
        };
        let limit = limits
            .into_iter()
            .flatten()
            .map(f64::abs)
            .filter(|limit| *limit > 0.0)
            .reduce(f64::min)?;
        // Golden and measurement are both noisy, hence √2; averaging side² pixels divides by side.
        Some(limit * side as f64 / SIGMAS / std::f64::consts::SQRT_2)
    });
    allowed.fold(f64::INFINITY, f64::min)
}

/// Chooses the cheapest sequence that is good enough; the full one, which is the last, if none is.
/// `widest` is as for [`allowed_sigma`].
pub fn choose(sequences: &[SequenceFile], gauges: &[GaugeFile], widest: usize) -> Choice {
    let allowed = allowed_sigma(gauges, widest);
    // Only the full sequence resolves material where golden has none, as beside a gap.
    let looks_for_more = gauges.iter().any(|gauge| {
        let basis = gauge.measures.facts().basis;
        basis == Basis::Section || basis == Basis::Pixels && gauge.high.is_some()
    });
    let good = |sequence: &SequenceFile| {
        let full = sequence.kind == SequenceKind::Full;
        let safe = full || (!looks_for_more && sequence.safe_share >= SAFE_SHARE);
        safe && sequence.sigma_mm <= allowed
    };
    let taken = sequences
        .iter()
        .position(good)
        .unwrap_or(sequences.len().saturating_sub(1));
    let reason = |(at, sequence): (usize, &SequenceFile)| {
        let word = match at.cmp(&taken) {
            std::cmp::Ordering::Less if sequence.sigma_mm > allowed => "too noisy",
            std::cmp::Ordering::Less if looks_for_more => "blind where golden has nothing",
            std::cmp::Ordering::Less => "not safe enough",
            std::cmp::Ordering::Equal => "taken",
            std::cmp::Ordering::Greater => "better, not needed",
        };
        let unseen = sequence.unseen_orders.map(|UnseenFile { part, darkest }| {
            let [part, darkest] = [part, darkest].map(rate);
            format!(", wrong fringe orders unseen at {part} of its pixels ({darkest} where it is darkest)")
        });
        format!(
            "{} frames: predicted σ {:.1} µm of {:.1} µm allowed, safe on {:.1} % of the part{}: {word}",
            sequence.frames.len(),
            sequence.sigma_mm * 1000.0,
            allowed * 1000.0,
            sequence.safe_share * 100.0,
            unseen.unwrap_or_default(),
        )
    };
    Choice {
        production: taken,
        reasons: sequences.iter().enumerate().map(reason).collect(),
    }
}

/// A rate in words.
fn rate(of: f64) -> String {
    match of < LEAST_RATE {
        true => format!("less than {LEAST_RATE:.0e}"),
        false => format!("{of:.0e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use algo::inspect::kinds::{Coverage, Deviation};
    use algo::pattern::Shot;

    fn sequences(sigmas: [f64; 3], safe: [f64; 3]) -> Vec<SequenceFile> {
        let kinds = [
            SequenceKind::SingleLevel,
            SequenceKind::TwoLevels,
            SequenceKind::Full,
        ];
        (0..3)
            .map(|i| SequenceFile {
                kind: kinds[i],
                frames: Shot::level(1.0, [4, 6, 12][i]).collect(),
                sigma_mm: sigmas[i],
                safe_share: safe[i],
                ripple_mm: None,
                unseen_orders: Some(UnseenFile {
                    part: 2e-9,
                    darkest: 1.7e-3,
                }),
            })
            .collect()
    }

    fn gauge(limit: f64) -> Vec<GaugeFile> {
        vec![GaugeFile {
            low: Some(-limit),
            high: Some(2.0 * limit),
            ..GaugeFile::new(1, "deviation", Deviation { smoothing_px: 9 }, &["frame"])
        }]
    }

    #[test]
    fn the_cheapest_sequence_that_is_safe_and_quiet_enough_is_taken() {
        let quiet = [0.05, 0.045, 0.03];
        let choose = |safe, limit| choose(&sequences(quiet, safe), &gauge(limit), 0).production;
        assert_eq!(choose([1.0, 1.0, 1.0], 0.25), 0);
        assert_eq!(choose([0.9, 0.99, 1.0], 0.25), 1);
        assert_eq!(choose([0.9, 0.9, 1.0], 0.25), 2);
        // A limit of 0.04 mm allows σ = 0.04 · 9 / (6 √2) = 0.042 mm.
        assert_eq!(choose([1.0, 1.0, 1.0], 0.04), 2);
    }

    #[test]
    fn an_opening_that_must_stay_open_needs_the_full_sequence() {
        let mut gauges = gauge(0.25);
        gauges.push(GaugeFile {
            high: Some(0.25),
            ..GaugeFile::new(2, "opening 1", Coverage {}, &["opening 1"])
        });
        let sequences = sequences([0.05, 0.045, 0.03], [1.0; 3]);
        let choice = choose(&sequences, &gauges, 0);
        assert_eq!(choice.production, 2);
        assert!(choice.reasons[0].contains("blind"), "{:?}", choice.reasons);
    }

    #[test]
    fn it_says_what_each_sequence_would_cost_and_give() {
        let choice = choose(
            &sequences([0.05, 0.045, 0.03], [0.9, 1.0, 1.0]),
            &gauge(0.25),
            0,
        );
        assert!(choice.reasons[0].contains("4 frames") && choice.reasons[0].contains("not safe"));
        let unseen = "unseen at 2e-9 of its pixels (2e-3 where it is darkest)";
        assert!(choice.reasons[0].contains(unseen), "{}", choice.reasons[0]);
        assert_eq!(rate(1e-148), "less than 1e-12");
        assert!(choice.reasons[1].ends_with("taken"));
        assert!(choice.reasons[2].ends_with("better, not needed"));
    }
}
