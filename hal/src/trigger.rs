//! The trigger of a head, which starts one exposure of the camera per pulse; bounds of how long a
//! pulse lasted, and whether the frame that it exposed can be used.
//!
//! Many cameras expose for as long as the pulse lasts, and the program that makes the pulses may be
//! interrupted at any instruction for any time. Therefore the clock is read before and after each
//! edge: a pulse lasted at least from after its rise to before its fall, and at most from before
//! its rise to after its fall. An interruption between the edges moves these bounds, one inside an
//! edge widens them, so every interruption is noticed.
//!
//! # How much a pulse may be off
//!
//! N-step phase shifting (docs/measurement.md, *Pattern and wrapped phase*) has frames I_k = A + B
//! sin(2πφ + θ_k), θ_k = 2πk/N, and φ = atan2(S, C) / 2π with S = Σ I_k cos θ_k and C = Σ I_k sin
//! θ_k, which are NB/2 · (sin 2πφ, cos 2πφ). If one frame k is brighter by the share e, S and C
//! change by e I_k (cos θ_k, sin θ_k), and to first order
//!
//! > Δφ = (C ΔS − S ΔC) / (S² + C²) / 2π = e / (πN) · (A/B + sin x) cos x turns, with x = 2πφ + θ_k,
//!
//! which is at most e / (πN) · (A/B + 1/2). All pixels of one phase have the same error, so
//! averaging over an area does not reduce it. With e = 0.5 %, N = 4 and A = B (a pattern down to
//! black, no other light) that is 0.0006 turn, a twelfth of the noise of one pixel in such a level
//! (0.0074 turn, 0.056 mm in docs/measurement.md, *Noise*), or 0.0045 mm; with three steps and as
//! much other light as the pattern's mean (A = 2 B) it is 0.0013 turn or 0.01 mm. A pulse of 16.7
//! ms that ends 200 µs late, which cannot be told from a good one by the frame's time stamp, causes
//! 2.4 times that error.

use std::time::Duration;

use heapless::Deque;

use crate::error::Error;
use crate::units::Timestamp;

/// How many triggers back a frame may belong to: so many pulses are remembered, and so many spoiled
/// ones are kept until fetched.
pub const REMEMBERED: usize = 16;
/// The width of a pulse divided by this is how much the pulse may be off: 0.5 %.
const WIDTH_DIVISOR: u32 = 200;
/// Every pulse may be off by this much: even on an idle computer two edges are not known better (a
/// system call for each takes some µs). This is more than 0.5 % of pulses below 4 ms, but a pulse
/// that lasts a refresh of a projector that shows grey levels is longer.
const LEAST: Duration = Duration::from_micros(20);

/// Starts one camera exposure per call.
pub trait Trigger: Send {
    /// Begins one pulse and returns the time at which it began, without waiting for its end.
    ///
    /// Only the frames show whether the camera took it: a pulse on an open wire, or to a camera
    /// that is stopped or busy, is lost.
    ///
    /// # Errors
    /// The device's error.
    fn fire(&mut self) -> Result<Timestamp, Error>;

    /// From now on the camera exposes `times` as long as its own `exposure`: so do pulses that set
    /// the exposure.
    fn expose(&mut self, _exposure: Duration, _times: u32) {}

    /// The next spoiled pulse that was not fetched yet; at most the latest [`REMEMBERED`] are kept.
    ///
    /// A spoiled pulse is known as soon as it has ended. So a caller that first fetches a frame and
    /// then calls this learns of the pulse that exposed it. A trigger that does not measure its
    /// pulses returns `None`.
    fn poll_spoiled(&mut self) -> Option<Spoiled> {
        None
    }
}

/// No trigger, for a camera that runs by itself.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoTrigger;

impl Trigger for NoTrigger {
    /// # Errors
    /// Always `Unsupported`.
    fn fire(&mut self) -> Result<Timestamp, Error> {
        Err(Error::unsupported(
            "triggering the camera without a trigger line",
            "name the line in head.trigger.line",
        ))
    }
}

/// Readings of the head's clock around the two edges of a pulse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edges {
    /// Before and after the call that began the pulse.
    pub rise: (Timestamp, Timestamp),
    /// Before and after the call that ended the pulse.
    pub fall: (Timestamp, Timestamp),
}

/// A pulse that was too long or too short, or that may have been.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spoiled {
    /// When it began, as [`Trigger::fire`] returned.
    pub fired: Timestamp,
    /// How long it should have lasted.
    pub width: Duration,
    /// By how much it may have been too short.
    pub shorter: Duration,
    /// By how much it may have been too long.
    pub longer: Duration,
}

/// Whether a pulse of this width determines the length of an exposure.
pub(crate) fn decides(width: Duration, exposure: Duration) -> bool {
    width * 2 >= exposure
}

impl Spoiled {
    /// Judges a pulse with these edges that should have lasted `width`; `None` if it was good.
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
        (pulse.off() > (width / WIDTH_DIVISOR).max(LEAST)).then_some(pulse)
    }

    /// Whether it determined the length of an exposure. A pulse shorter than half the exposure only
    /// starts it.
    #[must_use]
    pub fn decides(&self, exposure: Duration) -> bool {
        decides(self.width, exposure)
    }

    /// By how much it may have been off.
    #[must_use]
    pub fn off(&self) -> Duration {
        self.shorter.max(self.longer)
    }

    /// An upper bound of the time at which it ended: not before the reading after its fall, and not
    /// before its planned end.
    #[must_use]
    pub fn ended(&self) -> Timestamp {
        self.fired + (self.width + self.longer)
    }
}

/// The latest spoiled pulses, oldest first; filled with [`keep_latest`].
pub(crate) type SpoiledPulses = Deque<Spoiled, REMEMBERED>;

/// Appends `item` to a queue of the latest items; if it is full, its oldest item is removed first and
/// returned.
pub(crate) fn keep_latest<T, const N: usize>(queue: &mut Deque<T, N>, item: T) -> Option<T> {
    let oldest = if queue.is_full() {
        queue.pop_front()
    } else {
        None
    };
    // There is room now, unless N is 0.
    let _ = queue.push_back(item);
    oldest
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

    /// A pulse whose rising edge took `rise`, whose falling edge began `after` the reading before
    /// the rise and took `fall`.
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
    fn an_interruption_at_any_place_or_an_early_end_spoils_a_pulse_by_at_least_its_length() {
        let (stall, edge) = (us(100), us(2));
        let fired = Timestamp(1_000_000_000);
        for (what, edges, began, shorter, longer) in [
            // The fall is timed from the reading before the rise, so the pulse may be shorter by
            // the time that the rise took.
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
        // The formulas of the module's doc, tried over all phases: N, A/B, and the bound in turns.
        let e = 1.0 / f64::from(WIDTH_DIVISOR);
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
