//! Holes, slots and edges of plates of the simulated head, against the truth, over many placements.

use super::gauges::{frames, plan};
use super::placement::{Bed, bed, taught_within};
use algo::geometry::{Pinhole, Vector};
use algo::inspect::kinds::{Diameter, Distance, Length, Position, Width, X, Y};
use algo::inspect::{FeatureKind, Measure, State};
use appliance::recipe::plan::Plan;
use appliance::recipe::{DatumFile, FeatureFile, GaugeFile, RecipeFile};
use appliance::station::{GaugeValue, Inspection, Verdict};
use sim::parts::{Defect, Floor, Hole, Plate, Slot};
use sim::scenario::Noise;
use sim::{Part, Placement, Scenario};
use std::time::Instant;
use tests::random::Random;

/// Placements of a plate, and measurements in each.
const PLACEMENTS: usize = 12;
const REPEATS: usize = 4;
/// Largest displacement in each direction, and largest tilt and rotation.
const SHIFT_MM: f64 = 1.0;
const TILT_DEG: f64 = 1.0;
const TOLERANCE_MM: f64 = 5.0;
/// z of the plate's upper side.
const Z_MM: f64 = 8.0;
/// A region reaches so far beyond its contour, mm.
const AROUND_MM: f64 = 2.5;

/// The plate: holes of 3 to 11 mm and a slot.
fn plate() -> Plate {
    let hole = |x, y, radius| Hole { x, y, radius };
    Plate {
        z: Z_MM,
        holes: vec![
            hole(-60.0, 40.0, 3.0),
            hole(55.0, 41.0, 5.0),
            hole(-60.0, -40.0, 6.0),
            hole(24.0, 2.0, 11.0),
        ],
        slots: vec![Slot {
            from: [-32.0, 30.0],
            to: [2.0, 30.0],
            half_width: 4.0,
        }],
        floor: Floor {
            albedo: 0.0,
            ..Floor::default()
        },
        ..Plate::default()
    }
}

/// The camera, and how the plate lies.
type View<'a> = (&'a Pinhole, &'a Placement);

/// The pixels of a polygon on the plate.
fn polygon((camera, lies): View<'_>, corners: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let seen = |&[x, y]: &[f64; 2]| {
        let [x, y, z] = lies.to_world([x, y, Z_MM]);
        let at = Vector::new(x, y, z);
        let (u, v) = camera.project(at).unwrap();
        [u, v]
    };
    corners.iter().map(seen).collect()
}

fn around(camera: View<'_>, [x, y]: [f64; 2], [a, b]: [f64; 2]) -> Vec<[f64; 2]> {
    let corner = |at: usize| {
        let turn = std::f64::consts::TAU * at as f64 / 16.0;
        [x + a * turn.cos(), y + b * turn.sin()]
    };
    polygon(camera, &(0..16).map(corner).collect::<Vec<_>>())
}

/// Features of a plate, and gauges with their true values.
fn gauging(
    plate: &Plate,
    camera: &Pinhole,
    lies: &Placement,
) -> (Vec<FeatureFile>, Vec<DatumFile>, Vec<(GaugeFile, f64)>) {
    let camera = (camera, lies);
    let (right, top) = (plate.width / 2.0 - 3.0, plate.height / 2.0 - 3.0);
    let corners = [[-right, -top], [right, -top], [right, top], [-right, top]];
    let mut features = vec![FeatureFile::new(
        "sheet",
        FeatureKind::Plane,
        polygon(camera, &corners),
    )];
    let in_sheet = |of: FeatureFile| FeatureFile {
        plane: Some("sheet".into()),
        ..of
    };
    let mut all: Vec<(GaugeFile, f64)> = Vec::new();
    let mut add =
        |name: String, measures: Measure, of: &[&str], datum: Option<&str>, truth: f64| {
            let slot = all.len() as u16 + 1;
            let gauge = GaugeFile {
                datum: datum.map(Into::into),
                ..GaugeFile::new(slot, &name, measures, of)
            };
            all.push((gauge, truth));
        };
    for (at, hole) in plate.holes.iter().enumerate() {
        let name = format!("hole {}", at + 1);
        let reach = hole.radius + AROUND_MM;
        let region = around(camera, [hole.x, hole.y], [reach; 2]);
        features.push(in_sheet(FeatureFile::new(
            &*name,
            FeatureKind::Circle,
            region,
        )));
        add(
            format!("diameter {}", at + 1),
            Diameter {}.into(),
            &[&name],
            None,
            2.0 * hole.radius,
        );
    }
    let slot = &plate.slots[0];
    let middle = [(slot.from[0] + slot.to[0]) / 2.0, slot.from[1]];
    let half = (slot.to[0] - slot.from[0]) / 2.0 + slot.half_width;
    let (x, y) = (half + AROUND_MM, slot.half_width + AROUND_MM);
    let corners = [[-x, -y], [x, -y], [x, y], [-x, y]].map(|[a, b]| [middle[0] + a, middle[1] + b]);
    features.push(in_sheet(FeatureFile::new(
        "slot",
        FeatureKind::Slot,
        polygon(camera, &corners),
    )));
    add(
        "length".into(),
        Length {}.into(),
        &["slot"],
        None,
        2.0 * half,
    );
    add(
        "width".into(),
        Width {}.into(),
        &["slot"],
        None,
        2.0 * slot.half_width,
    );
    let left = -plate.width / 2.0;
    let corners = [-30.0, 30.0].map(|y| [[left - 3.0, y], [left + 3.0, y]]);
    let corners = [corners[0][0], corners[0][1], corners[1][1], corners[1][0]];
    features.push(in_sheet(FeatureFile::new(
        "edge",
        FeatureKind::Line,
        polygon(camera, &corners),
    )));
    let [a, b, c, d] = plate.holes[..] else {
        panic!("four holes")
    };
    let distance = |one: Hole, other: Hole| (one.x - other.x).hypot(one.y - other.y);
    for (name, of, truth) in [
        ("1 to 2", ["hole 1", "hole 2"], distance(a, b)),
        ("3 to 4", ["hole 3", "hole 4"], distance(c, d)),
        ("edge to 4", ["edge", "hole 4"], d.x - left),
        (
            "slot to 3",
            ["slot", "hole 3"],
            (middle[0] - c.x).hypot(middle[1] - c.y),
        ),
    ] {
        add(name.into(), Distance {}.into(), &of, None, truth);
    }
    // Holes 1 and 2 make the frame.
    let (axis, length) = ([b.x - a.x, b.y - a.y], distance(a, b));
    let at = [
        ((d.x - a.x) * axis[0] + (d.y - a.y) * axis[1]) / length,
        ((d.y - a.y) * axis[0] - (d.x - a.x) * axis[1]) / length,
    ];
    add(
        "x of 4".into(),
        X {}.into(),
        &["hole 4"],
        Some("ABC"),
        at[0],
    );
    add(
        "y of 4".into(),
        Y {}.into(),
        &["hole 4"],
        Some("ABC"),
        at[1],
    );
    let nominal = [at[0] - 0.03, at[1] + 0.04];
    let position = Position { nominal };
    add(
        "position".into(),
        position.into(),
        &["hole 4"],
        Some("ABC"),
        0.1,
    );
    let datums = vec![DatumFile {
        name: "ABC".into(),
        of: ["sheet", "hole 1", "hole 2"].map(Into::into).to_vec(),
    }];
    (features, datums, all)
}

/// What plates are measured by.
#[derive(Clone)]
struct Setting {
    plate: Plate,
    /// σ of the blur of camera and projector, px.
    blur: [f64; 2],
    /// Ambient light over the part's.
    ambient: f64,
    /// Of the part as taught about y, degrees.
    tilt_deg: f64,
    thickness_mm: Option<f64>,
    /// Counts; `None` for a quiet camera.
    noise: Option<f64>,
}

impl Default for Setting {
    fn default() -> Self {
        Self {
            plate: plate(),
            blur: [0.0, 0.5],
            ambient: 0.04,
            tilt_deg: 0.0,
            thickness_mm: Some(0.0),
            noise: Some(Noise::PAPER),
        }
    }
}

impl Setting {
    fn scenario(&self) -> Scenario {
        let mut scenario = Scenario {
            part: Part::Plate(self.plate.clone()),
            ..Scenario::default()
        };
        scenario.noise.noise_counts = self.noise;
        scenario.optics.camera_blur_px = self.blur[0];
        scenario.optics.projector_blur_px = self.blur[1];
        scenario.light.ambient = self.ambient;
        scenario
    }

    /// The placement as taught, displaced at random.
    fn placement(&self, random: Option<&mut Random>) -> Placement {
        let mut lies = Placement {
            tilt_deg: [0.0, self.tilt_deg],
            ..Placement::default()
        };
        if let Some(random) = random {
            let mut between = |reach: f64| reach * (2.0 * random.share() - 1.0);
            lies.shift_mm = [(); 3].map(|()| between(SHIFT_MM));
            lies.tilt_deg = lies.tilt_deg.map(|tilt| tilt + between(TILT_DEG));
            lies.rotation_deg = between(TILT_DEG);
        }
        lies
    }
}

/// A plate that was taught, with gauges.
struct Line {
    setting: Setting,
    bed: Bed,
    plan: Plan,
    gauges: Vec<(GaugeFile, f64)>,
}

impl Line {
    fn new(setting: &Setting) -> Self {
        Self::with_limits(setting, |_, _| ())
    }

    fn with_limits(setting: &Setting, limit: impl Fn(&mut GaugeFile, f64)) -> Self {
        let mut bed = bed(&setting.scenario());
        let part = Part::Plate(setting.plate.clone());
        bed.stage.place(&part, &setting.placement(None)).unwrap();
        let taught = taught_within(&mut bed, TOLERANCE_MM).unwrap();
        let lies = setting.placement(None);
        let (mut features, datums, mut gauges) =
            gauging(&setting.plate, &bed.calibration.camera, &lies);
        features[0].thickness_mm = setting.thickness_mm;
        for (gauge, truth) in &mut gauges {
            limit(gauge, *truth);
        }
        let mut file: RecipeFile = taught.manifest.clone();
        file.features.extend(features);
        file.datums = datums;
        file.gauges = gauges.iter().map(|(gauge, _)| gauge.clone()).collect();
        let plan = plan(&bed, &file, &taught.recipe.arrays);
        bed.head
            .load(plan.rasters(&bed.calibration).unwrap())
            .unwrap();
        Self {
            setting: setting.clone(),
            bed,
            plan,
            gauges,
        }
    }

    fn inspect(&mut self, plate: Plate, lies: &Placement) -> Inspection {
        self.bed.stage.place(&Part::Plate(plate), lies).unwrap();
        let frames = frames(&mut self.bed, &self.plan, 0);
        self.plan.inspect(0, &frames, Instant::now())
    }

    /// Measures good plates at random places, and in each again and again.
    fn judge(&mut self, name: &str, placements: usize, judged: &mut Judged) {
        let mut random = Random::new(5);
        let mut sums = vec![[0.0; 3]; self.gauges.len()];
        for at in 0..placements {
            let lies = self.setting.placement((at > 0).then_some(&mut random));
            let part = Part::Plate(self.setting.plate.clone());
            self.bed.stage.place(&part, &lies).unwrap();
            let found: Vec<Inspection> = (0..REPEATS)
                .map(|_| {
                    let frames = frames(&mut self.bed, &self.plan, 0);
                    self.plan.inspect(0, &frames, Instant::now())
                })
                .collect();
            for feature in &found[0].features {
                if feature.state != State::Found {
                    println!("{name} {at}: {feature:?}");
                }
                judged.rims.push(feature.found);
            }
            for (at, ((gauge, truth), sum)) in self.gauges.iter().zip(&mut sums).enumerate() {
                let values = found.iter().map(|found| &found.gauges[at]);
                judged.add(&gauge.name, values.collect(), *truth, sum);
            }
        }
        for ((gauge, _), [sum, squares, count]) in self.gauges.iter().zip(sums) {
            let (bias, rms) = (sum / count * 1e3, (squares / count).sqrt() * 1e3);
            println!(
                "{name}, {:<12} bias {bias:+6.1} µm, RMS {rms:5.1}, of {count}",
                gauge.name
            );
            judged.bias = judged.bias.max(bias.abs());
        }
    }
}

/// Sums over measurements.
#[derive(Default)]
struct Judged {
    /// Largest mean error, µm.
    bias: f64,
    /// Scatter over σ of measurements of the same part in place, squared.
    ratios: f64,
    freedom: f64,
    errors: f64,
    squares: f64,
    within: f64,
    /// Σ U².
    stated: f64,
    missing: usize,
    /// Shares of rims that were found.
    rims: Vec<f64>,
}

impl Judged {
    /// Adds repeated measurements of a gauge.
    fn add(&mut self, name: &str, found: Vec<&GaugeValue>, truth: f64, sum: &mut [f64; 3]) {
        let values: Vec<f64> = found.iter().filter_map(|found| found.value).collect();
        if values.len() < found.len() {
            println!("   {name}: {:?}", found[0].reason);
            self.missing += found.len() - values.len();
            return;
        }
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        let sigmas = found.iter().map(|found| found.sigma.unwrap());
        let variance = sigmas.map(|sigma| sigma * sigma).sum::<f64>() / count;
        self.ratios += squares / variance;
        self.freedom += count - 1.0;
        for found in &found {
            let error = found.value.unwrap() - truth;
            let u = found.uncertainty.unwrap();
            self.errors += 1.0;
            self.within += f64::from(u8::from(error.abs() <= u));
            self.squares += error * error;
            self.stated += u * u;
        }
        let error = mean - truth;
        *sum = [sum[0] + error, sum[1] + error * error, sum[2] + 1.0];
    }

    /// Scatter over σ, the share of errors within U, and RMS of U over RMS error.
    fn figures(&self) -> [f64; 3] {
        let scatter = (self.ratios / self.freedom).sqrt();
        let figures = [
            scatter,
            self.within / self.errors,
            (self.stated / self.squares).sqrt(),
        ];
        let least = self.rims.iter().copied().fold(1.0, f64::min);
        println!(
            "bias ≤ {:.1} µm, scatter/σ {:.2}, within U {:.3} of {}, U/RMS {:.2}, rims ≥ {least:.2}, {} missing",
            self.bias, figures[0], figures[1], self.errors, figures[2], self.missing
        );
        figures
    }
}

fn bright(plate: Plate) -> Plate {
    let floor = Floor {
        albedo: 1.0,
        ..Floor::default()
    };
    Plate { floor, ..plate }
}

fn thick(plate: Plate) -> Plate {
    let thickness_mm = 1.0;
    Plate {
        thickness_mm,
        ..plate
    }
}

/// The settings that a row of the promise names, with the largest bias in µm.
fn settings() -> Vec<(&'static str, Setting, f64)> {
    let plain = Setting::default();
    let of = |plate: Plate| Setting {
        plate,
        ..plain.clone()
    };
    let all = Setting {
        plate: bright(thick(plate())),
        blur: [0.5, 1.0],
        ambient: 0.2,
        thickness_mm: Some(1.0),
        ..plain.clone()
    };
    vec![
        ("plain", plain.clone(), 8.0),
        (
            "1 mm thick",
            Setting {
                thickness_mm: Some(1.0),
                ..of(thick(plate()))
            },
            20.0,
        ),
        (
            "real optics",
            Setting {
                blur: [0.5, 1.0],
                ..plain.clone()
            },
            20.0,
        ),
        ("bright floor", of(bright(plate())), 35.0),
        (
            "ambient light",
            Setting {
                ambient: 0.2,
                ..plain.clone()
            },
            20.0,
        ),
        ("all together", all.clone(), 35.0),
        (
            "tilted",
            Setting {
                tilt_deg: 12.0,
                thickness_mm: Some(1.0),
                ..of(thick(plate()))
            },
            30.0,
        ),
        (
            "tilted, thickness not told",
            Setting {
                tilt_deg: -12.0,
                thickness_mm: None,
                ..of(thick(plate()))
            },
            60.0,
        ),
        (
            "quiet",
            Setting {
                noise: None,
                ..plain
            },
            8.0,
        ),
    ]
}

#[test]
fn holes_slots_and_edges_are_true_and_as_uncertain_as_they_say() {
    let mut judged = Judged::default();
    Line::new(&Setting::default()).judge("plain", PLACEMENTS, &mut judged);
    let [scatter, within, _] = judged.figures();
    assert_eq!(judged.missing, 0);
    assert!(judged.bias <= 8.0, "{}", judged.bias);
    assert!((0.8..1.2).contains(&scatter), "{scatter}");
    assert!(within >= 0.93, "{within}");
}

#[test]
#[ignore = "minutes"]
fn contours_are_true_with_thick_sheets_bright_floors_real_optics_and_tilts() {
    let mut wrong = Vec::new();
    for (name, setting, most) in settings() {
        let mut judged = Judged::default();
        Line::new(&setting).judge(name, PLACEMENTS, &mut judged);
        let [scatter, within, _] = judged.figures();
        let good = judged.bias <= most && (0.7..1.3).contains(&scatter) && within >= 0.93;
        if !good || judged.missing > 0 {
            wrong.push((name, judged.bias, scatter, within, judged.missing));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn a_closed_hole_is_absent_and_changes_nothing_else() {
    let mut line = Line::new(&Setting::default());
    let mut random = Random::new(9);
    for at in 0..4 {
        let lies = line.setting.placement((at > 0).then_some(&mut random));
        let closed: &[usize] = if at % 2 == 0 { &[1] } else { &[0, 2] };
        let mut plate = line.setting.plate.clone();
        line.bed.stage.reseed(7);
        let open = line.inspect(plate.clone(), &lies);
        plate.defects = closed
            .iter()
            .map(|&index| Defect::MissingHole { index })
            .collect();
        line.bed.stage.reseed(7);
        let found = line.inspect(plate, &lies);
        assert_eq!(found.verdict(), Verdict::Fail, "{:?}", found.reason);
        let names: Vec<String> = closed.iter().map(|at| format!("hole {}", at + 1)).collect();
        for (((gauge, _), found), open) in line.gauges.iter().zip(&found.gauges).zip(&open.gauges) {
            let datum = ["sheet", "hole 1", "hole 2"].map(String::from);
            let datum = datum.iter().filter(|_| gauge.datum.is_some());
            let is_of_closed = gauge.of.iter().chain(datum).any(|of| names.contains(of));
            assert_eq!(
                found.decision.absent, is_of_closed,
                "{} {found:?}",
                gauge.name
            );
            if let (Some(value), Some(open), Some(sigma)) = (found.value, open.value, open.sigma) {
                let change = (value - open).abs();
                assert!(
                    change <= 2.0 * sigma,
                    "{}: {change} of σ {sigma}",
                    gauge.name
                );
            }
        }
    }
}

#[test]
fn a_displaced_hole_and_a_larger_one_fail_and_good_plates_pass() {
    let mut line = Line::with_limits(&Setting::default(), |gauge, truth| {
        (gauge.low, gauge.high) = (Some(truth - 0.06), Some(truth + 0.06));
        if gauge.datum.is_some() && gauge.name == "position" {
            (gauge.low, gauge.high) = (None, Some(0.3));
        }
    });
    let mut random = Random::new(11);
    for at in 0..6 {
        let lies = line.setting.placement((at > 0).then_some(&mut random));
        let good = line.setting.plate.clone();
        let verdict = |line: &mut Line, defects: Vec<Defect>| {
            let plate = Plate {
                defects,
                ..good.clone()
            };
            let found = line.inspect(plate, &lies);
            (found.verdict(), found.reason.clone())
        };
        assert_eq!(verdict(&mut line, vec![]), (Verdict::Pass, None));
        let (index, radius) = (2, good.holes[2].radius + 0.05);
        let larger = verdict(&mut line, vec![Defect::HoleRadius { index, radius }]);
        assert_eq!(larger.0, Verdict::Fail, "{larger:?}");
        let (dx, dy) = (0.1, 0.0);
        let displaced = verdict(&mut line, vec![Defect::DisplacedHole { index: 3, dx, dy }]);
        assert_eq!(displaced.0, Verdict::Fail, "{displaced:?}");
    }
}
