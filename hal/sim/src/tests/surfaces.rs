//! Surfaces and rays: slopes and material stay within their bounds, and traced rays meet the surface where a march in small steps does.

use super::{all_parts, wall_dent};
use crate::optics::{Lens, Vector, along};
use crate::parts::Flowerpot;
use crate::trace::Traced;
use crate::{Part, Scenario};

#[test]
fn no_slope_is_above_its_bound_and_no_material_outside_of_its_box() {
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

#[test]
fn a_dent_of_a_wall_is_as_deep_along_its_normal_and_as_wide_across_it_as_it_says() {
    let [good, dented] = [vec![], vec![wall_dent(0.3)]].map(|defects| {
        let pot = Flowerpot {
            defects,
            ..Flowerpot::default()
        };
        Part::Flowerpot(pot).surface().unwrap()
    });
    let centre = [-60.0_f64, 52.0];
    // The wall of a pot has the same slope everywhere, its bound; n_z of its normal follows.
    let normal_z = 1.0 / good.slope_bound().hypot(1.0);
    let depth = |x: f64, y: f64| (good.height(x, y) - dented.height(x, y)) * normal_z;
    assert!((depth(centre[0], centre[1]) - 0.3).abs() < 1e-6);
    // Across the surface, up the wall and around it: half the depth at a quarter of the diameter (2 mm) from the centre, none beyond half
    // the diameter (4 mm).
    let radius = centre[0].hypot(centre[1]);
    let [outwards, around] = [
        [centre[0] / radius, centre[1] / radius],
        [-centre[1] / radius, centre[0] / radius],
    ];
    for ([x, y], per_mm) in [(outwards, normal_z), (around, 1.0)] {
        let at = |mm: f64| depth(centre[0] + x * mm * per_mm, centre[1] + y * mm * per_mm);
        for side in [-1.0, 1.0] {
            // Around the pot the place 2 mm along the tangent is farther from the axis by 2²/2r = 0.025 mm, where the wall is higher in z, so
            // that its distance in space from the centre is a little more than 2 mm: hence the tolerance.
            assert!((at(2.0 * side) - 0.15).abs() < 0.005, "{}", at(2.0 * side));
            assert_eq!(at(4.01 * side), 0.0);
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
