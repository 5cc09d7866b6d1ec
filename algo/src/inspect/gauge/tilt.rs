//! The angle of a region.

use super::kind::*;
use crate::inspect::feature::{LevelPlane, weight};

words! {
    /// An axis of the world.
    Axis {
        /// x.
        X: "x",
        /// y.
        Y: "y",
    }
}

kind! {
    /// The angle of the least-squares plane about an axis, degrees, right-handed; 0 is parallel to
    /// the plane z = 0.
    Tilt {
        /// The axis.
        about: Axis = Axis::WORDS,
    }
}

impl Kind for Tilt {
    fn facts(&self) -> Facts {
        Facts {
            unit: Unit::Angle,
            words: "about {about}",
            ..Facts::new(Basis::Region, SURFACE)
        }
    }

    fn find(&self, of: Evidence<'_>) -> Option<FoundValue> {
        let plane = LevelPlane::of(of.cells())?;
        let [xx, xy, yy] = plane.squares;
        let determinant = xx * yy - xy * xy;
        // Turned about +x, what lies at +y rises; turned about +y, what lies at +x sinks.
        let (slope, sign) = match self.about {
            Axis::X => (plane.down, 1.0_f64),
            Axis::Y => (plane.along, -1.0),
        };
        let degrees = f64::to_degrees(sign) / (1.0 + slope * slope);
        let change = |cell: &Cell| {
            let (dx, dy) = (
                cell.taught.x - plane.centre[0],
                cell.taught.y - plane.centre[1],
            );
            let lever = match self.about {
                Axis::X => xx * dy - xy * dx,
                Axis::Y => yy * dx - xy * dy,
            };
            degrees * weight(cell) * lever / determinant
        };
        of.room.extend(of.cells().iter().map(change));
        Some(of.linear((sign * libm::atan(slope)).to_degrees()))
    }
}
