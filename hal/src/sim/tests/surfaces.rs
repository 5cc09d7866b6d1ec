//! Surfaces and rays: slopes stay in their bounds, and rays meet what small steps meet.

use super::all_parts;
use crate::sim::optics::{Lens, Vector, along};
use crate::sim::trace::Traced;
use crate::sim::{Part, Scenario};

#[test]
fn no_height_has_a_slope_above_its_bound() {
    for part in all_parts() {
        let Some(surface) = part.surface() else {
            continue;
        };
        let bound = surface.slope_bound();
        let step = 0.01;
        for i in -240..240 {
            for j in -240..240 {
                let (x, y) = (f64::from(i) * 0.503, f64::from(j) * 0.497);
                let here = surface.height(x, y);
                for (dx, dy) in [
                    (step, 0.0),
                    (0.0, step),
                    (0.6 * step, 0.8 * step),
                    (0.8 * step, -0.6 * step),
                ] {
                    let slope = (surface.height(x + dx, y + dy) - here).abs() / step;
                    assert!(
                        slope <= bound + 1e-6,
                        "{part:?} at ({x}, {y}): {slope} > {bound}"
                    );
                }
                let [low, high] = surface.bounds();
                if surface.present(x, y) {
                    let p = [x, y, here];
                    assert!(
                        (0..3).all(|a| p[a] >= low[a] - 1e-9 && p[a] <= high[a] + 1e-9),
                        "{part:?} {p:?}"
                    );
                }
            }
        }
    }
}

/// The first sign change of z − height at material, by small steps.
fn marched(part: &Part, origin: Vector, direction: Vector) -> Option<f64> {
    let surface = part.surface()?;
    let over = |t: f64| {
        let [x, y, z] = along(origin, direction, t);
        (z - surface.height(x, y), surface.present(x, y))
    };
    let step = 0.01;
    let mut t = 400.0;
    let mut last = over(t).0;
    while t < 900.0 {
        t += step;
        let (value, present) = over(t);
        if (value > 0.0) != (last > 0.0) && present {
            return Some(t);
        }
        last = value;
    }
    None
}

#[test]
fn a_ray_meets_every_part_where_small_steps_meet_it() {
    let lens = Lens::new(Scenario::default().rig.camera.model());
    for part in all_parts() {
        let surface = part.surface();
        for k in 0..60_u32 {
            let (u, v) = (f64::from(k * 197 % 512), f64::from(k * 331 % 512));
            let ray = lens.ray(u, v);
            let slow = marched(&part, lens.centre(), ray);
            let fast = surface
                .as_deref()
                .and_then(|s| Traced::new(s).first_hit(lens.centre(), ray));
            match (slow, fast) {
                (None, None) => {}
                (Some(t), Some(hit)) => {
                    let [x, y, z] = along(lens.centre(), ray, t);
                    let off = (x - hit.point[0])
                        .hypot(y - hit.point[1])
                        .hypot(z - hit.point[2]);
                    assert!(off < 0.02, "{part:?} at ({u}, {v}): {off} mm apart");
                    let exact = z_at(&part, hit.point);
                    assert!(
                        (hit.point[2] - exact).abs() < 1e-5,
                        "{part:?}: {} off",
                        hit.point[2] - exact
                    );
                }
                (slow, fast) => panic!("{part:?} at ({u}, {v}): {slow:?} against {fast:?}"),
            }
        }
    }
}

fn z_at(part: &Part, point: Vector) -> f64 {
    part.surface().unwrap().height(point[0], point[1])
}
