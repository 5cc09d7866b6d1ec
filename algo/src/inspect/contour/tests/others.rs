//! Slots and straight edges.

use super::placed::sheet;
use super::scene::{Chance, Noise, Rendered, Scene};
use crate::inspect::contour::shape::{Line, Slot};
use crate::inspect::contour::{State, find};
use crate::math::solve::Distance;

const PLACEMENTS: u64 = 4;
/// Of every parameter in mm, and of angles over half a length.
const MOST_UM: f64 = 12.0;

fn placed<'a>(scene: &Scene<'a>, chance: &mut Chance) -> Scene<'a> {
    let mut scene = scene.clone();
    scene.tilt.0 += chance.within(1.0);
    scene.tilt.1 += chance.within(1.0);
    scene
}

#[test]
fn a_slot_has_its_length_width_place_and_direction() {
    for (noise, floor) in [(Noise::Uniform, None), (Noise::Quiet, Some((18.0, 1.0)))] {
        for seed in 0..PLACEMENTS {
            let mut chance = Chance::new(seed);
            let (x, y) = (chance.within(1.0), chance.within(1.0));
            let slot = [x, y, 5.0, 3.0, 0.5 + chance.within(0.02)];
            let opening = move |px: f64, py: f64| Slot.distance(&slot, px, py);
            let mut scene = placed(&sheet(0.41), &mut chance);
            (scene.noise, scene.floor, scene.opening) = (noise, floor, &opening);
            let rendered = Rendered::new(scene, 6.0, seed);
            let expected = [x + 0.2, y - 0.2, 5.05, 2.95, 0.49];
            let capture = rendered.capture(seed);
            let contour = find(&Slot, &expected, &capture, &rendered.setup());
            let p = contour.parameters;
            let off: [f64; 5] = core::array::from_fn(|i| {
                let lever = if i == 4 { slot[2] } else { 1.0 };
                (p[i] - slot[i]) * lever * 1e3
            });
            let (found, blur) = (contour.found, contour.blur);
            std::println!("slot: off {off:.1?} µm, rim {found:.2}, blur {blur:.2}");
            assert_eq!(contour.state, State::Found, "{contour:?}");
            assert!(off.iter().all(|off| off.abs() < MOST_UM), "{off:?}");
        }
    }
}

#[test]
fn a_straight_edge_has_its_place_and_direction_and_material_on_its_left() {
    for angle in [0.0, 0.3, 1.6, -2.5] {
        for noise in [Noise::Uniform, Noise::Quiet] {
            let seed = 7;
            let mut chance = Chance::new(seed);
            let (sin, cos) = (libm::sin(angle), libm::cos(angle));
            let ends = [(-10.0 * cos, -10.0 * sin), (10.0 * cos, 10.0 * sin)];
            let line = Line::of(&ends).unwrap();
            let is = [chance.within(0.3), chance.within(0.01)];
            let opening = move |px: f64, py: f64| line.distance(&is, px, py);
            let mut scene = placed(&sheet(0.41), &mut chance);
            (scene.noise, scene.opening) = (noise, &opening);
            let rendered = Rendered::new(scene, 6.0, seed);
            let capture = rendered.capture(seed);
            let contour = find(&line, &[0.0; 2], &capture, &rendered.setup());
            let p = contour.parameters;
            let off = [(p[0] - is[0]) * 1e3, (p[1] - is[1]) * 10e3];
            let sigma = libm::sqrt(contour.covariance[0][0]) * 1e3;
            std::println!(
                "line {angle}: off {off:.1?} µm, σ {sigma:.1}, {:.2}",
                contour.blur
            );
            assert_eq!(contour.state, State::Found, "{contour:?}");
            assert!(off.iter().all(|off| off.abs() < MOST_UM), "{off:?}");
        }
    }
}
