//! Ray tracing: what rays meet, where a ray meets a thin surface, and whether a point of the surface
//! sees the projector.
//!
//! Sphere tracing (J. C. Hart, 1996) of f(t) = z(t) − height(x(t), y(t)) along a ray with direction
//! d: with slopes of at most L, f changes by at most |d_z| + L·|d_xy| per unit of t, so a step
//! of |f| divided by that rate crosses nothing. Close to the surface a Newton step is tried and
//! kept if it brackets the crossing; regula falsi then refines the crossing.

use super::optics::{Vector, along, normalised};

/// Accuracy of a crossing along the ray, mm.
const TOLERANCE_MM: f64 = 1e-7;
/// Smallest step along a ray, mm; a fold thinner than this may be missed.
const MIN_STEP_MM: f64 = 1e-3;
/// Newton steps are tried closer to the surface than this, mm.
const NEAR_MM: f64 = 1.0;
/// Shadow rays start at this distance from the surface, mm.
const LIFT_MM: f64 = 0.02;
/// The box around the material is widened by this, mm.
const MARGIN_MM: f64 = 1e-3;
/// Half the distance over which slopes are computed, mm.
const SLOPE_STEP_MM: f64 = 1e-4;
/// Most steps along a ray, more than any ray needs; a ray that takes them all meets nothing.
const MAX_RAY_STEPS: usize = 100_000;

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

/// A thin surface z(x, y) in the part's own coordinates, mm.
///
/// `height` is defined and has bounded slope everywhere, also where the part is not `present`
/// (outside its outline, in its holes), where a ray passes through.
pub(crate) trait Surface: Send + Sync {
    /// z at (x, y).
    fn height(&self, x: f64, y: f64) -> f64;

    /// Whether there is material at (x, y).
    fn present(&self, x: f64, y: f64) -> bool;

    /// The light that the material reflects at (x, y), as a share of what white would reflect.
    fn albedo(&self, _x: f64, _y: f64) -> f64 {
        1.0
    }

    /// No slope of `height` is larger than this, in any direction.
    fn slope_bound(&self) -> f64;

    /// Lowest and highest corner of a box around all material.
    fn bounds(&self) -> [Vector; 2];
}

/// A surface with its bounds, computed once for all rays.
pub(super) struct Traced<'a> {
    surface: &'a dyn Surface,
    bounds: [Vector; 2],
    slope: f64,
}

impl<'a> Traced<'a> {
    pub fn new(surface: &'a dyn Surface) -> Self {
        let [low, high] = surface.bounds();
        Self {
            surface,
            bounds: [
                low.map(|edge| edge - MARGIN_MM),
                high.map(|edge| edge + MARGIN_MM),
            ],
            slope: surface.slope_bound(),
        }
    }

    /// The first crossing with material in start…end, and whether the ray came from above the
    /// surface. `side` states whether the ray starts above the surface if it starts on the surface
    /// itself, where the sign of f is only rounding error.
    fn crossing(
        &self,
        origin: Vector,
        direction: Vector,
        start: f64,
        end: f64,
        side: Option<bool>,
    ) -> Option<(f64, bool)> {
        let over = |t: f64| {
            let [x, y, z] = along(origin, direction, t);
            z - self.surface.height(x, y)
        };
        let steepest = self.slope * direction[0].hypot(direction[1]);
        let rate = direction[2].abs() + steepest;
        let mut t = start;
        let mut value = over(t);
        if let Some(above) = side
            && (value > 0.0) != above
        {
            // The surface rises between the point and the start of the shadow ray.
            let [x, y, _] = along(origin, direction, t);
            if self.surface.present(x, y) {
                return Some((t, above));
            }
        }
        // The ray leaves the surface at a steeper slope than the surface has anywhere, so it never
        // meets it again. This holds for most rays to the projector.
        if direction[2] * value.signum() > steepest {
            return None;
        }
        for _ in 0..MAX_RAY_STEPS {
            if t >= end {
                return None;
            }
            let above = value > 0.0;
            let safe = (value.abs() / rate).max(MIN_STEP_MM);
            let mut ahead = t + safe;
            let mut ahead_value = over(ahead);
            if (ahead_value > 0.0) == above && ahead_value.abs() < NEAR_MM {
                // |f| lost per unit of t over this step.
                let falling = (value.abs() - ahead_value.abs()) / safe;
                if falling > 0.0 {
                    let newton = ahead + ahead_value.abs() / falling * 1.01 + TOLERANCE_MM;
                    // A Newton step that does not bracket a crossing may have passed one, so it is
                    // discarded.
                    if newton - ahead < 2.0 * NEAR_MM {
                        let value_there = over(newton);
                        if (value_there > 0.0) != above {
                            (t, value) = (ahead, ahead_value);
                            (ahead, ahead_value) = (newton, value_there);
                        }
                    }
                }
            }
            if (ahead_value > 0.0) != above {
                let at = close_in(&over, (t, value), (ahead, ahead_value));
                let [x, y, _] = along(origin, direction, at);
                if at <= end && self.surface.present(x, y) {
                    return Some((at, above));
                }
            }
            (t, value) = (ahead, ahead_value);
        }
        None
    }
}

impl Body for Traced<'_> {
    fn first_hit(&self, origin: Vector, direction: Vector) -> Option<Hit> {
        let (start, end) = clip(&self.bounds, origin, direction)?;
        let (t, above) = self.crossing(origin, direction, start, end, None)?;
        let point = along(origin, direction, t);
        let [x, y, _] = point;
        let slope = |dx: f64, dy: f64| {
            let ahead = self.surface.height(x + dx, y + dy);
            (ahead - self.surface.height(x - dx, y - dy)) / (2.0 * SLOPE_STEP_MM)
        };
        let up = normalised([-slope(SLOPE_STEP_MM, 0.0), -slope(0.0, SLOPE_STEP_MM), 1.0]);
        let normal = if above { up } else { [-up[0], -up[1], -up[2]] };
        let albedo = self.surface.albedo(x, y);
        Some(Hit {
            point,
            normal,
            albedo,
            face: 0,
        })
    }

    fn shadowed(&self, hit: &Hit, towards: Vector) -> bool {
        let Some((_, end)) = clip(&self.bounds, hit.point, towards) else {
            return false;
        };
        let above = hit.normal[2] > 0.0;
        end > LIFT_MM
            && self
                .crossing(hit.point, towards, LIFT_MM, end, Some(above))
                .is_some()
    }
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

/// The sign change between two points, by regula falsi with the Illinois rule.
fn close_in(over: &impl Fn(f64) -> f64, near: (f64, f64), far: (f64, f64)) -> f64 {
    let ((mut a, mut fa), (mut b, mut fb)) = (near, far);
    for _ in 0..60 {
        if (b - a).abs() < TOLERANCE_MM || fa == fb {
            break;
        }
        let middle = b - fb * (b - a) / (fb - fa);
        let value = over(middle);
        if value.abs() < TOLERANCE_MM {
            return middle;
        }
        if (value > 0.0) == (fb > 0.0) {
            fa *= 0.5;
        } else {
            (a, fa) = (b, fb);
        }
        (b, fb) = (middle, value);
    }
    b
}
