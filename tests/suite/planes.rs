//! Distances, angles and heights of planes of parts of the simulated head, against the truth, over
//! many placements.

use super::gauges::{frames, gauge, plan};
use super::placement::{Bed, bed, taught_within};
use algo::geometry::{Pinhole, Vector};
use algo::inspect::kinds::{Angle, Distance, Z};
use algo::inspect::{FeatureKind, Measure, Region};
use appliance::recipe::{DatumFile, FeatureFile, GaugeFile};
use appliance::station::{GaugeValue, Inspection, Unit};
use sim::parts::{Defect, Sawtooth, SheetMetal};
use sim::scenario::Noise;
use sim::{Part, Placement, Scenario};
use std::time::Instant;
use tests::random::Random;

/// Placements of each part, and measurements in each.
const PLACEMENTS: usize = 12;
const FEW_PLACEMENTS: usize = 2;
const REPEATS: usize = 6;
/// Largest displacement of parts in each direction, and largest tilt and rotation.
const SHIFT_MM: f64 = 1.0;
const TILT_DEG: f64 = 1.0;
const TOLERANCE_MM: f64 = 4.0;
/// Largest mean error over the placements.
const BIAS_MM: f64 = 0.005;
const BIAS_DEG: f64 = 0.01;
/// Scatter of repeated measurements over σ, and least share of errors within U, of all gauges.
const SCATTER: std::ops::Range<f64> = 0.8..1.2;
const WITHIN: f64 = 0.93;

/// A face of a part: z = z₀ + slope · x between two x, for |y| up to `half`.
#[derive(Clone, Copy)]
struct Flat {
    z: f64,
    slope: f64,
    x: [f64; 2],
    half: f64,
}

const HALF_MM: f64 = 25.0;
/// Rays per pixel along each side.
const SUB_RAYS: u32 = 2;

/// A part with two faces.
struct Sheet {
    name: String,
    part: Sawtooth,
    faces: [Flat; 2],
}

impl Sheet {
    /// Bent towards the head along y.
    fn bent(degrees: f64) -> Self {
        let slope = (degrees / 2.0).to_radians().tan();
        let face = |slope, x| Flat {
            z: 20.0,
            slope,
            x,
            half: HALF_MM,
        };
        Self {
            name: format!("bent by {degrees}°"),
            part: Sawtooth {
                half_size: 40.0,
                period: 200.0,
                rise: 0.5,
                lo: 20.0 - 100.0 * slope,
                hi: 20.0,
                ..Sawtooth::default()
            },
            faces: [face(slope, [-35.0, -5.0]), face(-slope, [5.0, 35.0])],
        }
    }

    /// Two parallel levels.
    fn levels() -> Self {
        let slope = 8.0 / 54.0;
        let face = |low: f64, x| Flat {
            z: -4.0 - slope * low,
            slope,
            x,
            half: HALF_MM,
        };
        Self {
            name: "levels".into(),
            part: Sawtooth {
                half_size: 60.0,
                period: 60.0,
                rise: 0.9,
                lo: -4.0,
                hi: 4.0,
                ..Sawtooth::default()
            },
            faces: [face(-40.0, [-35.0, 8.0]), face(20.0, [25.0, 55.0])],
        }
    }
}

impl Flat {
    /// Its outline in pixels.
    fn polygon(&self, camera: &Pinhole) -> Vec<[f64; 2]> {
        let [left, right] = self.x;
        let corners = [(left, -1.0), (right, -1.0), (right, 1.0), (left, 1.0)];
        let corners = corners.map(|(x, side)| {
            let point = Vector::new(x, side * self.half, self.z + self.slope * x);
            let (u, v) = camera.project(point).unwrap();
            [u, v]
        });
        corners.to_vec()
    }

    /// The point of the face in the middle of its pixels.
    fn middle(&self, camera: &Pinhole, size: usize) -> Vector {
        let corners = self.polygon(camera);
        let corners: Vec<_> = corners.iter().map(|&[u, v]| (u, v)).collect();
        let region = Region::polygon(&corners, size, size).unwrap();
        let eye = camera.centre();
        let (mut x, mut y) = (0.0, 0.0);
        for place in region.places(size) {
            let ray = camera
                .ray((place % size) as f64, (place / size) as f64)
                .unwrap();
            let t = (self.z + self.slope * eye.x - eye.z) / (ray.z - self.slope * ray.x);
            let point = eye + ray * t;
            (x, y) = (x + point.x, y + point.y);
        }
        let count = region.len() as f64;
        Vector::new(x / count, y / count, self.z + self.slope * x / count)
    }

    fn normal(&self) -> Vector {
        Vector::new(-self.slope, 0.0, 1.0) * (1.0 / self.slope.hypot(1.0))
    }
}

/// A gauge of both faces.
fn of_both(name: &str, measures: impl Into<Measure>) -> GaugeFile {
    GaugeFile::new(1, name, measures, &["one", "other"])
}

/// What a gauge measures of the two faces, and its true value.
fn gauges(sheet: &Sheet, bed: &Bed) -> (Vec<FeatureFile>, Vec<(GaugeFile, f64)>) {
    let [one, other] = sheet.faces;
    let size = bed.calibration.frames().0 as usize;
    let camera = &bed.calibration.camera;
    let region =
        |name: &str, face: Flat| FeatureFile::new(name, FeatureKind::Plane, face.polygon(camera));
    let middle = sheet.faces.map(|face| face.middle(camera, size));
    let distance = one.normal().dot(middle[1] - middle[0]).abs();
    let angle = one.normal().dot(other.normal()).acos().to_degrees();
    let mut gauges = vec![
        (gauge("z of one", "one", Z {}), middle[0].z),
        (gauge("z of other", "other", Z {}), middle[1].z),
        (of_both("distance", Distance {}), distance),
    ];
    // Between parallel faces it has a kink.
    if angle > 1.0 {
        gauges.push((of_both("angle", Angle {}), angle));
    }
    (vec![region("one", one), region("other", other)], gauges)
}

fn scenario(part: Sawtooth) -> Scenario {
    let mut scenario = Scenario {
        part: Part::Sawtooth(part),
        ..Scenario::default()
    };
    scenario.noise.noise_counts = Some(Noise::PAPER);
    scenario.sub_rays = SUB_RAYS;
    scenario
}

/// A random placement.
fn placement(random: &mut Random) -> Placement {
    let mut between = |reach: f64| reach * (2.0 * random.share() - 1.0);
    Placement {
        shift_mm: [(); 3].map(|()| between(SHIFT_MM)),
        tilt_deg: [(); 2].map(|()| between(TILT_DEG)),
        rotation_deg: between(TILT_DEG),
    }
}

/// Sums over measurements.
#[derive(Default)]
struct Judged {
    /// Scatter over σ of measurements of the same part in place, squared.
    ratios: f64,
    freedom: f64,
    /// Errors, and those within U.
    errors: usize,
    within: usize,
    /// What is worse than allowed.
    wrong: Vec<String>,
}

impl Judged {
    /// Measures a part again and again in each of random placements.
    fn measure(&mut self, sheet: &Sheet, placements: usize) {
        let part = Part::Sawtooth(sheet.part.clone());
        let mut bed = bed(&scenario(sheet.part.clone()));
        let taught = taught_within(&mut bed, TOLERANCE_MM).unwrap();
        let (regions, gauges) = gauges(sheet, &bed);
        let mut file = taught.manifest.clone();
        file.features.extend(regions);
        file.gauges = gauges.iter().map(|(gauge, _)| gauge.clone()).collect();
        let plan = plan(&bed, &file, &taught.recipe.arrays);
        bed.head
            .load(plan.rasters(&bed.calibration).unwrap())
            .unwrap();
        let mut random = Random::new(5);
        let mut bias = vec![0.0; gauges.len()];
        for at in 0..=placements {
            let lies = match at {
                0 => Placement::default(),
                _ => placement(&mut random),
            };
            bed.stage.place(&part, &lies).unwrap();
            let inspect = |_| plan.inspect(0, &frames(&mut bed, &plan, 0), Instant::now());
            let found: Vec<Inspection> = (0..REPEATS).map(inspect).collect();
            for (at, (_, truth)) in gauges.iter().enumerate() {
                let values = found.iter().map(|found| &found.gauges[at]);
                let error = self.add(values.collect(), *truth);
                bias[at] += error / (placements + 1) as f64;
            }
        }
        for ((gauge, _), bias) in gauges.iter().zip(bias) {
            println!("{}, {}: bias {bias:+.5}", sheet.name, gauge.name);
            let most = match gauge.measures.facts().unit {
                Unit::Angle => BIAS_DEG,
                _ => BIAS_MM,
            };
            if bias.abs() > most {
                self.wrong
                    .push(format!("{}, {}: bias {bias}", sheet.name, gauge.name));
            }
        }
    }

    /// Adds repeated measurements; their mean error.
    fn add(&mut self, found: Vec<&GaugeValue>, truth: f64) -> f64 {
        let count = found.len() as f64;
        let values = found.iter().map(|found| found.value.unwrap());
        let mean = values.clone().sum::<f64>() / count;
        let squares: f64 = values.clone().map(|value| (value - mean).powi(2)).sum();
        let sigmas = found.iter().map(|found| found.sigma.unwrap());
        let variance = sigmas.map(|sigma| sigma * sigma).sum::<f64>() / count;
        self.ratios += squares / variance;
        self.freedom += count - 1.0;
        for found in &found {
            let error = found.value.unwrap() - truth;
            self.errors += 1;
            self.within += usize::from(error.abs() <= found.uncertainty.unwrap());
        }
        println!(
            "   error {:+.5}, scatter {:.5}, σ {:.5}, U {:.5}",
            mean - truth,
            (squares / (count - 1.0)).sqrt(),
            variance.sqrt(),
            found[0].uncertainty.unwrap()
        );
        mean - truth
    }
}

#[test]
fn distances_and_angles_of_planes_are_true_and_as_uncertain_as_they_say() {
    judge(&[45.0], FEW_PLACEMENTS);
}

#[test]
#[ignore = "takes a minute: `.ci/run full`"]
fn distances_and_angles_of_planes_are_true_and_as_uncertain_as_they_say_at_many_placements() {
    judge(&[5.0, 45.0, 90.0], PLACEMENTS);
}

/// Fails if sheets of two levels and with such bends are measured with a larger bias than is allowed, or with other
/// scatter or errors than they state.
fn judge(bends: &[f64], placements: usize) {
    let mut judged = Judged::default();
    judged.measure(&Sheet::levels(), placements);
    for degrees in bends {
        judged.measure(&Sheet::bent(*degrees), placements);
    }
    let scatter = (judged.ratios / judged.freedom).sqrt();
    let within = judged.within as f64 / judged.errors as f64;
    println!("scatter / σ {scatter:.3}, {:.1} % within U", 100.0 * within);
    assert!(judged.wrong.is_empty(), "{:?}", judged.wrong);
    assert!(SCATTER.contains(&scatter), "{scatter}");
    assert!(within >= WITHIN, "{within}");
}

/// The stock bracket (`hal/sim/src/parts/sheet_metal.rs`): height of the plate, where it begins to bend along y, the
/// radius of the bend's upper side, and its angle.
const PLATE_Z: f64 = 8.0;
const BEND_LINE: f64 = 50.0;
const BEND_RADIUS: f64 = 4.0;
const BEND_DEG: f64 = 35.0;

/// The flange of a bracket that is bent by so much more: its angle in radians, and x where its plane crosses that of
/// the plate.
fn flange(more_deg: f64) -> [f64; 2] {
    let angle = (BEND_DEG + more_deg).to_radians();
    [angle, BEND_LINE + BEND_RADIUS * (angle / 2.0).tan()]
}

#[test]
fn a_bent_flange_reads_how_far_it_lies_from_the_plate_and_not_how_the_whole_part_was_fitted() {
    reads_how_far(&[-1.0, 0.4], &[0, 3]);
}

#[test]
#[ignore = "takes a minute: `.ci/run full`"]
fn flanges_bent_by_up_to_a_degree_read_how_far_they_lie_from_the_plate() {
    reads_how_far(&[-1.0, -0.4, 0.0, 0.4, 1.0], &[0, 1, 2, 3]);
}

/// Bends the flange by so many degrees, in placements of so many quarters of the largest shift.
fn reads_how_far(bends: &[f64], quarters: &[u32]) {
    // Rims of holes need as many rays as a scenario has by default.
    let mut bed = bed(&Scenario::default());
    let taught = taught_within(&mut bed, TOLERANCE_MM).unwrap();
    let [angle, crossing] = flange(0.0);
    let plate = Flat {
        z: PLATE_Z,
        slope: 0.0,
        x: [-50.0, 8.0],
        half: 20.0,
    };
    let bent = Flat {
        z: PLATE_Z + crossing * angle.tan(),
        slope: -angle.tan(),
        x: [55.0, 68.0],
        half: 25.0,
    };
    let camera = bed.calibration.camera.clone();
    let around = |y: f64| {
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let corners = corners.map(|(right, up)| {
            let corner = Vector::new(-60.0 + 9.0 * right, y + 9.0 * up, PLATE_Z);
            let (u, v) = camera.project(corner).unwrap();
            [u, v]
        });
        corners.to_vec()
    };
    let mut file = taught.manifest.clone();
    file.features.extend([
        FeatureFile {
            thickness_mm: Some(0.0),
            ..FeatureFile::new("plate", FeatureKind::Plane, plate.polygon(&camera))
        },
        FeatureFile::new("flange", FeatureKind::Plane, bent.polygon(&camera)),
        FeatureFile::new("upper", FeatureKind::Circle, around(40.0)),
        FeatureFile::new("lower", FeatureKind::Circle, around(-40.0)),
    ]);
    let system = |name: &str, of: &[&str]| DatumFile {
        name: name.into(),
        of: of.iter().map(|&of| of.into()).collect(),
    };
    file.datums = vec![
        system("A", &["plate"]),
        system("ABC", &["plate", "upper", "lower"]),
    ];
    let in_system = |name: &str| GaugeFile {
        datum: Some(name.into()),
        ..gauge(name, "flange", Z {})
    };
    file.gauges = vec![
        GaugeFile::new(1, "distance", Distance {}, &["plate", "flange"]),
        GaugeFile {
            slot: 2,
            ..in_system("A")
        },
        GaugeFile {
            slot: 3,
            ..in_system("ABC")
        },
    ];
    let plan = plan(&bed, &file, &taught.recipe.arrays);
    bed.head
        .load(plan.rasters(&bed.calibration).unwrap())
        .unwrap();
    let middle = bent.middle(&camera, bed.calibration.frames().0 as usize);
    let from_crossing = (middle.x - crossing) / angle.cos();
    let mut random = Random::new(7);
    let (mut within, mut all) = (0_u32, 0_u32);
    for &degrees in bends {
        let [angle, crossing] = flange(degrees);
        let off = from_crossing * angle.sin();
        let truth = [off, -off, -(middle.x - crossing) * angle.tan()];
        let defects = vec![Defect::BentFlange { degrees }];
        let part = Part::SheetMetal(SheetMetal {
            defects,
            ..Default::default()
        });
        for &at in quarters {
            let mut lies = placement(&mut random);
            lies.shift_mm = lies.shift_mm.map(|way| way * f64::from(at) / 4.0);
            lies.tilt_deg = lies.tilt_deg.map(|turn| turn * f64::from(at) / 10.0);
            lies.rotation_deg *= f64::from(at) / 10.0;
            bed.stage.place(&part, &lies).unwrap();
            let found = plan.inspect(0, &frames(&mut bed, &plan, 0), Instant::now());
            for (found, truth) in found.gauges.iter().zip(truth) {
                let (value, u) = (found.value.unwrap(), found.uncertainty.unwrap());
                println!(
                    "{degrees}°, {}: {value:+.4} ± {u:.4} for {truth:+.4}",
                    found.name
                );
                all += 1;
                within += u32::from((value - truth).abs() <= u);
            }
        }
    }
    assert!(
        f64::from(within) >= 0.95 * f64::from(all),
        "{within} of {all} within U"
    );
}
