//! Shiny parts in front of the simulated head, compared with the textbook's own rendering of some
//! of them.

use crate::every_part::{Line, stock};
use crate::placement::{bed, taught_within};
use appliance::station::Verdict;
use hal::frame::Samples;
use hal::projector::Raster;
use sim::parts::{Sawtooth, Sphere, Tube};
use sim::{Material, Part, Placement, Scenario, head};
use std::time::Duration;
use tests::oracle::Device;
use tests::oracle::light::{Body, Face, Phong};
use tests::random::Random;

const TIMEOUT: Duration = Duration::from_secs(2);
/// Pixels each way, and rays of a pixel each way.
const SIZE: u32 = 96;
const SUB_RAYS: u32 = 4;
/// Small enough that the brightest highlight does not clip.
const GAIN: f64 = 0.4;
const FULL_SCALE: f64 = 4095.0;
/// Rounding of a sample, and of up to 100 weights of 1/65535 of diffuse + specular ≤ 2.25, each by
/// a half: 0.5 + 0.4 · 4095 · 100 · 1.7e-5 if all of them were off to the same side.
const TOLERANCE_COUNTS: f64 = 0.5 + 2.8;
const GREYS: [u8; 3] = [0, 128, 255];

/// A part, the body that its surface is a piece of, and how far along x and y of the part this
/// piece goes.
fn bodies() -> [(Part, Placement, Body, f64); 2] {
    let shift_mm = [6.0, -4.0, 3.0];
    let ball = Sphere::default();
    let of_ball = Body {
        centre: [6.0, -4.0, ball.centre_z + 3.0],
        radius: ball.radius,
        axis: None,
    };
    let tube = Tube::default();
    let turned = 25.0_f64;
    let of_tube = Body {
        centre: [6.0, -4.0, tube.centre_z + 3.0],
        radius: tube.diameter / 2.0,
        axis: Some([-turned.to_radians().sin(), turned.to_radians().cos(), 0.0]),
    };
    let lies = |rotation_deg| Placement {
        shift_mm,
        rotation_deg,
        ..Placement::default()
    };
    [
        (Part::Sphere(ball), lies(0.0), of_ball, 80.0),
        (Part::Tube(tube), lies(turned), of_tube, 40.0),
    ]
}

/// The samples of one frame for each grey, shown uniformly.
fn samples(scenario: &Scenario) -> Vec<Vec<f64>> {
    let (mut head, _) = head(scenario).unwrap();
    let (width, height) = head.projector_size();
    let rasters = GREYS.map(|grey| Raster::uniform(width, height, grey).unwrap());
    head.load(rasters.to_vec()).unwrap();
    let mut frames = Vec::new();
    head.acquire(&[0, 1, 2], Duration::from_secs(1), &mut |_, frame| {
        let Samples::Sixteen(samples) = frame.samples() else {
            panic!("not 12 bit");
        };
        frames.push(samples.iter().map(|sample| f64::from(*sample)).collect());
    })
    .unwrap();
    frames
}

/// Compares a rendered part with the textbook; returns how many pixels, and the brightest light and
/// highlight in units of full scale.
fn compare(scenario: &Scenario, phong: &Phong, body: &Body, reach: f64) -> (usize, f64, f64) {
    let camera = Device::new(&scenario.rig.camera.model());
    let lamp = Device::new(&scenario.rig.projector.model());
    let frames = samples(scenario);
    let (mut compared, mut brightest, mut highlight) = (0, 0.0_f64, 0.0_f64);
    for at in 0..SIZE * SIZE {
        let (u, v) = (f64::from(at % SIZE), f64::from(at / SIZE));
        let offset = |i: u32| (f64::from(i) + 0.5) / f64::from(SUB_RAYS) - 0.5;
        let spots: Option<Vec<_>> = (0..SUB_RAYS * SUB_RAYS)
            .map(|sub| {
                let place = (u + offset(sub % SUB_RAYS), v + offset(sub / SUB_RAYS));
                let spot = body.lit(phong, &camera, &lamp, place)?;
                let off = (spot.at[0] - body.centre[0]).hypot(spot.at[1] - body.centre[1]);
                // Away from the part's edges.
                (off < reach && spot.normal[2] > 0.55).then_some(spot)
            })
            .collect();
        let Some(spots) = spots else {
            continue;
        };
        let mean = |k: usize| {
            let sum: f64 = spots.iter().map(|spot| spot.light[k]).sum();
            sum / spots.len() as f64
        };
        let [ambient, diffuse, mirrored] = [0, 1, 2].map(mean);
        for (grey, frame) in GREYS.iter().zip(&frames) {
            let light = ambient + f64::from(*grey) / 255.0 * (diffuse + mirrored);
            let expected = (scenario.optics.gain * light).min(1.0) * FULL_SCALE;
            let found = frame[at as usize];
            assert!(
                (found - expected).abs() <= TOLERANCE_COUNTS,
                "{found} instead of {expected:.2} at ({u}, {v}), grey {grey}: {scenario:?}"
            );
        }
        brightest = brightest.max(ambient + diffuse + mirrored);
        highlight = highlight.max(mirrored);
        compared += 1;
    }
    (compared, brightest, highlight)
}

fn scenario(part: &Part, placement: &Placement) -> Scenario {
    let mut scenario = Scenario {
        part: part.clone(),
        placement: *placement,
        sub_rays: SUB_RAYS,
        bit_depth: 12,
        ..Scenario::default()
    };
    (scenario.rig.camera.width, scenario.rig.camera.height) = (SIZE, SIZE);
    scenario.noise.noise_counts = Some(0.0);
    scenario.optics.gain = GAIN;
    scenario
}

#[test]
fn spheres_and_tubes_of_every_material_are_as_bright_as_the_textbook_says() {
    for (part, placement, body, reach) in bodies() {
        for (material, [diffuse, specular, shininess]) in [
            (Material::Matte, [0.86, 0.0, 1.0]),
            (Material::RolledSteel, [0.35, 0.8, 30.0]),
            (Material::Oiled, [0.25, 2.0, 80.0]),
        ] {
            let scenario = Scenario {
                material: Some(material),
                ..scenario(&part, &placement)
            };
            let phong = Phong {
                ambient: 0.04,
                diffuse,
                specular,
                shininess,
            };
            let (compared, brightest, highlight) = compare(&scenario, &phong, &body, reach);
            println!(
                "{material:?}: {compared} pixels, up to {brightest:.3}, of it mirrored {highlight:.3}"
            );
            assert!(compared > 500, "{compared} pixels");
            // The highlight lies on both bodies, so that the middle of it is compared.
            assert!(highlight > 0.9 * specular || specular == 0.0, "{highlight}");
        }
    }
}

#[test]
fn a_highlight_of_four_times_full_scale_is_not_cut_off_before_the_camera_clips_it() {
    let [(part, placement, body, reach), _] = bodies();
    let mut scenario = scenario(&part, &placement);
    (scenario.light.specular, scenario.light.shininess) = (4.0, 500.0);
    scenario.optics.gain = 0.2;
    let phong = Phong {
        ambient: 0.04,
        diffuse: 0.86,
        specular: 4.0,
        shininess: 500.0,
    };
    let (_, brightest, _) = compare(&scenario, &phong, &body, reach);
    assert!(brightest > 4.0, "{brightest}");
    scenario.optics.gain = 1.0;
    compare(&scenario, &phong, &body, reach);
    let clipped = samples(&scenario)[2]
        .iter()
        .filter(|count| **count == FULL_SCALE)
        .count();
    assert!(clipped > 5, "{clipped} pixels at full scale");
}

#[test]
fn a_matte_part_has_the_light_that_a_part_without_a_material_has_by_default() {
    let [(part, placement, ..), _] = bodies();
    let plain = scenario(&part, &placement);
    let matte = Scenario {
        material: Some(Material::Matte),
        ..plain.clone()
    };
    assert_eq!(samples(&plain), samples(&matte));
    // A material overrides what the light says of the part, but not the ambient light.
    let mut other = matte.clone();
    (other.light.diffuse, other.light.specular) = (0.1, 1.0);
    assert_eq!(samples(&other), samples(&matte));
    other.light.ambient = 0.1;
    assert_ne!(samples(&other), samples(&matte));
}

/// The flank of a valley that faces right, and the one that faces left.
fn flanks(part: &Sawtooth, valley: f64) -> [Face; 2] {
    let (rise, fall) = (part.rise * part.period, (1.0 - part.rise) * part.period);
    let height = part.hi - part.lo;
    let (corner, along) = (
        [valley, -part.half_size, part.lo],
        [0.0, 2.0 * part.half_size, 0.0],
    );
    [
        Face {
            corner,
            sides: [along, [-fall, 0.0, height]],
        },
        Face {
            corner,
            sides: [[rise, 0.0, height], along],
        },
    ]
}

#[test]
fn light_by_way_of_another_face_is_what_the_integral_over_that_face_says() {
    let part = Sawtooth::default();
    for (material, [diffuse, specular, shininess]) in [
        (Material::Matte, [0.86, 0.0, 1.0]),
        (Material::RolledSteel, [0.35, 0.8, 30.0]),
        (Material::Oiled, [0.25, 2.0, 80.0]),
    ] {
        let mut scenario = scenario(&Part::Sawtooth(part.clone()), &Placement::default());
        (scenario.material, scenario.sub_rays) = (Some(material), 1);
        scenario.optics.projector_blur_px = 0.0;
        let direct = samples(&scenario);
        scenario.bounces = 1;
        let both = samples(&scenario);
        // A pattern of no light has none by any way.
        assert_eq!(direct[0], both[0]);
        let phong = Phong {
            ambient: 0.04,
            diffuse,
            specular,
            shininess,
        };
        let camera = Device::new(&scenario.rig.camera.model());
        let lamp = Device::new(&scenario.rig.projector.model());
        let (mut compared, mut most) = (0, 0.0_f64);
        for at in (0..SIZE * SIZE).step_by(29) {
            let (u, v) = (f64::from(at % SIZE), f64::from(at / SIZE));
            let (eye, ray) = (camera.centre(), camera.ray(u, v));
            // Where the ray crosses a flank of one of the valleys, first of all.
            let mut seen: Option<(f64, [f64; 3], [f64; 3], Face)> = None;
            for valley in [-60.0, -20.0, 20.0] {
                let [right, left] = flanks(&part, valley);
                for (own, other) in [(right, left), (left, right)] {
                    let Some((t, place, normal)) = own.crossed(eye, ray) else {
                        continue;
                    };
                    if seen.is_none_or(|(before, ..)| t < before) {
                        seen = Some((t, place, normal, other));
                    }
                }
            }
            let Some((_, place, normal, other)) = seen else {
                continue;
            };
            // Away from the ends of the flanks, where the light of other valleys is seen.
            let height = (place[2] - part.lo) / (part.hi - part.lo);
            if !(0.1..0.9).contains(&height) || place[1].abs() > 60.0 {
                continue;
            }
            let expected = phong.by_way_of((place, normal), (eye, lamp.centre()), &other, 400);
            let found = (both[2][at as usize] - direct[2][at as usize]) / FULL_SCALE / GAIN;
            if both[2][at as usize] < FULL_SCALE {
                let off = (found - expected) * 255.0;
                assert!(
                    off.abs() < 1.0,
                    "{material:?} ({u}, {v}): {found:.4}, not {expected:.4}"
                );
                compared += 1;
                most = most.max(expected);
            }
        }
        println!(
            "{material:?}: {compared} pixels, up to {:.1} counts by another way",
            most * 255.0
        );
        assert!(compared > 50 && most * 255.0 > 5.0);
    }
}

#[test]
fn a_highlight_is_not_taught_as_an_opening_and_hides_none() {
    let openings = |material| {
        let mut bed = bed(&Scenario {
            sub_rays: 2,
            material: Some(material),
            ..Scenario::default()
        });
        let manifest = taught_within(&mut bed, 1.0).unwrap().manifest;
        let gauges = manifest.gauges.iter().map(|gauge| &gauge.name);
        assert!(gauges.eq(manifest.tried.iter().map(|tried| &tried.gauge)));
        let features = manifest.features.into_iter();
        let openings = features.filter(|feature| feature.name.starts_with("opening"));
        openings.map(|feature| feature.region).collect::<Vec<_>>()
    };
    // Three round holes and a slot, also beside the highlight.
    let matte = openings(Material::Matte);
    assert_eq!(matte.len(), 4);
    for material in [Material::RolledSteel, Material::Oiled] {
        let shining = openings(material);
        assert_eq!(shining.len(), matte.len(), "{material:?}: {shining:?}");
        // Some pixels of a rim may shine, and so change which of two is the larger one.
        let far = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]) > 1.0;
        for opening in &matte {
            let same = |other: &Vec<_>| !other.iter().zip(opening).any(|(a, b)| far(a, b));
            assert!(shining.iter().any(same), "{material:?}: {shining:?}");
        }
    }
}

/// Parts of a material that shines, taught and measured wherever they lie: no verdict is wrong, and
/// hardly a pixel is.
#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn good_parts_that_shine_get_no_wrong_verdict_and_hardly_a_wrong_pixel() {
    const PLACEMENTS: usize = 50;
    const WRONG_MM: f32 = 0.3;
    let mut too_many = Vec::new();
    for material in [Material::RolledSteel, Material::Oiled] {
        let (mut resolved, mut wrong, mut whole, mut invalid) = (0, 0, 0, 0);
        for (kind, part) in stock() {
            if !["sheet_metal", "tube", "sphere"].contains(&&*kind) {
                continue;
            }
            let mut line = Line::new(&Scenario {
                part,
                sub_rays: 2,
                material: Some(material),
                ..Scenario::default()
            });
            let mut random = Random::new(17);
            let mut refused = 0;
            for _ in 0..PLACEMENTS {
                let placement = line.placement(&mut random);
                let found = line.judge(&placement);
                assert_ne!(
                    found.verdict(),
                    Verdict::Fail,
                    "{material:?} {kind}: {found:?}"
                );
                if found.verdict() == Verdict::Invalid {
                    println!("{material:?} {kind}: {:?}", found.reason);
                    refused += 1;
                }
                let full = line.plan.sequence_count() - 1;
                let mut frames = Vec::new();
                let mut keep = |_, frame| frames.push(frame);
                let indices = line.plan.indices(full);
                line.bed.head.acquire(indices, TIMEOUT, &mut keep).unwrap();
                let heights = line.plan.layers(full, &frames).unwrap().height_mm;
                let truth = line.bed.stage.truth();
                let known = truth.height.iter().zip(&truth.class);
                for (mm, (height, class)) in heights.iter().zip(known) {
                    if mm.is_finite() {
                        resolved += 1;
                        let off = (mm - height).abs() > WRONG_MM;
                        wrong += u32::from(off);
                        whole += u32::from(off && *class == 2);
                    }
                }
            }
            println!("{material:?} {kind}: {refused} of {PLACEMENTS} INVALID");
            invalid += refused;
        }
        let words = format!(
            "{material:?}: {invalid} INVALID, {wrong} of {resolved} pixels off by more than {WRONG_MM} mm, {whole} of these are wholly lit and see no edge"
        );
        println!("{words}");
        if wrong > resolved / 100_000 {
            too_many.push(words);
        }
    }
    assert!(too_many.is_empty(), "{too_many:?}");
}
