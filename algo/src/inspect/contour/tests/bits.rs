//! One bit pattern: what is found does not depend on the machine.

use super::placed::sheet;
use super::scene::{Noise, Rendered, Scene};
use crate::inspect::contour::shape::Outline;
use crate::inspect::contour::shape::circle::Circle;
use crate::inspect::contour::shape::slot::Slot;
use crate::inspect::contour::{State, find, inputs};

/// FNV-1a over the bits of everything that a reading is made of, of a contour in a tilted sheet of
/// unknown thickness over a lit floor.
fn bits(is: &Outline) -> u64 {
    let (shape, p) = (&*is.shape, &is.parameters);
    let opening = |x: f64, y: f64| shape.distance(p, x, y);
    let scene = Scene {
        opening: &opening,
        thickness: 1.0,
        floor: Some((18.0, 1.0)),
        ambient: 0.2,
        blur: 0.5,
        tilt: (12.0, 1.0),
        noise: Noise::Uniform,
        ..sheet(0.41)
    };
    let rendered = Rendered::new(scene, 6.0, 1);
    let mut setup = rendered.setup();
    setup.thickness = None;
    let contour = find(shape, p, &rendered.capture(1), &setup);
    assert_eq!(contour.state, State::Found);
    let found = contour.parameters.into_iter();
    let covariance = contour.covariance.into_iter().flatten();
    let inputs = inputs(shape, &contour, &setup, 0.1);
    let inputs = inputs.iter().flat_map(|input| input.off);
    let all = found.chain(covariance).chain(contour.wall.unwrap());
    all.chain(inputs)
        .fold(0xcbf2_9ce4_8422_2325, |hash, value| {
            let bytes = value.to_bits().to_le_bytes();
            bytes.iter().fold(hash, |hash: u64, &byte| {
                (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3)
            })
        })
}

/// `.ci/run` tests this on aarch64 too. After a change that is meant to change readings, the bits
/// that the message says are the new ones.
#[test]
fn every_machine_finds_the_same_bits() {
    let found = [
        bits(&Outline::new(Circle, &[0.2, -0.1, 6.0])),
        bits(&Outline::new(Slot, &[0.2, -0.1, 5.0, 3.0, 0.5])),
    ];
    assert_eq!(
        found,
        [0x794a_77fc_2010_08e8, 0x82f3_52eb_ade4_a2ca],
        "{found:#x?}"
    );
}
