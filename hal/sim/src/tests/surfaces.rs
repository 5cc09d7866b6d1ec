//! Surfaces and rays: slopes and material stay within their bounds, and traced rays meet the
//! surface where a march in small steps does.

use super::all_parts;
use crate::optics::{Lens, Vector, along};
use crate::parts::Defect;
use crate::trace::{Body, Traced};
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

/// What a dent of 0.4 mm depth and 8 mm diameter, centred at the point of the surface above (x, y),
/// removes along the normal there: in steps of 1 mm across the surface, along the steepest
/// direction and perpendicular to it, from −5 to 5 mm.
fn removed(part: &Part, [x, y]: [f64; 2]) -> [Vec<f64>; 2] {
    let good = part.surface().unwrap();
    let mut part = part.clone();
    part.defects_mut().unwrap().push(Defect::Dent {
        x,
        y,
        depth_mm: 0.4,
        diameter_mm: 8.0,
    });
    let dented = part.surface().unwrap();
    let half = 1e-4;
    let along_x = (good.height(x + half, y) - good.height(x - half, y)) / (2.0 * half);
    let along_y = (good.height(x, y + half) - good.height(x, y - half)) / (2.0 * half);
    let slope = along_x.hypot(along_y);
    let normal_z = 1.0 / slope.hypot(1.0);
    let up = match slope > 1e-6 {
        true => [along_x / slope, along_y / slope],
        false => [1.0, 0.0],
    };
    [(up, normal_z), ([-up[1], up[0]], 1.0)].map(|([to_x, to_y], per_mm)| {
        let depth = |mm: i32| {
            let mm = f64::from(mm) * per_mm;
            let (x, y) = (x + to_x * mm, y + to_y * mm);
            (good.height(x, y) - dented.height(x, y)) * normal_z
        };
        (-5..=5).map(depth).collect()
    })
}

#[test]
fn a_dent_is_as_deep_along_the_normal_and_as_wide_across_the_surface_as_it_says_on_every_part() {
    // cos²(π/2 · r / 4 mm) of 0.4 mm.
    let expected = |mm: f64| 0.4 * (std::f64::consts::PI * mm.min(4.0) / 8.0).cos().powi(2);
    let mut dented = 0;
    for mut part in Part::stock() {
        let Defect::Dent { x, y, .. } = super::dent(&part, 0.0) else {
            continue;
        };
        if part.defects_mut().is_none() {
            continue;
        }
        dented += 1;
        for profile in removed(&part, [x, y]) {
            assert!((profile[5] - 0.4).abs() < 1e-6, "{part:?}: {profile:?}");
            for (mm, found) in (-5_i32..).zip(profile) {
                // Places that are as far apart across a curved surface are nearer or farther in
                // space, hence the tolerance.
                let off = (found - expected(f64::from(mm.abs()))).abs();
                assert!(off < 0.02, "{part:?} at {mm} mm: {found}");
            }
        }
    }
    assert_eq!(
        dented,
        Part::stock().len() - 2,
        "all but board and empty stage"
    );
}

#[test]
fn a_dent_of_a_flat_face_goes_down_in_z_as_deep_as_it_says() {
    let mut bracket = Part::default();
    let good = bracket.surface().unwrap();
    bracket.defects_mut().unwrap().push(Defect::Dent {
        x: 0.0,
        y: -8.0,
        depth_mm: 0.6,
        diameter_mm: 14.0,
    });
    let dented = bracket.surface().unwrap();
    for step in -8_i32..=8 {
        let off = f64::from(step);
        let share = (std::f64::consts::FRAC_PI_2 * off.abs().min(7.0) / 7.0)
            .cos()
            .powi(2);
        let found = good.height(off, -8.0) - dented.height(off, -8.0);
        assert!((found - 0.6 * share).abs() < 1e-12, "{found} at {off} mm");
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
    // All parts lie between z = −100 and 100.
    let [mut t, end] = [100.0, -100.0].map(|z| (z - origin[2]) / direction[2]);
    let mut last = over(t).0;
    while t < end {
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
