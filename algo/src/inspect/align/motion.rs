//! A small rigid motion: from how a part lay when it was taught to how it lies now.

use crate::geometry::Vector;

/// p ↦ c + R (p − c) + t, R by the rotation vector's angle about its direction (Rodrigues'
/// formula).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// c, the point that is turned about, mm.
    pub centre: Vector,
    /// t, the shift of c, mm.
    pub shift: Vector,
    /// The rotation vector, rad.
    pub turn: Vector,
    /// Rows of R.
    rows: [Vector; 3],
}

impl Motion {
    /// A turn about `centre` and a shift.
    pub fn new(centre: Vector, shift: Vector, turn: Vector) -> Self {
        let angle = turn.length();
        let axis = turn * (1.0 / angle.max(f64::MIN_POSITIVE));
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        let row = |unit: Vector| {
            // R = cos·1 + sin·[a]× + (1 − cos)·aaᵀ; row i of [a]× is e_i × a.
            unit * cos + unit.cross(axis) * sin + axis * (axis.dot(unit) * (1.0 - cos))
        };
        Self {
            centre,
            shift,
            turn,
            rows: [
                row(Vector::new(1.0, 0.0, 0.0)),
                row(Vector::new(0.0, 1.0, 0.0)),
                row(Vector::new(0.0, 0.0, 1.0)),
            ],
        }
    }

    /// No motion.
    pub fn none(centre: Vector) -> Self {
        Self::new(centre, Vector::default(), Vector::default())
    }

    /// Where a point of the taught part is now.
    pub fn apply(&self, point: Vector) -> Vector {
        let from = point - self.centre;
        let turned = Vector::new(
            self.rows[0].dot(from),
            self.rows[1].dot(from),
            self.rows[2].dot(from),
        );
        self.centre + turned + self.shift
    }

    /// Where a point was when the part was taught.
    #[inline]
    pub fn undo(&self, point: Vector) -> Vector {
        let from = point - self.centre - self.shift;
        self.centre + self.rows[0] * from.x + self.rows[1] * from.y + self.rows[2] * from.z
    }

    /// Shift in mm and rotation vector in rad as one list: x, y, z, about x, about y, about z.
    pub fn values(&self) -> [f64; 6] {
        let (shift, turn) = (self.shift, self.turn);
        [shift.x, shift.y, shift.z, turn.x, turn.y, turn.z]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_turn_about_z_takes_x_to_y_and_undoing_it_leads_back() {
        let quarter = Vector::new(0.0, 0.0, core::f64::consts::FRAC_PI_2);
        let centre = Vector::new(1.0, 1.0, 5.0);
        let motion = Motion::new(centre, Vector::new(0.0, 0.0, 2.0), quarter);
        let moved = motion.apply(Vector::new(3.0, 1.0, 5.0));
        assert!(
            (moved - Vector::new(1.0, 3.0, 7.0)).length() < 1e-12,
            "{moved:?}"
        );
        let point = Vector::new(-7.0, 2.5, 9.0);
        assert!((motion.undo(motion.apply(point)) - point).length() < 1e-12);
        let still = Motion::none(centre).apply(point);
        assert_eq!(still, point);
    }
}
