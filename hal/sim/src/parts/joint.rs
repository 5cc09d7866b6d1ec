//! Two sheets with rounded edges beside each other, over a floor: a joint with a gap and a flush.
//!
//! In the section across the joint, with s along the left sheet's upper side and z above it, the
//! right sheet's upper side has the direction (cos τ, sin τ). An edge of radius r is an arc that is
//! tangent to the upper side at T and has its centre C = T − r n, n the side's normal. With m =
//! (cos τ/2, sin τ/2), the mean direction of both sides, and E = C ± r m, the extreme points of the
//! arcs along it,
//!
//! ```text
//! flush = distance of T_right from the left side      gap = (E_right − E_left) · m
//! ```

use serde::{Deserialize, Serialize};

use super::sheet::{Floor, Sheet, Solid};
use hal::bounded;
use hal::bounds::{Bound, Fields, OutOfBounds, within};

/// The direction across a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Across {
    /// The left sheet lies at −x, the joint runs along y.
    #[default]
    X,
    /// The left sheet lies at −y, the joint runs along x.
    Y,
}

bounded! {
    /// A joint whose gap, without a flush and a tilt, is in the middle of x = 0 or y = 0.
    pub struct Joint: Default {
        /// The direction across it.
        pub across: Across,
        /// Distance of the edges along the mean direction of both upper sides, mm.
        pub gap: f64 = 0.0..=100.0 => 2.0,
        /// How far the right edge's tangent point lies above the left upper side, mm; negative:
        /// below.
        pub flush: f64 = -100.0..=100.0,
        /// Radius of the left edge, mm.
        pub left_radius: f64 = 0.0..=100.0 => 1.5,
        /// Radius of the right edge, mm.
        pub right_radius: f64 = 0.0..=100.0 => 1.5,
        /// By how much the right sheet rises away from the joint, degrees.
        pub tilt_deg: f64 = -60.0..=60.0,
        /// Extent of each sheet across the joint, edge included, mm.
        pub width: f64 = 1.0..=1000.0 => 70.0,
        /// Extent along the joint, mm.
        pub length: f64 = 1.0..=1000.0 => 110.0,
        /// z of the left upper side, mm.
        pub z: f64 = -1000.0..=1000.0 => 8.0,
        /// Thickness of both sheets, mm; edges of a larger radius end as deep as that.
        pub thickness_mm: f64 = 0.0..=100.0,
        /// What lies below.
        pub floor: Floor = Fields,
    }
}

impl Joint {
    pub(super) fn check(&self) -> Result<(), OutOfBounds> {
        Fields.check("part", self)?;
        for (key, radius) in [
            ("part.left_radius", self.left_radius),
            ("part.right_radius", self.right_radius),
        ] {
            // Both edges of a sheet are rounded.
            within(key, radius, 0.0, self.width.min(self.length) / 2.0)?;
        }
        let lowest = self.sheets().map(|sheet| sheet.lowest());
        let lowest = lowest[0].min(lowest[1]);
        match self.floor.albedo > 0.0 {
            true => within(
                "part.floor.depth",
                self.floor.depth,
                self.z - lowest,
                1000.0,
            ),
            false => Ok(()),
        }
    }

    /// The sheets, left and right; each begins at the tangent point of its edge.
    fn sheets(&self) -> [Sheet; 2] {
        let (sin, cos) = self.tilt_deg.to_radians().sin_cos();
        let (half_sin, half_cos) = (self.tilt_deg.to_radians() / 2.0).sin_cos();
        let [left, right] = [self.left_radius, self.right_radius];
        // From centre to centre.
        let up = self.flush - right * cos + left;
        let along = (self.gap + left + right - up * half_sin) / half_cos;
        // T_left lies at s = −along / 2, C_left below it.
        let tangents = [[-along / 2.0, 0.0], [along / 2.0 - right * sin, self.flush]];
        let far = |radius: f64| self.width - radius;
        let sides = [
            (tangents[0], left, [1.0, 0.0], [-far(left), left]),
            (tangents[1], right, [cos, sin], [-right, far(right)]),
        ];
        sides.map(|([s, z], radius, [along, up], [from, to])| {
            // A vector of the section in the coordinates of the part.
            let turned = |s: f64, z: f64| match self.across {
                Across::X => [s, 0.0, z],
                Across::Y => [0.0, s, z],
            };
            let beside = match self.across {
                Across::X => [0.0, 1.0, 0.0],
                Across::Y => [-1.0, 0.0, 0.0],
            };
            Sheet {
                origin: turned(s, self.z + z),
                axes: [turned(along, up), beside, turned(-up, along)],
                outline: [[from, -self.length / 2.0], [to, self.length / 2.0]],
                openings: Vec::new(),
                joggle: None,
                dents: Vec::new(),
                thickness: self.thickness_mm.max(radius),
                rim: radius,
            }
        })
    }

    pub(super) fn solid(&self) -> Solid {
        Solid::new(self.sheets().into(), self.z, &self.floor)
    }
}
