//! Plates: light at edges, walls, floor, shadows; the measures of plates and joints.

use super::{counts, frames};
use crate::optics::{Lens, Vector, along, dot, minus, normalised};
use crate::parts::{Defect, Floor, Hole, Joggle, Joint, Plate};
use crate::{Part, Placement, Scenario, Truth, head};
use hal::head::Head;
use hal::projector::Raster;
use std::f64::consts::PI;

/// Columns and rows of the camera.
pub(super) const SIDE: u32 = 96;

/// A head that sees 40 mm with pixels of 0.41 mm, without noise and ambient light.
pub(super) fn rig() -> Scenario {
    let mut scenario = Scenario {
        bit_depth: 12,
        ..Scenario::default()
    };
    let camera = &mut scenario.rig.camera;
    (camera.width, camera.height) = (SIDE, SIDE);
    camera.fov_deg = [3.8, 3.8];
    scenario.noise.noise_counts = Some(0.0);
    scenario.light.ambient = 0.0;
    scenario
}

/// The frame under white light, counts, and the truth, of a plate or joint.
pub(super) fn seen(scenario: &Scenario, part: Part, placement: Placement) -> (Vec<f64>, Truth) {
    let (mut head, stage) = head(&Scenario {
        part,
        placement,
        ..scenario.clone()
    })
    .unwrap();
    (counts(&frames(&mut head, &[255])[0]), stage.truth())
}

fn light(scenario: &Scenario, plate: &Plate, placement: Placement) -> Vec<f64> {
    seen(scenario, Part::Plate(plate.clone()), placement).0
}

/// Where the ray of camera point (u, v) meets z = `z`.
pub(super) fn on_plane(lens: &Lens, [u, v]: [f64; 2], z: f64) -> Vector {
    let ray = lens.ray(u, v);
    along(lens.centre(), ray, (z - lens.centre()[2]) / ray[2])
}

/// Column and row of each pixel.
pub(super) fn pixels() -> impl Iterator<Item = [f64; 2]> {
    (0..SIDE * SIDE).map(|at| [f64::from(at % SIDE), f64::from(at / SIDE)])
}

/// Area of a pixel on z = 0, mm².
fn area(lens: &Lens, [u, v]: [f64; 2]) -> f64 {
    let corner = |du: f64, dv: f64| on_plane(lens, [u + du, v + dv], 0.0);
    let across = minus(corner(0.5, 0.0), corner(-0.5, 0.0));
    let down = minus(corner(0.0, 0.5), corner(0.0, -0.5));
    (across[0] * down[1] - across[1] * down[0]).abs()
}

/// A thin plate in z = 0 over nothing, with one hole.
pub(super) fn with_hole(x: f64, y: f64, radius: f64) -> Plate {
    Plate {
        holes: vec![Hole { x, y, radius }],
        slots: Vec::new(),
        z: 0.0,
        ..Plate::default()
    }
}

/// Area and centre in z = 0 of what a frame lacks of the light of another.
fn missing(lens: &Lens, frame: &[f64], whole: &[f64]) -> (f64, [f64; 2]) {
    let mut sums = [0.0; 3];
    for ((at, frame), whole) in pixels().zip(frame).zip(whole) {
        let lost = (1.0 - frame / whole) * area(lens, at);
        let [x, y, _] = on_plane(lens, at, 0.0);
        for (sum, value) in sums.iter_mut().zip([1.0, x, y]) {
            *sum += lost * value;
        }
    }
    (sums[0], [sums[1] / sums[0], sums[2] / sums[0]])
}

#[test]
fn a_hole_takes_as_much_light_as_its_area_and_lies_where_its_measures_say() {
    let placement = Placement {
        shift_mm: [0.83, -0.4, 0.0],
        rotation_deg: 11.0,
        ..Placement::default()
    };
    for blur in [0.0, 0.5] {
        let mut scenario = rig();
        scenario.optics.camera_blur_px = blur;
        let lens = scenario.rig.camera.lens();
        let mut plate = with_hole(0.0, 0.0, 3.0);
        plate.defects = vec![Defect::MissingHole { index: 0 }];
        let whole = light(&scenario, &plate, placement);
        for (step, radius) in [2.0, 3.0, 5.0, 5.1].into_iter().enumerate() {
            let (dx, dy) = (0.07 * step as f64, 1.0 - 0.11 * step as f64);
            plate.defects = vec![
                Defect::DisplacedHole { index: 0, dx, dy },
                Defect::HoleRadius { index: 0, radius },
            ];
            let hole = plate.punched()[0].unwrap();
            assert_eq!((hole.x, hole.y, hole.radius), (dx, dy, radius));
            let frame = light(&scenario, &plate, placement);
            let (area, centre) = missing(&lens, &frame, &whole);
            let share = area / (PI * radius * radius);
            assert!((share - 1.0).abs() < 1e-3, "σ {blur}, r {radius}: {share}");
            let expected = placement.to_world([hole.x, hole.y, 0.0]);
            for axis in 0..2 {
                let off = centre[axis] - expected[axis];
                assert!(off.abs() < 3e-3, "σ {blur}, r {radius}: {off} mm off");
            }
        }
    }
}

#[test]
fn an_edge_has_the_profile_of_square_pixels_behind_the_lens() {
    // F = [G(d + a) − G(d − a)] / 2a per axis for an edge along the pixels: G′ = Φ.
    let integral = |d: f64| {
        let below = 0.5 * libm::erfc(-d / std::f64::consts::SQRT_2);
        d * below + (-0.5 * d * d).exp() / std::f64::consts::TAU.sqrt()
    };
    for sigma in [0.3, 0.7] {
        let mut scenario = rig();
        scenario.optics.camera_blur_px = sigma;
        scenario.rig.camera.distortion = [0.0; 5];
        let lens = scenario.rig.camera.lens();
        let mut plate = with_hole(70.0, 40.0, 1.0);
        let whole = light(&scenario, &plate, Placement::default());
        for step in 0..4 {
            // The sides at ± height / 2 are horizontal in the picture, nearly so off its middle.
            plate.height = 10.0 + 0.1 * f64::from(step);
            let frame = light(&scenario, &plate, Placement::default());
            let [_, edge] = lens.project([0.0, plate.height / 2.0, 0.0]).unwrap();
            for row in 0..SIDE / 2 {
                let at = (row * SIDE + SIDE / 2) as usize;
                let d = f64::from(row) - edge;
                let share = sigma * (integral((d + 0.5) / sigma) - integral((d - 0.5) / sigma));
                let off = frame[at] / whole[at] - share;
                assert!(off.abs() < 0.012, "σ {sigma}, row {row}: {off} of {share}");
            }
        }
    }
}

#[test]
fn walls_are_seen_where_both_devices_look_at_them_and_are_as_bright_as_their_angle_says() {
    let scenario = rig();
    let lens = scenario.rig.camera.lens();
    let lamp = scenario.rig.projector.lens().centre();
    let thin = with_hole(0.0, 0.0, 5.0);
    let thick = Plate {
        thickness_mm: 1.0,
        ..thin.clone()
    };
    for degrees in [0.0, -12.0] {
        let placement = Placement {
            tilt_deg: [0.0, degrees],
            ..Placement::default()
        };
        let [frame, bare] = [&thick, &thin].map(|plate| light(&scenario, plate, placement));
        let turned = |v| minus(placement.to_world(v), placement.to_world([0.0; 3]));
        let normal = turned([0.0, 0.0, 1.0]);
        let towards = |device: Vector, point| normalised(minus(device, point));
        let share = |device, point, facing| {
            let towards = towards(device, point);
            (dot(towards, facing) / dot(towards, normal)).max(0.0)
        };
        // In units of the face's light, on the face.
        let face = scenario.light.diffuse * dot(normalised(lamp), normal) * 4095.0;
        let flat = dot(normalised(lens.centre()), normal) / normalised(lens.centre())[2];
        let added = pixels()
            .zip(&frame)
            .zip(&bare)
            .map(|((at, frame), bare)| (frame - bare) / face * area(&lens, at) / flat);
        let found = added.sum::<f64>();
        // The wall in 360 pieces, each 1 mm deep.
        let piece = |degrees: i32| {
            let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
            let point = placement.to_world([5.0 * cos, 5.0 * sin, -0.5]);
            let inwards = turned([-cos, -sin, 0.0]);
            let [eye, lit] = [lens.centre(), lamp].map(|device| share(device, point, inwards));
            5.0 * 1_f64.to_radians() * eye * lit
        };
        let expected = (0..360).map(piece).sum::<f64>();
        assert_eq!(expected > 0.01, degrees < 0.0);
        assert!(
            (found - expected).abs() < 0.02 * expected + 1e-3,
            "tilted by {degrees}°: {found} mm² instead of {expected}"
        );
    }
}

#[test]
fn a_floor_has_its_depth_its_albedo_and_the_light_that_passes_the_hole() {
    let scenario = rig();
    let (eye, lamp) = (scenario.rig.camera.lens(), scenario.rig.projector.lens());
    let plate = Plate {
        floor: Floor {
            depth: 18.0,
            albedo: 0.5,
        },
        ..with_hole(0.0, 0.0, 15.0)
    };
    let part = Part::Plate(plate);
    let (mut head, stage) = head(&Scenario {
        part,
        ..scenario.clone()
    })
    .unwrap();
    let (width, height) = head.projector_size();
    let split = width / 2 + 4;
    let half = (0..width * height).map(|at| if at % width < split { 255 } else { 0 });
    let half = Raster::new(width, height, half.collect()).unwrap();
    let [whole, half] = shown(
        &mut head,
        [Raster::uniform(width, height, 255).unwrap(), half],
    );
    let (mut lit, mut dark) = (0, 0);
    for (at, z) in stage.truth().height.into_iter().enumerate() {
        let pixel = [at as u32 % SIDE, at as u32 / SIDE].map(f64::from);
        let above = on_plane(&eye, pixel, 0.0);
        let point = on_plane(&eye, pixel, -18.0);
        // Where the light to this point passes z = 0.
        let towards = minus(lamp.centre(), point);
        let passes = along(point, towards, 18.0 / towards[2]);
        let outside = [above, passes].map(|[x, y, _]| x.hypot(y) - 15.0);
        if outside[0] > -0.6 || outside[1].abs() < 0.6 {
            continue;
        }
        if outside[1] > 0.0 {
            assert!(z.is_nan() && whole[at] == 0.0, "{pixel:?} is lit");
            dark += 1;
            continue;
        }
        assert!((z + 18.0).abs() < 1e-4, "{pixel:?}: {z}");
        let face = 4095.0 * scenario.light.diffuse * normalised(towards)[2];
        assert!((whole[at] / face - 0.5).abs() < 1e-3, "{pixel:?}");
        let [xi, _] = lamp.project(point).unwrap();
        let off = xi - (f64::from(split) - 0.5);
        if off.abs() > 4.0 {
            assert_eq!(half[at] > 0.0, off < 0.0, "{pixel:?} at ξ = {xi}");
        }
        lit += 1;
    }
    assert!(lit > 1000 && dark > 100, "{lit} lit and {dark} dark");
}

/// A frame of each raster, counts.
fn shown(head: &mut Head, rasters: [Raster; 2]) -> [Vec<f64>; 2] {
    head.load(rasters.into()).unwrap();
    let mut found = [Vec::new(), Vec::new()];
    head.acquire(&[0, 1], super::PATIENT, &mut |at, frame| {
        found[at] = counts(&frame)
    })
    .unwrap();
    found
}

#[test]
fn the_shadow_between_an_edge_and_a_bright_floor_is_as_wide_as_eye_and_light_say() {
    for (depth, blur) in [(0.1, 0.0), (0.3, 0.5), (1.0, 0.0)] {
        let mut scenario = rig();
        scenario.optics.camera_blur_px = blur;
        let (eye, lamp) = (scenario.rig.camera.lens(), scenario.rig.projector.lens());
        let mut plate = with_hole(-40.0, 40.0, 1.0);
        plate.floor = Floor { depth, albedo: 1.0 };
        let whole = light(&scenario, &plate, Placement::default());
        plate.width = 6.0;
        let frame = light(&scenario, &plate, Placement::default());
        // The lines of sight and of light past the edge at x = 3, on the floor.
        let past = |device: &Lens| {
            let [x, _, z] = device.centre();
            3.0 + (3.0 - x) * depth / z
        };
        let width = past(&lamp) - past(&eye);
        // From the middle to the right of the edge, in the rows about the middle.
        let lost = pixels()
            .zip(&frame)
            .zip(&whole)
            .map(|((at, frame), whole)| {
                let inside = (48.0..72.0).contains(&at[0]) && (at[1] - 47.5).abs() < 16.0;
                let span = [-0.5, 0.5].map(|du| on_plane(&eye, [at[0] + du, at[1]], -depth)[0]);
                let lost = (1.0 - frame / whole) * (span[1] - span[0]);
                if inside { lost / 32.0 } else { 0.0 }
            });
        let found = lost.sum::<f64>();
        assert!(
            (found - width).abs() < 0.001 + 0.001 * width,
            "{depth} mm deep: {found} mm instead of {width}"
        );
    }
}

#[test]
fn a_joggle_casts_its_shadow() {
    let scenario = rig();
    let (eye, lamp) = (scenario.rig.camera.lens(), scenario.rig.projector.lens());
    for thickness_mm in [0.0, 1.0, 8.0] {
        let mut plate = with_hole(0.0, 40.0, 1.0);
        plate.thickness_mm = thickness_mm;
        plate.joggle = Some(Joggle {
            x: 2.0,
            drop: 5.0,
            run: 0.0,
        });
        let (_, truth) = seen(&scenario, Part::Plate(plate), Placement::default());
        let (mut upper, mut lower, mut dark) = (0, 0, 0);
        for (at, z) in pixels().zip(truth.height) {
            let [[x, ..], point] = [0.0, -5.0].map(|z| on_plane(&eye, at, z));
            let towards = minus(lamp.centre(), point);
            let passes = along(point, towards, 5.0 / towards[2])[0];
            let expected = match () {
                () if x < 1.99 => (0.0, &mut upper),
                // The upright face looks away from the light.
                () if point[0] < 1.99 || passes < 1.99 => (f32::NAN, &mut dark),
                () if passes > 2.01 => (-5.0, &mut lower),
                () => continue,
            };
            *expected.1 += 1;
            let same = z.is_nan() && expected.0.is_nan() || (z - expected.0).abs() < 1e-4;
            assert!(
                same,
                "{thickness_mm} mm, {at:?}: {z} instead of {}",
                expected.0
            );
        }
        assert!(
            upper.min(lower) > 1000 && dark > 200,
            "{upper} {lower} {dark}"
        );
    }
}

#[test]
fn measures_of_solids_are_read_over_their_defaults_and_refused_by_their_keys() {
    let part = |text: &str| Scenario::from_toml(&format!("[part]\n{text}"), "s.toml");
    let read = part(
        "kind = \"plate\"\nthickness_mm = 1.5\nholes = [{ x = 1.0, y = 2.0, radius = 3.0 }]\n\
         joggle = { drop = -2.0 }\nfloor = { albedo = 1.0 }\n\
         defects = [{ kind = \"displaced_hole\", index = 0, dx = 0.2, dy = 0.0 }]",
    )
    .unwrap();
    let written = toml::to_string(&read).unwrap();
    assert_eq!(Scenario::from_toml(&written, "s.toml").unwrap(), read);
    let Part::Plate(plate) = read.part else {
        panic!("{written}");
    };
    assert_eq!((plate.width, plate.slots.len()), (150.0, 1));
    let joint = part("kind = \"joint\"\nacross = \"y\"\nflush = -0.5").unwrap();
    assert!(matches!(joint.part, Part::Joint(Joint { flush: -0.5, .. })));
    for (text, expected) in [
        ("kind = \"plate\"\nthickness = 1.0", "thickness"),
        (
            "kind = \"plate\"\nthickness_mm = -1.0",
            "part.thickness_mm is -1",
        ),
        ("kind = \"plate\"\nrim_mm = nan", "part.rim_mm is NaN"),
        (
            "kind = \"plate\"\nholes = [{ x = 0.0, y = 0.0, radius = 0.0 }]",
            "part.holes.radius is 0",
        ),
        (
            "kind = \"plate\"\nslots = [{ from = [0.0, 2000.0], to = [0.0, 0.0], half_width = 1.0 }]",
            "part.slots.from is 2000",
        ),
        (
            "kind = \"plate\"\njoggle = { run = -1.0 }",
            "part.joggle.run is -1",
        ),
        (
            "kind = \"plate\"\nthickness_mm = 2.0\njoggle = { drop = 3.0 }\nfloor = { depth = 4.0, albedo = 1.0 }",
            "part.floor.depth is 4.0: write 5.0",
        ),
        (
            "kind = \"plate\"\ndefects = [{ kind = \"hole_radius\", index = 3, radius = 1.0 }]",
            "part.defects.index is 3",
        ),
        (
            "kind = \"plate\"\nholes = []\ndefects = [{ kind = \"missing_hole\", index = 0 }]",
            "the part has no holes",
        ),
        (
            "kind = \"plate\"\ndefects = [{ kind = \"bent_flange\", degrees = 1.0 }]",
            "it has no flange",
        ),
        (
            "kind = \"sheet_metal\"\ndefects = [{ kind = \"hole_radius\", index = 0, radius = 1.0 }]",
            "its holes can be missing",
        ),
        ("kind = \"joint\"\ngap = -1.0", "part.gap is -1"),
        (
            "kind = \"joint\"\nleft_radius = 40.0",
            "part.left_radius is 40",
        ),
        ("kind = \"joint\"\nacross = \"z\"", "expected `x` or `y`"),
        (
            "kind = \"joint\"\nflush = -9.0\nfloor = { depth = 9.0, albedo = 1.0 }",
            "part.floor.depth is 9",
        ),
    ] {
        let message = part(text).unwrap_err().to_string();
        assert!(message.contains(expected), "{text}: {message}");
    }
}
