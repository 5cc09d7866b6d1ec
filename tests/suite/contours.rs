//! Holes, slots and edges of plates of the simulated head, against the truth, over many placements.

use super::gauges::{frames, plan};
use super::placement::{Bed, bed, taught_within};
use algo::geometry::{Pinhole, Vector};
use algo::inspect::kinds::{Diameter, Distance, Length, Position, Width, X, Y};
use algo::inspect::{FeatureKind, Measure};
use appliance::recipe::{DatumFile, FeatureFile, GaugeFile, RecipeFile};
use appliance::station::{GaugeValue, Inspection, Verdict};
use sim::parts::{Floor, Hole, Plate, Slot};
use sim::scenario::Noise;
use sim::{Part, Placement, Scenario};
use std::time::Instant;
use tests::random::Random;

const PLACEMENTS: usize = 12;
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

/// The pixels of a polygon on the plate.
fn polygon(camera: &Pinhole, corners: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let seen = |&[x, y]: &[f64; 2]| {
        let (u, v) = camera.project(Vector::new(x, y, Z_MM)).unwrap();
        [u, v]
    };
    corners.iter().map(seen).collect()
}

fn around(camera: &Pinhole, [x, y]: [f64; 2], [a, b]: [f64; 2]) -> Vec<[f64; 2]> {
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
) -> (Vec<FeatureFile>, Vec<DatumFile>, Vec<(GaugeFile, f64)>) {
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

fn scenario(part: Part) -> Scenario {
    let mut scenario = Scenario {
        part,
        ..Scenario::default()
    };
    scenario.noise.noise_counts = Some(Noise::PAPER);
    scenario
}

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
    errors: usize,
    within: usize,
    ratio: f64,
}

#[test]
fn holes_and_slots_are_found_where_they_are() {
    let part = Part::Plate(plate());
    let mut bed = bed(&scenario(part.clone()));
    let taught = taught_within(&mut bed, TOLERANCE_MM).unwrap();
    let (features, datums, gauges) = gauging(&plate(), &bed.calibration.camera);
    let mut file: RecipeFile = taught.manifest.clone();
    file.features.extend(features);
    file.datums = datums;
    file.gauges = gauges.iter().map(|(gauge, _)| gauge.clone()).collect();
    let plan = plan(&bed, &file, &taught.recipe.arrays);
    bed.head
        .load(plan.rasters(&bed.calibration).unwrap())
        .unwrap();
    let mut random = Random::new(5);
    let mut judged = Judged::default();
    let mut sums = vec![(0.0, 0.0, 0.0); gauges.len()];
    for at in 0..=PLACEMENTS {
        let lies = match at {
            0 => Placement::default(),
            _ => placement(&mut random),
        };
        bed.stage.place(&part, &lies).unwrap();
        let found: Inspection = plan.inspect(0, &frames(&mut bed, &plan, 0), Instant::now());
        println!(
            "{at} {:?} {:?}",
            found.verdict() == Verdict::Invalid,
            found.reason
        );
        for ((gauge, truth), (found, sum)) in gauges.iter().zip(found.gauges.iter().zip(&mut sums))
        {
            let GaugeValue {
                value: Some(value),
                sigma: Some(sigma),
                uncertainty: Some(u),
                ..
            } = found
            else {
                println!("   {}: {:?}", gauge.name, found.reason);
                continue;
            };
            let error = value - truth;
            println!(
                "   {:<12} {value:9.4} error {:+6.1} µm σ {:.1} U {:.1}",
                gauge.name,
                error * 1e3,
                sigma * 1e3,
                u * 1e3
            );
            judged.errors += 1;
            judged.within += usize::from(error.abs() <= *u);
            judged.ratio += (error / sigma).powi(2);
            *sum = (sum.0 + error, sum.1 + error * error, sum.2 + 1.0);
        }
    }
    for ((gauge, _), (sum, squares, count)) in gauges.iter().zip(sums) {
        println!(
            "{:<12} bias {:+6.1} µm RMS {:.1} of {count}",
            gauge.name,
            sum / count * 1e3,
            (squares / count).sqrt() * 1e3
        );
    }
    println!(
        "within U {:.3} of {}",
        judged.within as f64 / judged.errors as f64,
        judged.errors
    );
}
