//! How a part lies in the plane of a face by the contours that were found in it.
//!
//! A flat part is placed in its plane by the picture, which weak edges over a lit floor can lead
//! astray by more than contours are looked for. Circles and slots that were found all the same tell
//! where the others are.

use super::find::ContourFit;
use super::shape::Outline;
use super::taught::{Contours, Expected};
use crate::inspect::feature::PlaneFrame;
use crate::inspect::strips::fits::Fit;
use alloc::vec::Vec;

/// A contour that is expected so near to where it was looked for is not looked for again, mm.
const NEAR_MM: f64 = 0.1;

/// A place, in the axes of the plane's frames.
type Place = (f64, f64);

/// A rigid motion in a plane: a place x goes to `to` + R(x − `from`).
#[derive(Clone, Copy, Debug)]
pub struct Shift {
    from: Place,
    to: Place,
    /// Cosine and sine.
    turn: (f64, f64),
}

impl Shift {
    /// From where the circles and slots of the plane with this number were expected to where they
    /// were found, by least squares; `None` if none was found. One alone does not turn.
    pub fn of(
        contours: &Contours,
        found: &[ContourFit],
        (number, plane): (usize, &Fit),
    ) -> Option<Self> {
        let all = contours.all.iter().zip(found);
        let pairs = all.filter_map(|(expected, found)| {
            let (is_here, found) = (expected.plane == number, found.closed()?);
            let frame = contours.frame(expected, plane).filter(|_| is_here)?;
            Some([&expected.outline, found].map(|of| place(&frame, of)))
        });
        Self::through(&pairs.collect::<Vec<_>>())
    }

    /// The motion that takes the first place of each pair to the second.
    fn through(pairs: &[[Place; 2]]) -> Option<Self> {
        let mean = |of: usize| {
            let count = pairs.len() as f64;
            let sum = |of: fn(Place) -> f64, at: usize| -> f64 {
                pairs.iter().map(|pair| of(pair[at])).sum()
            };
            (sum(|at| at.0, of) / count, sum(|at| at.1, of) / count)
        };
        let (from, to) = (mean(0), mean(1));
        let (mut cos, mut sin) = (0.0, 0.0);
        for [one, other] in pairs {
            let (one, other) = (less(*one, from), less(*other, to));
            cos += one.0 * other.0 + one.1 * other.1;
            sin += one.0 * other.1 - one.1 * other.0;
        }
        let length = libm::hypot(cos, sin);
        let turn = match length > 0.0 {
            true => (cos / length, sin / length),
            false => (1.0, 0.0),
        };
        (!pairs.is_empty()).then_some(Self { from, to, turn })
    }

    fn moved(&self, at: Place) -> Place {
        let (x, y) = less(at, self.from);
        let (cos, sin) = self.turn;
        (self.to.0 + cos * x - sin * y, self.to.1 + sin * x + cos * y)
    }

    /// Where a contour with this frame is expected after the motion; `None` if that is where it was
    /// looked for.
    pub fn apply(&self, expected: &Expected, frame: &PlaneFrame) -> Option<Expected> {
        let place = place(frame, &expected.outline);
        let by = less(self.moved(place), place);
        let outline = expected.outline.moved(by, self.turn);
        (libm::hypot(by.0, by.1) > NEAR_MM).then(|| expected.with(outline))
    }
}

/// Where the middle of a contour lies.
fn place(frame: &PlaneFrame, outline: &Outline) -> Place {
    let (x, y) = outline.middle();
    let at = frame.point(x, y);
    (at.dot(frame.x), at.dot(frame.y))
}

fn less(one: Place, other: Place) -> Place {
    (one.0 - other.0, one.1 - other.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::contour::shape::Line;

    #[test]
    fn a_motion_takes_places_to_where_they_were_found() {
        let (sin, cos) = (libm::sin(0.01), libm::cos(0.01));
        let motion = |(x, y): Place| (1.2 + cos * x - sin * y, sin * x + cos * y - 0.4);
        let pairs = [(-60.0, 40.0), (55.0, 41.0), (24.0, 2.0)].map(|at| [at, motion(at)]);
        let near = |one: Place, other: Place| {
            let off = less(one, other);
            libm::hypot(off.0, off.1) < 1e-9
        };
        let edge = (-80.0, 0.0);
        let all = Shift::through(&pairs).unwrap();
        assert!(near(all.moved(edge), motion(edge)));
        // One alone does not turn.
        let one = Shift::through(&pairs[..1]).unwrap();
        let by = less(pairs[0][1], pairs[0][0]);
        assert!(near(less(one.moved(edge), edge), by));
        assert!(Shift::through(&[]).is_none());
    }

    #[test]
    fn an_outline_moves_with_its_middle_and_turns_about_it() {
        let (sin, cos) = (libm::sin(0.1), libm::cos(0.1));
        let line = Line::of(&[(-3.0, 1.0), (3.0, 1.0)]).unwrap();
        let all = [
            Outline::Circle([1.0, 2.0, 3.0]),
            Outline::Slot([1.0, 2.0, 4.0, 3.0, 0.2]),
            Outline::Line(line, [0.0, 0.05]),
        ];
        for of in all {
            let moved = of.moved((0.7, -0.3), (cos, sin));
            let (middle, at) = (of.middle(), moved.middle());
            assert!(libm::hypot(at.0 - middle.0 - 0.7, at.1 - middle.1 + 0.3) < 1e-9);
            let from = |of: &Outline, (x, y): Place| less(of.at(0.1), (x, y));
            let (one, other) = (from(&of, middle), from(&moved, at));
            let turned = (cos * one.0 - sin * one.1, sin * one.0 + cos * one.1);
            let is_round = matches!(of, Outline::Circle(_));
            let off = less(other, if is_round { one } else { turned });
            assert!(libm::hypot(off.0, off.1) < 1e-9, "{of:?} {off:?}");
        }
    }
}
