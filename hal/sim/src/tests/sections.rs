//! Sections of joints, rims and dents have the measures that they state.

use super::solids::{SIDE, on_plane, pixels, rig, seen, with_hole};
use crate::parts::{Across, Defect, Joint};
use crate::{Part, Placement};

/// Where points are (s, z), the middle and direction of the line through them.
fn line(points: &[[f64; 2]]) -> ([f64; 2], [f64; 2]) {
    let mean = |axis: usize| points.iter().map(|p| p[axis]).sum::<f64>() / points.len() as f64;
    let middle = [mean(0), mean(1)];
    let sum = |of: fn([f64; 2]) -> f64| {
        let off = points.iter().map(|p| [p[0] - middle[0], p[1] - middle[1]]);
        off.map(of).sum::<f64>()
    };
    let angle = (sum(|[s, z]| s * z) / sum(|[s, _]| s * s)).atan();
    (middle, [angle.cos(), angle.sin()])
}

/// Centre and radius of the circle through three points.
fn circle([a, b, c]: [[f64; 2]; 3]) -> ([f64; 2], f64) {
    let [b, c] = [b, c].map(|p| [p[0] - a[0], p[1] - a[1]]);
    let twice = 2.0 * (b[0] * c[1] - b[1] * c[0]);
    let [bb, cc] = [b, c].map(|p| p[0] * p[0] + p[1] * p[1]);
    let s = (c[1] * bb - b[1] * cc) / twice;
    let z = (b[0] * cc - c[0] * bb) / twice;
    ([a[0] + s, a[1] + z], s.hypot(z))
}

#[test]
fn a_joints_section_has_its_gap_and_flush() {
    let scenario = rig();
    let eye = scenario.rig.camera.lens();
    for (across, [gap, flush, tilt_deg]) in [
        (Across::X, [2.0, 0.0, 0.0]),
        (Across::X, [3.2, 0.7, 6.0]),
        (Across::Y, [2.5, -0.6, -4.0]),
    ] {
        let joint = Joint {
            across,
            gap,
            flush,
            tilt_deg,
            left_radius: 2.5,
            right_radius: 4.0,
            z: 0.0,
            ..Joint::default()
        };
        let (_, truth) = seen(&scenario, Part::Joint(joint), Placement::default());
        // Points (s, z) of the pixels in the middle row or column, from left to right.
        let section = (0..SIDE).filter_map(|step| {
            let [u, v] = match across {
                Across::X => [step, SIDE / 2],
                Across::Y => [SIDE / 2, SIDE - 1 - step],
            };
            let z = f64::from(truth.height[(v * SIDE + u) as usize]);
            let point = on_plane(&eye, [u, v].map(f64::from), z);
            let s = match across {
                Across::X => point[0],
                Across::Y => point[1],
            };
            (!z.is_nan()).then_some([s, z])
        });
        let (left, mut right): (Vec<_>, Vec<_>) = section.partition(|[s, _]| *s < 0.0);
        right.reverse();
        // Each from its far end to the joint.
        let sides = [left, right].map(|points| {
            let flat = line(&points[..20]);
            let ([s, z], [along, up]) = flat;
            let edge: Vec<_> = points
                .iter()
                .filter(|p| (p[1] - z) * along - (p[0] - s) * up < -0.02)
                .collect();
            let last = edge.len() - 1;
            let arc = circle([*edge[0], *edge[last / 2], *edge[last - 1]]);
            (flat, arc)
        });
        let [(base, (from, from_radius)), (side, (to, to_radius))] = sides;
        let mean = [base.1[0] + side.1[0], base.1[1] + side.1[1]];
        let length = mean[0].hypot(mean[1]);
        let off = [to[0] - from[0], to[1] - from[1]];
        let apart = (off[0] * mean[0] + off[1] * mean[1]) / length;
        let tangent = [to[0] - to_radius * side.1[1], to[1] + to_radius * side.1[0]];
        let above = (tangent[1] - base.0[1]) * base.1[0] - (tangent[0] - base.0[0]) * base.1[1];
        for (name, found, expected) in [
            ("gap", apart - from_radius - to_radius, gap),
            ("flush", above, flush),
            ("left radius", from_radius, 2.5),
            ("right radius", to_radius, 4.0),
        ] {
            assert!(
                (found - expected).abs() < 2e-3,
                "{across:?} {name}: {found} instead of {expected}"
            );
        }
    }
}

#[test]
fn rims_are_quarter_circles_and_dents_as_deep_as_they_say() {
    let scenario = rig();
    let eye = scenario.rig.camera.lens();
    let mut plate = with_hole(-6.0, 0.0, 4.0);
    plate.rim_mm = 2.5;
    plate.defects = vec![Defect::Dent {
        x: 9.0,
        y: 1.0,
        depth_mm: 0.7,
        diameter_mm: 12.0,
    }];
    let (_, truth) = seen(&scenario, Part::Plate(plate), Placement::default());
    let (mut rim, mut dent) = (0, 0);
    for (at, z) in pixels().zip(truth.height) {
        let [x, y, _] = on_plane(&eye, at, f64::from(z));
        let beside = 4.0 + 2.5 - (x + 6.0).hypot(y);
        let off = (x - 9.0).hypot(y - 1.0) / 6.0;
        let expected = if z.is_nan() {
            continue;
        } else if beside > 0.0 {
            rim += 1;
            (2.5_f64 * 2.5 - beside * beside).sqrt() - 2.5
        } else if off < 1.0 {
            dent += 1;
            -0.7 * (std::f64::consts::FRAC_PI_2 * off).cos().powi(2)
        } else {
            0.0
        };
        // The steepest places of the rim double an error of the ray.
        let off = f64::from(z) - expected;
        assert!(off.abs() < 2e-4, "{at:?}: {z} instead of {expected}");
    }
    assert!(rim > 200 && dent > 500, "{rim} and {dent} pixels");
}
