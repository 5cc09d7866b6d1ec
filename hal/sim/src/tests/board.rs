//! The board: what its squares reflect, its shape, and whether both devices see all of it in every
//! recommended pose.

use super::{counts, frames, small};
use crate::optics::Lens;
use crate::parts::{Board, Part};
use crate::scenario::Rig;
use crate::{Placement, Scenario, head};

/// Devices see the outer squares at least this far inside the picture, px.
const MARGIN_PX: f64 = 8.0;

#[test]
fn both_devices_see_all_squares_in_every_recommended_pose() {
    let rig = Rig::default();
    for (at, pose) in Board::POSES.iter().enumerate() {
        for device in [&rig.camera, &rig.projector] {
            let lens = Lens::new(device.model());
            for corner in [
                [-50.0, -70.0, 0.0],
                [50.0, -70.0, 0.0],
                [-50.0, 70.0, 0.0],
                [50.0, 70.0, 0.0],
            ] {
                let world = pose.to_world(corner);
                let [u, v] = lens.project(world).unwrap();
                let inside = |at: f64, pixels: u32| {
                    (MARGIN_PX..f64::from(pixels) - 1.0 - MARGIN_PX).contains(&at)
                };
                assert!(
                    inside(u, device.width) && inside(v, device.height),
                    "pose {}: {corner:?} is seen at {u:.0}, {v:.0}",
                    at + 1
                );
            }
        }
    }
    assert_eq!(Board::POSES[9], Placement::default());
}

#[test]
fn black_squares_reflect_less_of_all_light() {
    let mut scenario = small(Part::Board(Board::default()));
    scenario.noise.noise_counts = Some(0.0);
    (scenario.rig.camera.width, scenario.rig.camera.height) = (256, 256);
    let (mut head, _) = head(&scenario).unwrap();
    let seen = frames(&mut head, &[0, 255]);
    let lens = Lens::new(scenario.rig.camera.model());
    for (frame, white) in seen
        .iter()
        .zip([0.04, 0.04 + 0.86 * 7.0_f64.to_radians().cos()])
    {
        let counts = counts(frame);
        let at = |x: f64, y: f64| {
            let [u, v] = lens.project([x, y, 0.0]).unwrap();
            counts[v.round() as usize * 256 + u.round() as usize] / 255.0
        };
        // The corner in the middle of 9 × 13 is at the origin.
        for (x, y, albedo) in [
            (5.0, 5.0, 1.0),
            (-5.0, 5.0, 0.08),
            (-5.0, -5.0, 1.0),
            (35.0, -15.0, 0.08),
            (0.0, 75.0, 1.0),
        ] {
            let (found, expected) = (at(x, y), albedo * white);
            assert!(
                (found - expected).abs() < 0.01,
                "{x}, {y}: {found} instead of {expected}"
            );
        }
    }
}

#[test]
fn a_bowed_board_is_high_in_its_middle_and_a_large_one_has_larger_squares() {
    let board = Board {
        bow_um: 300.0,
        scale_ppm: 1e4,
        ..Board::default()
    };
    let part = Part::Board(board);
    part.check().unwrap();
    let surface = part.surface().unwrap();
    let bow = surface.height(0.0, 0.0) - surface.height(40.4, 60.6);
    assert!((bow - 0.3).abs() < 1e-9, "{bow}");
    for at in [0.0, 10.1, 40.4] {
        let across = surface.albedo(at - 0.02, 5.0) - surface.albedo(at + 0.02, 5.0);
        assert!(across.abs() > 0.1, "no edge at {at}");
        assert!((surface.albedo(at, 5.0) - 0.54).abs() < 1e-9);
    }
    let board = |change: fn(&mut Board)| {
        let mut board = Board::default();
        change(&mut board);
        Scenario {
            part: Part::Board(board),
            ..Scenario::default()
        }
        .check()
    };
    for (wrong, key) in [
        (board(|board| board.columns = 1), "part.columns"),
        (board(|board| board.square_mm = 0.0), "part.square_mm"),
        (board(|board| board.bow_um = f64::NAN), "part.bow_um"),
        (board(|board| board.scale_ppm = -1e6), "part.scale_ppm"),
    ] {
        assert!(wrong.unwrap_err().to_string().contains(key), "{key}");
    }
}
