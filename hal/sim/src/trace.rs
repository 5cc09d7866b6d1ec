//! Where a ray meets a surface, and whether a point of it sees the projector.
//!
//! Sphere tracing (J. C. Hart, 1996) on f(t) = z(t) − height(x(t), y(t)): with slopes of at most L, f changes by at
//! most |d_z| + L·|d_xy| per unit of t, so a step of |f| over that rate crosses nothing. Close to the surface a
//! Newton step is tried and kept if it brackets the crossing; the crossing is then closed in on.

use super::optics::{Vector, along, dot, normalised};
use super::parts::Surface;

/// Crossings are met this well along the ray, mm.
const TOLERANCE_MM: f64 = 1e-7;
/// No step is smaller: a fold thinner than this may be missed, mm.
const MIN_STEP_MM: f64 = 1e-3;
/// Newton steps are tried closer to the surface than this, mm.
const NEAR_MM: f64 = 1.0;
/// Shadow rays leave the surface by this before they look back, mm.
const LIFT_MM: f64 = 0.02;
/// The box around the material is widened by this, mm.
const MARGIN_MM: f64 = 1e-3;
/// Half the distance over which slopes are taken, mm.
const SLOPE_STEP_MM: f64 = 1e-4;
/// More steps than any ray needs; a ray that takes them all sees nothing.
const MAX_STEPS: usize = 100_000;

/// A surface with what every ray asks of it.
pub(super) struct Traced<'a> {
    surface: &'a dyn Surface,
    bounds: [Vector; 2],
    slope: f64,
}

/// Where a ray met the surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    pub point: Vector,
    /// The unit normal on the side that the ray came from.
    pub normal: Vector,
}

impl<'a> Traced<'a> {
    pub fn new(surface: &'a dyn Surface) -> Self {
        Self {
            surface,
            bounds: surface.bounds(),
            slope: surface.slope_bound(),
        }
    }

    /// The first point of material on the ray from `origin` along the unit vector `direction`.
    pub fn first_hit(&self, origin: Vector, direction: Vector) -> Option<Hit> {
        let (start, end) = self.clip(origin, direction)?;
        let (t, above) = self.crossing(origin, direction, start, end, None)?;
        let point = along(origin, direction, t);
        let [x, y, _] = point;
        let slope = |dx: f64, dy: f64| {
            let ahead = self.surface.height(x + dx, y + dy);
            (ahead - self.surface.height(x - dx, y - dy)) / (2.0 * SLOPE_STEP_MM)
        };
        let up = normalised([-slope(SLOPE_STEP_MM, 0.0), -slope(0.0, SLOPE_STEP_MM), 1.0]);
        let normal = if above { up } else { [-up[0], -up[1], -up[2]] };
        Some(Hit { point, normal })
    }

    /// Whether material lies between `hit` and a far point in direction `towards` (a unit vector on the hit's side).
    pub fn shadowed(&self, hit: &Hit, towards: Vector) -> bool {
        let Some((_, end)) = self.clip(hit.point, towards) else {
            return false;
        };
        let above = hit.normal[2] > 0.0;
        end > LIFT_MM
            && self
                .crossing(hit.point, towards, LIFT_MM, end, Some(above))
                .is_some()
    }

    /// The stretch of the ray inside the box around the material, from t = 0 on.
    fn clip(&self, origin: Vector, direction: Vector) -> Option<(f64, f64)> {
        let (mut start, mut end) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let (low, high) = (
                self.bounds[0][axis] - MARGIN_MM,
                self.bounds[1][axis] + MARGIN_MM,
            );
            if direction[axis].abs() < 1e-12 {
                if !(low..=high).contains(&origin[axis]) {
                    return None;
                }
                continue;
            }
            let a = (low - origin[axis]) / direction[axis];
            let b = (high - origin[axis]) / direction[axis];
            start = start.max(a.min(b));
            end = end.min(a.max(b));
        }
        (start < end && end.is_finite()).then_some((start, end))
    }

    /// The first crossing with material in start…end, and whether the ray came from above the surface. `side`
    /// tells it where the ray starts on the surface itself, where its own sign is rounding.
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
            // The surface curves up between the point and the first look back.
            let [x, y, _] = along(origin, direction, t);
            if self.surface.present(x, y) {
                return Some((t, above));
            }
        }
        // Away from the surface, and steeper than it is anywhere: nothing follows. So are most rays to the projector.
        if direction[2] * value.signum() > steepest {
            return None;
        }
        for _ in 0..MAX_STEPS {
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
                    // A step that does not bracket may have jumped over something and is forgotten.
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

/// The share of a light from direction `towards` that a surface with `normal` catches, or none behind it.
pub(super) fn facing(normal: Vector, towards: Vector) -> Option<f64> {
    let cosine = dot(normal, towards);
    (cosine > 0.0).then_some(cosine)
}
