//! How long a pulse lasted, as far as that is known, and whether its exposure can be used.
//!
//! To many cameras the pulse is the exposure, and a program that makes pulses may be interrupted at any instruction, for as long
//! as it pleases the others on the computer. Readings of the clock around both edges tell: a pulse lasted at least from after its
//! rise to before its fall, and at most from before its rise to after its fall. An interruption between the edges moves these
//! bounds, one inside an edge widens them. None goes unnoticed.
//!
//! # How much a pulse may be off
//!
//! N-step phase shifting (docs/measurement.md, *Pattern and wrapped phase*) has frames I_k = A + B sin(2πφ + θ_k), θ_k = 2πk/N, and φ = atan2(S, C) / 2π
//! of S = Σ I_k cos θ_k and C = Σ I_k sin θ_k, which are NB/2 · (sin 2πφ, cos 2πφ). Is one frame k brighter by the share e, S and C
//! change by e I_k (cos θ_k, sin θ_k), and to first order
//!
//! > Δφ = (C ΔS − S ΔC) / (S² + C²) / 2π = e / (πN) · (A/B + sin x) cos x turns, with x = 2πφ + θ_k,
//!
//! which is at most e / (πN) · (A/B + 1/2). All pixels of one phase have the same error, so no mean over an area betters it.
//! With e = 0.5 %, N = 4 and A = B (a pattern down to black, no other light) that is 0.0006 turn, a twelfth of the noise of one
//! pixel in such a level (0.0074 turn, 0.056 mm in docs/measurement.md, *Noise*), or 0.0045 mm; with three steps and as much other
//! light as the pattern's mean (A = 2 B) it is 0.0013 turn or 0.01 mm. A pulse that ends 200 µs of 16.7 ms late, which no stamp
//! tells from a good one, is 2.4 times as bad.

use std::time::Duration;

use crate::units::Timestamp;

/// A pulse may be off by one part in so many of its width: 0.5 %.
const SHARE: u32 = 200;
/// It may be off by this in any case: no two edges are known better on a computer that has nothing else to do (some µs each, the way
/// into the kernel and out of it). It is more than the share for pulses below 4 ms, shorter than any refresh that makes grey levels.
const LEAST: Duration = Duration::from_micros(20);

/// Readings of the head's clock around the two edges of a pulse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edges {
    /// Before the line was told to begin the pulse, and after it did.
    pub rise: (Timestamp, Timestamp),
    /// Before the line was told to end the pulse, and after it did.
    pub fall: (Timestamp, Timestamp),
}

/// A pulse that did not last as long as it should, or of which that is not known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spoiled {
    /// When it began, as [`super::Trigger::fire`] answered.
    pub fired: Timestamp,
    /// How long it should have lasted.
    pub width: Duration,
    /// It may have been shorter by so much.
    pub shorter: Duration,
    /// It may have been longer by so much.
    pub longer: Duration,
}

impl Spoiled {
    /// What a pulse is that should have lasted `width` and has these edges; none if it lasted so long.
    #[must_use]
    pub fn by(edges: &Edges, width: Duration) -> Option<Self> {
        let (rise, fall) = (edges.rise, edges.fall);
        let (shortest, longest) = (fall.0.since(rise.1), fall.1.since(rise.0));
        let pulse = Self {
            fired: rise.1,
            width,
            shorter: width.saturating_sub(shortest),
            longer: longest.saturating_sub(width),
        };
        (pulse.off() > (width / SHARE).max(LEAST)).then_some(pulse)
    }

    /// Whether it decided an exposure of this length. A pulse that only starts one is shorter than half of it.
    #[must_use]
    pub fn decides(&self, exposure: Duration) -> bool {
        self.width * 2 >= exposure
    }

    /// By how much it may have been off.
    #[must_use]
    pub fn off(&self) -> Duration {
        self.shorter.max(self.longer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: Duration = Duration::from_micros(16_653);
    /// Half a percent of it.
    const ALLOWED: Duration = Duration::from_nanos(83_265);

    fn us(us: u64) -> Duration {
        Duration::from_micros(us)
    }

    /// A pulse whose rise took `rise`, whose fall began `after` the readings before the rise and took `fall`.
    fn pulse(rise: Duration, after: Duration, fall: Duration) -> Edges {
        let begun = Timestamp(1_000_000_000);
        Edges {
            rise: (begun, begun + rise),
            fall: (begun + after, begun + (after + fall)),
        }
    }

    #[test]
    fn a_pulse_of_its_width_between_prompt_edges_is_fine() {
        for edges in [
            pulse(us(0), WIDTH, us(0)),
            pulse(us(9), WIDTH, us(9)),
            pulse(ALLOWED, WIDTH, us(0)),
            pulse(us(0), WIDTH, ALLOWED),
            pulse(us(0), WIDTH + ALLOWED, us(0)),
            pulse(us(0), WIDTH - ALLOWED, us(0)),
        ] {
            assert_eq!(Spoiled::by(&edges, WIDTH), None, "{edges:?}");
        }
    }

    #[test]
    fn an_interruption_at_any_place_spoils_a_pulse_by_as_much_as_it_lasted() {
        let (stall, edge) = (us(100), us(2));
        let fired = Timestamp(1_000_000_000);
        for (what, edges, began, shorter, longer) in [
            // The fall is planned from the reading before the rise, so that here the pulse may have lost what the rise took.
            ("in the rise", pulse(stall, WIDTH, edge), stall, stall, edge),
            (
                "before the fall",
                pulse(edge, WIDTH + stall, edge),
                edge,
                us(0),
                stall + edge,
            ),
            ("in the fall", pulse(edge, WIDTH, stall), edge, edge, stall),
            (
                "ended too soon",
                pulse(edge, WIDTH - stall, edge),
                edge,
                stall + edge,
                us(0),
            ),
        ] {
            let spoiled = Spoiled {
                fired: fired + began,
                width: WIDTH,
                shorter,
                longer,
            };
            assert_eq!(Spoiled::by(&edges, WIDTH), Some(spoiled), "{what}");
            assert!(spoiled.off() >= stall, "{what}");
        }
    }

    #[test]
    fn a_short_pulse_may_be_off_by_what_edges_take() {
        let width = us(100);
        assert_eq!(Spoiled::by(&pulse(us(20), width, us(20)), width), None);
        let off = Spoiled::by(&pulse(us(0), width + us(21), us(0)), width).unwrap();
        assert_eq!(
            (off.shorter, off.longer, off.off()),
            (us(0), us(21), us(21))
        );
    }

    #[test]
    fn what_a_pulse_may_be_off_costs_the_phase_that_the_doc_says() {
        // Nothing but the formulas of the doc, by trial over all phases: N, A/B, and the bound in turns.
        let e = 1.0 / f64::from(SHARE);
        for (steps, ambient, bound) in [(4, 1.0, 0.0006), (3, 2.0, 0.00135)] {
            let mut worst = 0.0_f64;
            for tried in 0..1000 {
                let phase = f64::from(tried) / 1000.0 * std::f64::consts::TAU;
                let (mut s, mut c) = (0.0, 0.0);
                for k in 0..steps {
                    let shift = std::f64::consts::TAU * f64::from(k) / f64::from(steps);
                    let brighter = if k == 0 { 1.0 + e } else { 1.0 };
                    let light = brighter * (ambient + (phase + shift).sin());
                    (s, c) = (s + light * shift.cos(), c + light * shift.sin());
                }
                let off = (s.atan2(c) - phase).sin().asin() / std::f64::consts::TAU;
                worst = worst.max(off.abs());
            }
            assert!(worst < bound && worst > bound / 1.5, "{steps}: {worst}");
        }
    }
}
