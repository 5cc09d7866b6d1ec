//! Chooses the cheapest sequence whose noise and safe mask are good enough for a part's gauges.
//!
//! A longer sequence in the same cycle is chosen by `step_up` in `plan/judge.rs`.

use crate::recipe::{GaugeFile, SequenceFile, SequenceKind, UnseenFile};
use algo::inspect::Basis;

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
            "{} frames: height noise {:.1} µm of {:.1} µm allowed, safe on {:.1} % of the part{}: {word}",
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
