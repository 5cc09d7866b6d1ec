//! The profile of a side: a line, and a circle tangent to it; and how pixels average it.
//!
//! # Equations
//! In the frame of the line, x along it towards the joint and y the depth below it: y = 0 up to the
//! tangent point t, then the circle about (t, r) of radius r. Light comes to the camera along u =
//! (u_x, u_up), so a place is given by how far along u and across it, towards the joint, it lies
//! from the tangent point:
//!
//! ```text
//! way = (x − t) u_x − y u_up        across = (x − t) u_up + y u_x        i = r (1 + u_x) − across
//! ```
//!
//! i says how far inside the silhouette the place's ray passes. It meets the profile at
//!
//! ```text
//! S(i) = across u_x / u_up                       on the line, where across ≤ 0
//! S(i) = −r u_up + √(2 r i − i²)                 on the circle
//! ```
//!
//! along u. A point is measured along its ray, so way − S is its residual. A pixel averages the
//! phase over a footprint across the line of sight, by the light that each part sends. With l the
//! direction to the projector, n the surface's normal, and a matt surface, it sees
//!
//! ```text
//! B(i) = ∫ g(ξ) (n·l) S(i − ξ) dξ / ∫ g(ξ) (n·l) dξ        g: normal density of σ = blur
//! ```
//!
//! The integral ends at the silhouette, beyond which is nothing or a floor. B depends on i and r
//! only, so three values of it have its derivatives by all parameters.
//!
//! # A bin
//! By how much its height is off, and how uncertain that is.
//!
//! Heights near the rim are wrong: a pixel there averages the phase of a curved surface, and beyond
//! the silhouette of a floor. The first follows from the profile, whose form leaves a share `BLUR` of
//! it uncertain. The second is not known: a height gets the variance that the floor's share of the
//! pixel makes, less if no heights follow behind the edge, so that the floor is dark.

use super::bins::Bin;

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
/// Step of differences, mm: B is smooth over a blur, and rounding adds less than 1e-8.
const STEP: f64 = 1e-6;

/// A direction or place in the frame of a line: along, up.
type InLine = (f64, f64);

/// A line and a circle tangent to it, as a camera and a projector in some directions see them.
#[derive(Clone, Copy, Debug)]
pub struct SideProfile {
    /// u, of length 1.
    sight: InLine,
    /// l, of length 1: along the line and up; across u and along it.
    light: InLine,
    turned: InLine,
    /// Half the width of what a pixel averages, mm.
    reach: f64,
}

/// Where a point is, from the tangent point.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Along u, mm.
    pub way: f64,
    /// How far inside the silhouette, mm.
    pub inside: f64,
}

/// What changes a residual: the tangent point, the radius, and lifting the whole profile.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rates {
    /// ∂/∂t.
    pub t: f64,
    /// ∂/∂r.
    pub r: f64,
    /// By the profile's height.
    pub lift: f64,
}

impl SideProfile {
    /// With unit vectors to camera and projector, and σ of what a pixel averages, mm.
    pub fn new(sight: InLine, light: InLine, blur: f64) -> Self {
        Self {
            sight,
            light,
            turned: (
                light.0 * sight.1 - light.1 * sight.0,
                light.0 * sight.0 + light.1 * sight.1,
            ),
            reach: REACH * blur,
        }
    }

    /// The ray through a point of the line's frame.
    pub fn ray(&self, [t, r]: [f64; 2], x: f64, y: f64) -> Ray {
        let (along, up) = self.sight;
        let x = x - t;
        Ray {
            way: x * along - y * up,
            inside: r * (1.0 + along) - (x * up + y * along),
        }
    }

    /// u_up.
    pub fn up(&self) -> f64 {
        self.sight.1
    }

    /// S(i); `None` beyond the silhouette.
    pub fn surface(&self, inside: f64, r: f64) -> Option<f64> {
        let (along, up) = self.sight;
        let across = r * (1.0 + along) - inside;
        match across <= 0.0 {
            true => Some(across * along / up),
            false if inside >= 0.0 => Some(libm::sqrt(inside * (2.0 * r - inside)) - r * up),
            false => None,
        }
    }

    /// The sine of the angle to the tangent point at which the ray meets the circle.
    pub fn sine(&self, inside: f64, r: f64) -> f64 {
        let (along, up) = self.sight;
        let across = 1.0 - inside / r;
        across * up + libm::sqrt((1.0 - across * across).max(0.0)) * along
    }

    /// The cosine of the angle between the surface of the circle and the line of sight.
    pub fn facing(&self, inside: f64, r: f64) -> f64 {
        let across = (1.0 - inside / r).max(-self.sight.0);
        libm::sqrt((1.0 - across * across).max(0.0))
    }

    /// The share of a pixel's footprint that lies beyond the silhouette.
    pub fn missing(&self, inside: f64) -> f64 {
        let x = (inside / self.reach).clamp(-1.0, 1.0);
        let square = x * x;
        // The integral of (1 − x²)⁴.
        let inner =
            1.0 - square * (4.0 / 3.0 - square * (1.2 - square * (4.0 / 7.0 - square / 9.0)));
        0.5 - x * inner * (315.0 / 256.0)
    }

    /// B(i). Where no part of the footprint is lit, the height of the silhouette.
    pub fn seen(&self, inside: f64, r: f64) -> f64 {
        let (along, up) = self.sight;
        let (reach, inverse) = (self.reach, 1.0 / self.reach);
        // i − ξ = v²: at the silhouette the surface is a parabola of v.
        let low = libm::sqrt((inside - reach).max(0.0));
        let high = libm::sqrt((inside + reach).max(0.0));
        let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
        let tangent = r * (1.0 + along);
        let (across, way) = (self.turned.0 / r, self.turned.1 / r);
        let (mut light, mut sum) = (0.0, 0.0);
        for (node, weight) in NODES {
            let v = middle + node * half;
            let square = v * v;
            let off = (inside - square) * inverse;
            let density = (1.0 - off * off).max(0.0);
            let density = density * density;
            // On the line and on the circle.
            let beside = tangent - square;
            let root = v * libm::sqrt((2.0 * r - square).max(0.0));
            let (at, lit) = match beside <= 0.0 {
                true => (beside * along / up, self.light.1),
                false => (root - r * up, (r - square) * across + root * way),
            };
            let share = weight * v * density * density * lit.max(0.0);
            light += share;
            sum += share * at;
        }
        match light > 0.0 {
            true => sum / light,
            false => -r * up,
        }
    }

    /// How a residual changes, where B(i) is this.
    pub fn rates(&self, inside: f64, r: f64, seen: f64) -> Rates {
        let (along, up) = self.sight;
        let slope = (self.seen(inside + STEP, r) - seen) / STEP;
        let swell = (self.seen(inside, r + STEP) - seen) / STEP;
        Rates {
            t: -along - slope * up,
            r: -swell - slope * (1.0 + along),
            lift: slope * along - up,
        }
    }
}

/// The share of what blur does that the profile's form leaves uncertain, bin by bin.
const BLUR: f64 = 0.15;
/// What a lit floor adds to a height, mm: its share of the pixel times a turn's depth over 2π.
const MIX: f64 = 1.0;
/// The same of a floor too dark for heights.
const DARK: f64 = 0.1;
/// A ray that passes the circle farther away than this, in blurs, sees something else.
const PASSES: f64 = 2.0;

/// How a side is seen.
#[derive(Clone, Copy, Debug)]
pub struct SideView {
    /// Its profile.
    pub profile: SideProfile,
    /// σ of what a pixel averages, mm.
    pub blur: f64,
    /// What a pixel of nothing but floor adds to a height, mm.
    pub mix: f64,
}

/// A bin that sees the circle.
#[derive(Clone, Copy, Debug)]
pub struct SeenBin {
    /// Its ray.
    pub ray: Ray,
    /// B, mm.
    pub seen: f64,
    /// Its residual, mm.
    pub way: f64,
    /// By how much it sees the surface elsewhere, mm.
    pub off: f64,
    /// The variance of its residual, mm².
    pub variance: f64,
}

impl SideView {
    /// Of a side with a lit or a dark floor behind it.
    pub fn new(profile: SideProfile, blur: f64, lit: bool) -> Self {
        let mix = if lit { MIX } else { DARK };
        Self { profile, blur, mix }
    }

    /// How a bin sees the circle p = (t, r); `None` where its ray passes.
    #[inline]
    pub fn seen(&self, p: [f64; 2], bin: &Bin) -> Option<SeenBin> {
        let ray = self.profile.ray(p, bin.x, bin.y);
        let surface = self.profile.surface(ray.inside, p[1])?;
        let seen = self.profile.seen(ray.inside, p[1]);
        let (off, leak) = (surface - seen, self.leak(ray.inside));
        Some(SeenBin {
            ray,
            seen,
            way: ray.way - seen,
            off,
            variance: bin.variance + BLUR * BLUR * off * off + leak * leak,
        })
    }

    /// What a bin whose ray passes the circle p costs, beside one that lies on it.
    pub fn passed(&self, p: [f64; 2], bin: &Bin, most: f64) -> f64 {
        let inside = self.profile.ray(p, bin.x, bin.y).inside;
        let leak = self.leak(inside);
        let far = inside < -PASSES * self.blur;
        libm::log(1.0 + leak * leak / bin.variance) + if far { most } else { 1.0 }
    }

    fn leak(&self, inside: f64) -> f64 {
        self.mix * self.profile.missing(inside)
    }
}
