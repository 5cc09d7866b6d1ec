//! The line of a flat stretch.
//!
//! # Equations
//! z = c + a (x − m), m the middle of the stretch, by weighted least squares of the heights. Total
//! least squares would share the error between x and z, but the place of a pixel's point is known
//! far better than its height: what is uncertain is how far along the line of sight it lies. With
//! weights w = 1/variance and sums about m,
//!
//! ```text
//! [Σw  Σwx ] [c]   [Σwz ]
//! [Σwx Σwx²] [a] = [Σwxz]        C = the matrix's inverse
//! ```
//!
//! One pass over the points, whose sums run in their order.

use super::request::Why;

/// Fewest points of a stretch.
const POINTS: usize = 30;
/// The share of a stretch that its points must reach over.
const REACH: f64 = 0.5;
/// The largest RMS distance of a stretch's heights from their line beyond noise, mm: the ripple of
/// fringes is a tenth of it, a stretch that goes on into an edge has more.
const FLAT: f64 = 0.05;

/// Sums over the points of a stretch.
#[derive(Clone, Copy, Debug, Default)]
pub struct Moments {
    stretch: [f64; 2],
    middle: f64,
    /// A height of the stretch, from which others are counted so that squares keep their digits.
    level: f64,
    count: usize,
    reach: [f64; 2],
    w: f64,
    x: f64,
    z: f64,
    xx: f64,
    xz: f64,
    zz: f64,
}

impl Moments {
    /// None yet, of this stretch.
    pub fn new(stretch: [f64; 2]) -> Self {
        Self {
            stretch,
            middle: (stretch[0] + stretch[1]) / 2.0,
            reach: [f64::INFINITY, f64::NEG_INFINITY],
            ..Self::default()
        }
    }

    /// Whether a point at x lies in the stretch.
    #[inline]
    pub fn holds(&self, x: f64) -> bool {
        self.stretch[0] <= x && x <= self.stretch[1]
    }

    /// Adds a point with its weight.
    #[inline]
    pub fn add(&mut self, x: f64, z: f64, w: f64) {
        if self.count == 0 {
            self.level = z;
        }
        self.count += 1;
        if x < self.reach[0] {
            self.reach[0] = x;
        }
        if x > self.reach[1] {
            self.reach[1] = x;
        }
        let (x, z) = (x - self.middle, z - self.level);
        let (wx, wz) = (w * x, w * z);
        self.w += w;
        self.x += wx;
        self.z += wz;
        self.xx += wx * x;
        self.xz += wx * z;
        self.zz += wz * z;
    }

    /// The line of the points.
    pub fn line(&self) -> Result<StretchLine, Why> {
        if self.count < POINTS {
            return Err(Why::FewPoints {
                has: self.count,
                needs: POINTS,
            });
        }
        let share = (self.reach[1] - self.reach[0]) / (self.stretch[1] - self.stretch[0]);
        // Not a number fails, too.
        if !(share >= REACH) {
            return Err(Why::ShortStretch {
                share,
                needs: REACH,
            });
        }
        let determinant = self.w * self.xx - self.x * self.x;
        let [cc, ca, aa] = [self.xx, -self.x, self.w].map(|sum| sum / determinant);
        let (c, a) = (cc * self.z + ca * self.xz, ca * self.z + aa * self.xz);
        let cost = self.zz - c * self.z - a * self.xz;
        let off = libm::sqrt(((cost - (self.count - 2) as f64) / self.w).max(0.0));
        if !(off <= FLAT && (c + self.level).is_finite() && a.is_finite()) {
            return Err(Why::NotFlat { off, most: FLAT });
        }
        Ok(StretchLine {
            middle: self.middle,
            height: c + self.level,
            slope: a,
            along: (1.0 / libm::sqrt(1.0 + a * a), a / libm::sqrt(1.0 + a * a)),
            covariance: [[cc, ca], [ca, aa]],
        })
    }
}

/// A line z = height + slope (x − middle), and its frame: along it towards the joint, and the depth
/// below it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StretchLine {
    /// m, the middle of its stretch, mm.
    pub middle: f64,
    /// c, mm.
    pub height: f64,
    /// a, mm per mm.
    pub slope: f64,
    /// The line's direction, of length 1.
    along: (f64, f64),
    /// Of c and a by noise.
    pub covariance: [[f64; 2]; 2],
}

impl StretchLine {
    /// The length of (1, a).
    pub fn stretch(&self) -> f64 {
        libm::sqrt(1.0 + self.slope * self.slope)
    }

    /// A direction or difference of x and z in the line's frame: along and depth.
    pub fn turned(&self, x: f64, z: f64) -> (f64, f64) {
        let (s, t) = self.along;
        (x * s + z * t, x * t - z * s)
    }

    /// A point in the line's frame.
    pub fn own(&self, x: f64, z: f64) -> (f64, f64) {
        self.turned(x - self.middle, z - self.height)
    }
}
