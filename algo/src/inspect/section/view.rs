//! How a bin sees a circle: by how much its height is off, and how uncertain that is.
//!
//! Heights near the rim are wrong: a pixel there averages the phase of a curved surface, and beyond
//! the silhouette of a floor. The first follows from the profile, whose form leaves a share `BLUR` of
//! it uncertain. The second is not known: a height gets the variance that the floor's share of the
//! pixel makes, less if no heights follow behind the edge, so that the floor is dark.

use super::bins::Bin;
use super::profile::{Ray, SideProfile};

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
