//! Pixels beside which light changes so steeply that their phase is not that of their middle.
//!
//! **Idea.** A pixel measures the mean phase of what it sees, weighted by light. Where light changes within it,
//! by a print or along a crease of a part that mirrors, that is the phase of its brighter side. A
//! displaced part has the edge elsewhere, so golden's error is not the same.
//!
//! **Equation.** With modulations B and phases Φ of the pixels before and behind it in its row, half of what they
//! differ by being its slopes B′ and Φ′, and the variance s² of what a pixel sees along the row,
//!
//! ```text
//! E = s² Φ′ B′ / B                  refused where |E| > 2.5 σ_Φ and |B₊ − B₋| > ¼ of the larger one
//! ```
//!
//! (Burke and Zhong 2016 correct textures so), and beside pixels that are at full scale. Fringes are nearly upright, so light that changes down the
//! columns turns no phase. An edge sharper than a pixel has more error than its slopes say: s² = ¼ px²
//! covers that, and the blur of lenses of up to 0.4 px.
//!
//! **Units.** Modulations and phases as words; σ_Φ in turns.

use crate::trust::Trust;
use crate::units::{AbsolutePhase, Modulation};
use alloc::vec::Vec;
use core::ops::Range;

/// s², px².
const SEEN: f64 = 0.25;
/// The error of a pixel that is not refused, in σ of its phase.
const MOST_SIGMAS: f64 = 2.5;
/// Smaller differences of modulations, as a share of the larger one, are none: one over this.
const LEAST: u32 = 4;
/// Bits of a modulation that do not matter for its noise.
const COARSE: u32 = 8;

/// What pixels may differ by.
#[derive(Clone, Debug)]
pub(super) struct LightEdges {
    /// The largest product of the differences of B and Φ, by the upper bits of a pixel's own B.
    most: Vec<u64>,
}

/// What is known of a pixel.
#[derive(Clone, Copy)]
enum Neighbour {
    Resolved {
        phase: i64,
        modulation: u32,
    },
    /// At full scale: however bright it is.
    Saturated,
    /// It has no light, or no phase.
    Unknown,
}

impl LightEdges {
    /// For pixels whose phase has this σ in turns, by their modulation.
    pub fn new(sigma: impl Fn(Modulation) -> f64) -> Self {
        let most = |upper: u16| {
            let modulation = Modulation::from_bits(upper << COARSE | 1 << (COARSE - 1));
            let sigma = sigma(modulation) * f64::from(1 << 16);
            let product = sigma * f64::from(modulation.to_bits());
            // B′ Φ′ is a quarter of the product of the differences.
            (4.0 * MOST_SIGMAS / SEEN * product) as u64
        };
        Self {
            most: (0..1 << (16 - COARSE)).map(most).collect(),
        }
    }

    /// Refuses pixels of a decoded row.
    pub fn refuse(
        &self,
        phase: &mut [AbsolutePhase],
        modulation: &mut [Modulation],
        trust: &mut [Trust],
        columns: Range<usize>,
    ) {
        let read = |phase: &[AbsolutePhase],
                    modulation: &[Modulation],
                    trust: Option<&Trust>,
                    at: usize| {
            match trust {
                Some(Trust::Resolved) => Neighbour::Resolved {
                    phase: phase[at].to_bits().into(),
                    modulation: modulation[at].to_bits().into(),
                },
                Some(Trust::Saturated) => Neighbour::Saturated,
                _ => Neighbour::Unknown,
            }
        };
        // There is none before the first, either.
        let first = columns.start.wrapping_sub(1);
        let mut before = read(phase, modulation, trust.get(first), first);
        for at in columns {
            let here = read(phase, modulation, trust.get(at), at);
            let behind = read(phase, modulation, trust.get(at + 1), at + 1);
            if self.is_edge(before, here, behind) {
                phase[at] = AbsolutePhase::UNKNOWN;
                modulation[at] = Modulation::default();
                trust[at] = Trust::LightEdge;
            }
            before = here;
        }
    }

    fn is_edge(&self, before: Neighbour, here: Neighbour, behind: Neighbour) -> bool {
        let Neighbour::Resolved { modulation, .. } = here else {
            return false;
        };
        let (
            Neighbour::Resolved {
                phase: first,
                modulation: a,
            },
            Neighbour::Resolved {
                phase: last,
                modulation: b,
            },
        ) = (before, behind)
        else {
            let mut beside = [before, behind].into_iter();
            return beside.any(|beside| matches!(beside, Neighbour::Saturated));
        };
        let differ = a.abs_diff(b);
        let turned = last.abs_diff(first);
        let most = self.most[(modulation >> COARSE) as usize];
        LEAST * differ > a.max(b) && u64::from(differ) * turned > most
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::SampleNoise;
    use crate::pattern::{PhaseRange, Sequence};
    use crate::phase::Decoder;

    /// A row of pixels with these modulations in counts of 255, whose phase rises by a twentieth of a turn from each to
    /// the next; which of its columns are refused.
    fn refused(counts: &[f64], columns: Range<usize>) -> Vec<usize> {
        let sequence = Sequence::from_frames(&Sequence::dense(4.0, 4)).unwrap();
        let range = PhaseRange {
            min: 0.0,
            max: 60.0,
        };
        let decoder = Decoder::new(&sequence, range, 8).unwrap();
        let noise = SampleNoise::constant(1.0);
        let edges = LightEdges::new(|modulation| decoder.phase_noise(modulation, noise));
        let unit = Modulation::from_bits(u16::MAX).counts(255) / f64::from(u16::MAX);
        let places = 0..counts.len();
        let phase = |at| AbsolutePhase::from_turns(20.0 + at as f64 / 20.0);
        let mut phase: Vec<_> = places.clone().map(phase).collect();
        let mut modulation: Vec<_> = counts
            .iter()
            .map(|counts| Modulation::from_bits((counts / unit) as u16))
            .collect();
        let mut trust: Vec<_> = counts
            .iter()
            .map(|counts| match *counts {
                0.0 => Trust::Dark,
                255.0 => Trust::Saturated,
                _ => Trust::Resolved,
            })
            .collect();
        edges.refuse(&mut phase, &mut modulation, &mut trust, columns);
        let refused = places.filter(|&at| trust[at] == Trust::LightEdge);
        let refused: Vec<usize> = refused.collect();
        assert!(refused.iter().all(|&at| !phase[at].is_known()));
        refused
    }

    #[test]
    fn pixels_on_both_sides_of_a_step_are_refused_and_no_others() {
        assert_eq!(
            refused(&[100.0, 100.0, 100.0, 10.0, 10.0, 10.0], 0..6),
            [2, 3]
        );
        assert_eq!(refused(&[10.0, 10.0, 60.0, 100.0, 100.0], 0..5), [1, 2, 3]);
        assert_eq!(
            refused(&[100.0, 100.0, 255.0, 255.0, 10.0, 10.0], 0..6),
            [1, 4]
        );
        // What a column is does not depend on which are asked for.
        assert_eq!(refused(&[100.0, 100.0, 100.0, 10.0, 10.0, 10.0], 3..6), [3]);
    }

    #[test]
    fn a_highlight_that_rises_slowly_and_the_last_pixel_of_a_part_are_no_edges() {
        let slope: Vec<f64> = (0..40).map(|at| 20.0 + 2.5 * f64::from(at)).collect();
        assert!(refused(&slope, 0..40).is_empty());
        assert!(refused(&[100.0, 100.0, 90.0, 0.0, 0.0], 0..5).is_empty());
        assert_eq!(refused(&[100.0, 100.0, 50.0, 0.0, 0.0], 0..5), [1]);
        // The error of a step from 100 to 76 counts is within the noise of no pixel, but small.
        assert!(refused(&[100.0, 100.0, 76.0, 76.0], 0..4).is_empty());
    }
}
