//! What is found, and why a section has no value.

use super::joint::{Chance, Joint};
use crate::inspect::section::{Section, SectionPoint, Side, Unseen, Why};
use std::format;
use std::vec::Vec;

fn joint() -> (Joint, Vec<SectionPoint>) {
    let mut joint = Joint::draw(0.145, &mut Chance::new(2));
    (joint.radii, joint.rises) = ([1.5; 2], [0.0; 2]);
    let points = joint.rendered().capture(1, 1.0);
    (joint, points)
}

fn find(joint: &Joint, points: &[SectionPoint]) -> Result<Section, Unseen> {
    Section::new(points, &joint.request(), &joint.optics())
}

#[test]
fn a_side_that_is_missing_is_named() {
    let (joint, points) = joint();
    for (side, sign) in [(Side::Left, 1.0), (Side::Right, -1.0)] {
        let half: Vec<_> = points
            .iter()
            .copied()
            .filter(|point| sign * point.s > 0.0)
            .collect();
        let unseen = find(&joint, &half).unwrap_err();
        assert_eq!(unseen.side, side);
        assert!(
            matches!(unseen.why, Why::FewPoints { has: 0, .. }),
            "{unseen}"
        );
        assert!(format!("{unseen}").contains(&format!("{side}")));
    }
}

#[test]
fn an_edge_that_is_seen_too_little_of_needs_its_radius() {
    let (joint, points) = joint();
    let extreme = joint.place - joint.gap / 2.0;
    // 22° of the left edge.
    let end = extreme - joint.radii[0] * (1.0 - 22_f64.to_radians().sin());
    let short: Vec<_> = points
        .into_iter()
        .filter(|point| point.s < end || point.s > extreme + 0.5)
        .collect();
    let unseen = find(&joint, &short).unwrap_err();
    assert_eq!(unseen.side, Side::Left);
    assert!(
        format!("{unseen}").contains("left edge") && format!("{unseen}").ends_with("state edge_mm"),
        "{unseen}"
    );
    let mut request = joint.request();
    request.edge_mm = [Some(joint.radii[0]), None];
    let section = Section::new(&short, &request, &joint.optics()).unwrap();
    let [left, right] = section.edges.map(|edge| edge.is_stated);
    assert!(left && !right);
    let geometry = section.geometry(&section.parameters());
    assert!(
        (geometry.left.extreme.0 - extreme).abs() < 0.05,
        "{geometry:?}"
    );
}

#[test]
fn a_stated_radius_is_taken_however_much_of_the_edge_is_seen() {
    let (joint, points) = joint();
    let mut request = joint.request();
    // As far off as a caller may be who states it for another part.
    let stated = 1.03 * joint.radii[0];
    request.edge_mm = [Some(stated), None];
    let section = Section::new(&points, &request, &joint.optics()).unwrap();
    let [left, right] = section.edges;
    assert!(left.is_stated && !right.is_stated);
    assert_eq!(left.parameters[3], stated);
    assert_eq!(left.covariance[3], [0.0; 4]);
    let free = find(&joint, &points).unwrap().edges;
    assert!((free[0].parameters[3] - joint.radii[0]).abs() < 0.02);
    assert_eq!(free[1], right);
}

/// How far the slopes of an edge's parameters may be from those of fixed weights, which move with
/// the circle.
const FOLLOWS: f64 = 0.25;

/// C_pL = ∂p/∂L C_L, so a stretch whose heights are lifted shows whether it is true.
#[test]
fn an_edge_follows_its_line_as_the_covariance_says() {
    let (joint, points) = joint();
    let lifted = |lift: f64, tilt: f64| {
        let mut points = points.clone();
        for point in points.iter_mut().filter(|point| point.s < -6.0) {
            point.z += lift + tilt * (point.s + 10.75);
        }
        find(&joint, &points).unwrap().edges[0]
    };
    let edge = lifted(0.0, 0.0);
    let c = edge.covariance;
    let determinant = c[0][0] * c[1][1] - c[0][1] * c[1][0];
    for (i, lift, tilt) in [(0, 5e-4, 0.0), (1, 0.0, 5e-5)] {
        let [more, less] = [1.0, -1.0].map(|sign| lifted(sign * lift, sign * tilt).parameters);
        for k in [2, 3] {
            let found = (more[k] - less[k]) / (2.0 * (lift + tilt));
            let says = (c[k][i] * c[1 - i][1 - i] - c[k][1 - i] * c[0][1]) / determinant;
            assert!(
                (found - says).abs() < FOLLOWS * says.abs(),
                "{i} {k}: {found} {says}"
            );
        }
    }
}

#[test]
fn a_stretch_that_reaches_over_the_edge_is_not_flat() {
    let (joint, points) = joint();
    let mut request = joint.request();
    request.left = [-6.0, joint.place - joint.gap / 2.0 - 0.3];
    let unseen = Section::new(&points, &request, &joint.optics()).unwrap_err();
    assert!(matches!(unseen.why, Why::NotFlat { .. }), "{unseen}");
}

#[test]
fn a_sheet_that_goes_on_has_no_edge() {
    let (joint, points) = joint();
    let flat: Vec<_> = points
        .into_iter()
        .map(|point| SectionPoint {
            z: 0.01 * point.variance,
            ..point
        })
        .collect();
    let unseen = find(&joint, &flat).unwrap_err();
    assert_eq!(unseen.why, Why::Edgeless);
}

#[test]
fn the_order_of_points_hardly_matters_and_absurd_ones_do_not_count() {
    let (joint, mut points) = joint();
    let before = find(&joint, &points).unwrap().parameters();
    points.reverse();
    let absurd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
    for bad in absurd {
        points.push(SectionPoint {
            s: bad,
            z: 0.0,
            variance: 1.0,
        });
        points.push(SectionPoint {
            s: -10.0,
            z: bad,
            variance: 1.0,
        });
        points.push(SectionPoint {
            s: -10.0,
            z: 0.0,
            variance: bad,
        });
        points.push(SectionPoint {
            s: 0.0,
            z: bad,
            variance: -1.0,
        });
    }
    let after = find(&joint, &points).unwrap().parameters();
    for (before, after) in before.into_iter().zip(after) {
        assert!((before - after).abs() < 1e-5, "{before} {after}");
    }
}

#[test]
fn absurd_requests_and_optics_are_refused_or_measured_and_never_panic() {
    let (joint, points) = joint();
    let values = [f64::NAN, f64::INFINITY, -1.0, 0.0, 1e-300, 1e300];
    for bad in values {
        let mut request = joint.request();
        request.right[1] = bad;
        let unseen = Section::new(&points, &request, &joint.optics()).map(|_| ());
        assert!(
            bad == 1e300
                || matches!(
                    unseen,
                    Err(Unseen {
                        side: Side::Right,
                        why: Why::Order
                    })
                )
        );
        for which in 0..3 {
            let mut optics = joint.optics();
            *[&mut optics.blur, &mut optics.sight, &mut optics.light][which] = bad;
            let _ = Section::new(&points, &joint.request(), &optics);
        }
        let mut request = joint.request();
        request.edge_mm[1] = Some(bad);
        let _ = Section::new(&points, &request, &joint.optics());
        let _ = Section::new(&[], &request, &joint.optics());
    }
}
