//! A rigid motion from one frame of coordinates to another: X' = R·X + t.

use crate::geometry::Vector;

/// Rows of R, and t in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Rows of R.
    pub rows: [Vector; 3],
    /// t, mm.
    pub shift: Vector,
}

impl Pose {
    /// The point in the other frame.
    #[inline]
    pub fn apply(&self, point: Vector) -> Vector {
        self.turned(point) + self.shift
    }

    /// The direction in the other frame.
    #[inline]
    pub fn turned(&self, direction: Vector) -> Vector {
        let [x, y, z] = self.rows.map(|row| row.dot(direction));
        Vector::new(x, y, z)
    }

    /// Back from the other frame.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let [a, b, c] = self.rows;
        let rows = [
            Vector::new(a.x, b.x, c.x),
            Vector::new(a.y, b.y, c.y),
            Vector::new(a.z, b.z, c.z),
        ];
        let back = Self {
            rows,
            shift: Vector::default(),
        };
        Self {
            shift: back.turned(self.shift) * -1.0,
            ..back
        }
    }

    /// The motion that consists of `first` and then of this one.
    #[must_use]
    pub fn after(&self, first: &Self) -> Self {
        // Row i of R·F is Fᵀ applied to row i of R.
        let transposed = first.inverse();
        Self {
            rows: self.rows.map(|row| transposed.turned(row)),
            shift: self.apply(first.shift),
        }
    }

    /// This pose with a small turn (rotation vector, rad) after R and a shift added to t, given as
    /// one list: turn, then shift.
    #[must_use]
    pub fn moved(&self, by: &[f64]) -> Self {
        let turn = Vector::new(by[0], by[1], by[2]);
        let shift = Vector::new(by[3], by[4], by[5]);
        let angle = turn.length();
        if angle == 0.0 {
            return Self {
                shift: self.shift + shift,
                ..*self
            };
        }
        // Rodrigues' formula, applied to the columns of R.
        let axis = turn * (1.0 / angle);
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        let columns = self.inverse().rows.map(|column| {
            column * cos + axis.cross(column) * sin + axis * (axis.dot(column) * (1.0 - cos))
        });
        let turned = Self {
            rows: columns,
            shift: Vector::default(),
        };
        Self {
            rows: turned.inverse().rows,
            shift: self.shift + shift,
        }
    }

    /// The pose whose x and y axes are nearly `x` and `y`: made orthogonal, of length 1 and
    /// right-handed.
    pub(super) fn from_axes(x: Vector, y: Vector, shift: Vector) -> Self {
        let x = x * (1.0 / x.length());
        let y = y * (1.0 / y.length());
        // Both axes are turned by the same angle until they are at right angles.
        let (sum, difference) = (x + y, x - y);
        let sum = sum * (core::f64::consts::FRAC_1_SQRT_2 / sum.length());
        let difference = difference * (core::f64::consts::FRAC_1_SQRT_2 / difference.length());
        let (x, y) = (sum + difference, sum - difference);
        let columns = Self {
            rows: [x, y, x.cross(y)],
            shift: Vector::default(),
        };
        Self {
            rows: columns.inverse().rows,
            shift,
        }
    }
}
