//! What rays meet: a body, the point where a ray meets it, and the box around it.

use super::optics::Vector;

/// Something that rays meet, in the coordinates of its part, mm.
pub(crate) trait Body: Sync {
    /// The first point of material on the ray from `origin` along the unit vector `direction`.
    fn first_hit(&self, origin: Vector, direction: Vector) -> Option<Hit>;

    /// Whether material lies between `hit` and a distant point in direction `towards`, a unit
    /// vector on the side of the normal.
    fn shadowed(&self, hit: &Hit, towards: Vector) -> bool;
}

/// Where a ray met a body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    pub point: Vector,
    /// The unit normal, on the side from which the ray came.
    pub normal: Vector,
    /// The light that the material reflects, as a share of what white would reflect.
    pub albedo: f64,
    /// Number of the smooth face, so that an edge between two of them is known.
    pub face: u16,
}

/// The interval of t ≥ 0 in which a ray is inside the box between two corners; none if it misses
/// the box, or never leaves it.
pub(crate) fn clip(
    [low, high]: &[Vector; 2],
    origin: Vector,
    direction: Vector,
) -> Option<(f64, f64)> {
    let (mut start, mut end) = (0.0_f64, f64::INFINITY);
    for axis in 0..3 {
        if direction[axis].abs() < 1e-12 {
            if !(low[axis]..=high[axis]).contains(&origin[axis]) {
                return None;
            }
            continue;
        }
        let a = (low[axis] - origin[axis]) / direction[axis];
        let b = (high[axis] - origin[axis]) / direction[axis];
        start = start.max(a.min(b));
        end = end.min(a.max(b));
    }
    (start < end && end.is_finite()).then_some((start, end))
}
