//! The profile of a side: a line, and a circle tangent to it; and how pixels average it.
//!
//! # Equations
//! In the frame of the line, x along it towards the joint and y the depth below it: y = 0 up to the
//! tangent point t, then the circle about (t, r) of radius r. With u the direction to the camera,
//! the ray through a point q meets the profile at q + λ u,
//!
//! ```text
//! λ = y / u_up                      on the line
//! λ = −b + √(b² − c)                on the circle: m = q − (t, r), b = m·u, c = m·m − r²
//! ```
//!
//! A point is measured along its ray, so −λ is its residual. A pixel averages the phase over a
//! footprint across the line of sight, by the light that each part sends. With l the direction to
//! the projector, n the surface's normal, and a matt surface,
//!
//! ```text
//! δ = ∫ g (n·l) λ(ξ) dξ / ∫ g (n·l) dξ − λ(0)        g: normal density of σ = blur
//! ```
//!
//! is by how much it sees the surface elsewhere. The integral ends at the silhouette, beyond which
//! is nothing or a floor.

use crate::math::associate::Distance;

/// Half the width of what a pixel averages, of its σ: (1 − ξ²/reach²)⁴ has the variance reach²/11,
/// and is a normal density within 3 % of its largest.
const REACH: f64 = 3.316_624_790_355_4;
/// Nodes of Gauss' quadrature and their weights.
const NODES: [(f64, f64); 8] = [
    (-0.960_289_856_497_536_3, 0.101_228_536_290_376_3),
    (-0.796_666_477_413_626_7, 0.222_381_034_453_374_5),
    (-0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (-0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_5),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_3),
];
/// Step of derivatives, mm.
const STEP: f64 = 1e-3;

/// Directions to the camera and to the projector in the line's frame, unit vectors: along, up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Directions {
    /// u.
    pub sight: (f64, f64),
    /// l.
    pub light: (f64, f64),
}

/// Where a ray meets the profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// λ, mm.
    pub way: f64,
    /// The surface's normal: along, up. (sin θ, cos θ) at θ of the arc.
    pub normal: (f64, f64),
}

/// A line and a circle tangent to it, with t and r, in these directions.
#[derive(Clone, Copy, Debug)]
pub struct Rounded(pub Directions);

/// The same with a stated radius.
#[derive(Clone, Copy, Debug)]
pub struct Stated(pub Blurred, pub f64);

impl Rounded {
    /// Where the ray through a point meets the profile; `None` where it passes.
    pub fn hit(&self, [t, r]: [f64; 2], x: f64, y: f64) -> Option<Hit> {
        let (along, up) = self.0.sight;
        let way = y / up;
        if x + way * along <= t {
            let normal = (0.0, 1.0);
            return Some(Hit { way, normal });
        }
        let (x, y) = (x - t, y - r);
        let b = x * along - y * up;
        let root = b * b - (x * x + y * y - r * r);
        (root >= 0.0).then(|| {
            let way = libm::sqrt(root) - b;
            let normal = ((x + way * along) / r, (way * up - y) / r);
            Hit { way, normal }
        })
    }

    /// How far inside the silhouette the ray through a point passes, mm.
    pub fn inside(&self, [t, r]: [f64; 2], x: f64, y: f64) -> f64 {
        let (along, up) = self.0.sight;
        r - ((x - t) * up + (y - r) * along)
    }
}

/// What is fitted: t and r of a profile as pixels see it.
#[derive(Clone, Copy, Debug)]
pub struct Blurred {
    /// The profile.
    pub rounded: Rounded,
    /// σ of what a pixel averages, mm.
    pub blur: f64,
}

impl Blurred {
    /// −λ of the surface and as it is seen; `None` if no part of the pixel's footprint meets it.
    fn seen(&self, p: [f64; 2], x: f64, y: f64) -> Option<f64> {
        let Directions { sight, light } = self.rounded.0;
        let inside = self.rounded.inside(p, x, y);
        let reach = REACH * self.blur;
        // ξ = inside − v²: at the silhouette the surface is a parabola of v.
        let low = libm::sqrt((inside - reach).max(0.0));
        let high = libm::sqrt((inside + reach).max(0.0));
        let (mut light_sum, mut way_sum) = (0.0, 0.0);
        for (node, weight) in NODES {
            let v = (low + high + node * (high - low)) / 2.0;
            let across = inside - v * v;
            let Some(hit) = self
                .rounded
                .hit(p, x + across * sight.1, y + across * sight.0)
            else {
                continue;
            };
            let off = across / reach;
            let density = (1.0 - off * off).max(0.0);
            let density = density * density * density * density;
            let lit = hit.normal.0 * light.0 + hit.normal.1 * light.1;
            let share = weight * v * density * lit.max(0.0);
            light_sum += share;
            way_sum += share * hit.way;
        }
        (light_sum > 0.0).then(|| -way_sum / light_sum)
    }

    /// How the distance changes if the whole profile is lifted.
    pub fn lifted(&self, p: &[f64; 2], x: f64, y: f64) -> f64 {
        (self.distance(p, x, y + STEP) - self.distance(p, x, y - STEP)) / (-2.0 * STEP)
    }
}

impl Distance<2> for Blurred {
    /// Where the whole footprint passes, of the ray as if it touched the circle.
    fn distance(&self, p: &[f64; 2], x: f64, y: f64) -> f64 {
        let (along, up) = self.rounded.0.sight;
        let touching = || (x - p[0]) * along - (y - p[1]) * up;
        self.seen(*p, x, y).unwrap_or_else(touching)
    }

    fn derivative(&self, p: &[f64; 2], x: f64, y: f64) -> [f64; 2] {
        let by = |t: f64, r: f64| self.distance(&[p[0] + t, p[1] + r], x, y);
        [
            by(STEP, 0.0) - by(-STEP, 0.0),
            by(0.0, STEP) - by(0.0, -STEP),
        ]
        .map(|d| d / (2.0 * STEP))
    }
}

impl Distance<1> for Stated {
    fn distance(&self, &[t]: &[f64; 1], x: f64, y: f64) -> f64 {
        self.0.distance(&[t, self.1], x, y)
    }

    fn derivative(&self, &[t]: &[f64; 1], x: f64, y: f64) -> [f64; 1] {
        [self.0.derivative(&[t, self.1], x, y)[0]]
    }
}
