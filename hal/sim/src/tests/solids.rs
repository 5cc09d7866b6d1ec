//! Plates and joints: light at edges, shadows, walls, floor, and the measures that they state.

use super::{counts, frames};
use crate::optics::{Lens, Vector, along, dot, minus, normalised};
use crate::parts::{Defect, Floor, Hole, Joint, Plate};
use crate::{Part, Placement, Scenario, head};

/// A head that sees 256 × 256 pixels of 0.4 mm, without noise and ambient light.
fn rig() -> Scenario {
    let mut scenario = Scenario {
        bit_depth: 12,
        ..Scenario::default()
    };
    let camera = &mut scenario.rig.camera;
    (camera.width, camera.height) = (256, 256);
    camera.fov_deg = [10.0, 10.0];
    scenario.noise.noise_counts = Some(0.0);
    scenario.light.ambient = 0.0;
    scenario
}

/// The frame of a part under white light, counts.
fn seen(scenario: &Scenario, part: Part) -> Vec<f64> {
    let (mut head, _) = head(&Scenario {
        part,
        ..scenario.clone()
    })
    .unwrap();
    counts(&frames(&mut head, &[255])[0])
}

/// Where the ray of camera point (u, v) meets z = `z`.
fn on_plane(lens: &Lens, [u, v]: [f64; 2], z: f64) -> Vector {
    let ray = lens.ray(u, v);
    along(lens.centre(), ray, (z - lens.centre()[2]) / ray[2])
}

/// Area of the pixels on z = `z`, mm².
fn pixel_areas(scenario: &Scenario, z: f64) -> Vec<f64> {
    let lens = scenario.rig.camera.lens();
    let side = scenario.rig.camera.width;
    let area = |at: u32| {
        let (u, v) = (f64::from(at % side), f64::from(at / side));
        let corner = |du: f64, dv: f64| on_plane(&lens, [u + du, v + dv], z);
        let across = minus(corner(0.5, 0.0), corner(-0.5, 0.0));
        let down = minus(corner(0.0, 0.5), corner(0.0, -0.5));
        (across[0] * down[1] - across[1] * down[0]).abs()
    };
    (0..side * scenario.rig.camera.height).map(area).collect()
}

/// A thin plate over nothing with one hole.
fn with_hole(x: f64, y: f64, radius: f64) -> Plate {
    Plate {
        holes: vec![Hole { x, y, radius }],
        slots: Vec::new(),
        z: 0.0,
        ..Plate::default()
    }
}

#[test]
fn a_hole_takes_as_much_light_as_its_area() {
    for blur in [0.0, 0.5] {
        let mut scenario = rig();
        scenario.optics.camera_blur_px = blur;
        let areas = pixel_areas(&scenario, 0.0);
        for (step, radius) in [2.0, 3.0, 5.0, 5.1].into_iter().enumerate() {
            let off = 0.07 * step as f64;
            let holed = with_hole(off, 1.0 - off, radius);
            let mut whole = holed.clone();
            whole.defects = vec![Defect::MissingHole { index: 0 }];
            let whole = seen(&scenario, Part::Plate(whole));
            let holed = seen(&scenario, Part::Plate(holed));
            let lost = holed.iter().zip(&whole).zip(&areas);
            let area: f64 = lost
                .map(|((holed, whole), area)| (1.0 - holed / whole) * area)
                .sum();
            let share = area / (std::f64::consts::PI * radius * radius);
            println!("σ {blur}, r {radius}: {}", share - 1.0);
            assert!((share - 1.0).abs() < 1e-3, "σ {blur}, r {radius}: {share}");
        }
    }
}
