//! Every stock part, taught with default settings: good parts that lie anywhere within the placement tolerance pass, and dents do not.

use super::placement::{Bed, TIMEOUT, bed, taught_within};
use algo::geometry::Vector;
use appliance::recipe::plan::Plan;
use appliance::recipe::teach::TaughtRecipe;
use appliance::station::{Inspection, Verdict};
use sim::{Part, Placement, Scenario};
use std::time::Instant;
use tests::random::Random;

/// The placement tolerance of the default configuration, mm.
const TOLERANCE_MM: f64 = 1.0;

/// Every kind of part that can be taught, by its name.
pub(crate) fn stock() -> Vec<(String, Part)> {
    let named = Part::stock().into_iter().map(|part| {
        let kind = serde_json::to_value(&part).unwrap()["kind"].clone();
        (kind.as_str().unwrap().to_owned(), part)
    });
    named
        .filter(|(kind, _)| !["board", "empty"].contains(&&**kind))
        .collect()
}

/// A taught part in front of its head.
struct Line {
    bed: Bed,
    plan: Plan,
    part: Part,
    /// Corners of the box around what was taught.
    corners: Vec<Vector>,
    limit_mm: f64,
    words: Vec<String>,
}

impl Line {
    fn new(scenario: &Scenario) -> Self {
        let mut bed = bed(scenario);
        let taught = taught_within(&mut bed, TOLERANCE_MM).unwrap();
        Self::of(bed, taught, scenario)
    }

    fn of(mut bed: Bed, taught: TaughtRecipe, scenario: &Scenario) -> Self {
        let limit_mm = taught.manifest.gauges[0].high.unwrap();
        let words = taught.choice.reasons.clone();
        let arrays = &taught.recipe.arrays;
        let (height, valid) = (arrays.golden_height.clone(), arrays.valid.clone());
        let plan = Plan::new(taught.recipe, &bed.calibration, true).unwrap();
        bed.head
            .load(plan.rasters(&bed.calibration).unwrap())
            .unwrap();
        let width = plan.conditions().camera.0 as usize;
        let triangulator = plan.production().triangulator();
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for at in (0..height.len()).filter(|at| valid[*at] != 0) {
            let z = algo::units::Height::from_mm(f64::from(height[at]));
            let point = triangulator.point(at % width, at / width, z).unwrap();
            for (i, x) in [point.x, point.y, point.z].into_iter().enumerate() {
                (low[i], high[i]) = (low[i].min(x), high[i].max(x));
            }
        }
        let ends = [low, high];
        let corner = |i: usize| Vector::new(ends[i & 1][0], ends[i >> 1 & 1][1], ends[i >> 2][2]);
        Self {
            corners: (0..8).map(corner).collect(),
            part: scenario.part.clone(),
            bed,
            plan,
            limit_mm,
            words,
        }
    }

    /// A placement with all six components uniform, scaled so that no corner moves farther than the tolerance.
    fn placement(&self, random: &mut Random) -> Placement {
        let mut share = || 2.0 * random.share() - 1.0;
        let reach = self
            .corners
            .iter()
            .map(|corner| corner.length())
            .fold(1.0, f64::max);
        let turn = (TOLERANCE_MM / reach).to_degrees();
        let mut placement = Placement {
            shift_mm: [share(), share(), share()].map(|x| x * TOLERANCE_MM),
            tilt_deg: [share(), share()].map(|x| x * turn),
            rotation_deg: share() * turn,
        };
        let farthest = self
            .corners
            .iter()
            .map(|corner| way(&placement, *corner).length());
        let scale = (TOLERANCE_MM / farthest.fold(0.0, f64::max)).min(1.0);
        placement.shift_mm = placement.shift_mm.map(|x| x * scale);
        placement.tilt_deg = placement.tilt_deg.map(|x| x * scale);
        placement.rotation_deg *= scale;
        placement
    }

    /// Runs a cycle as in production: longer sequences follow if a shorter one is not enough.
    fn judge(&mut self, placement: &Placement) -> Inspection {
        self.bed.stage.place(&self.part, placement).unwrap();
        let mut sequence = 0;
        loop {
            let mut frames = Vec::new();
            let mut keep = |_, frame| frames.push(frame);
            let indices = self.plan.indices(sequence);
            self.bed.head.acquire(indices, TIMEOUT, &mut keep).unwrap();
            let found = self.plan.inspect(sequence, &frames, Instant::now());
            sequence += 1;
            if found.step_up.is_none() || sequence == self.plan.sequence_count() {
                return found;
            }
        }
    }
}

/// Where a placement takes a point.
fn way(placement: &Placement, point: Vector) -> Vector {
    let [a, b] = placement.tilt_deg.map(f64::to_radians);
    let c = placement.rotation_deg.to_radians();
    let [x, y, z] = placement.shift_mm;
    // Rotated about x, then y, then z.
    let p = Vector::new(
        point.x,
        point.y * a.cos() - point.z * a.sin(),
        point.y * a.sin() + point.z * a.cos(),
    );
    let p = Vector::new(
        p.x * b.cos() + p.z * b.sin(),
        p.y,
        p.z * b.cos() - p.x * b.sin(),
    );
    let p = Vector::new(
        p.x * c.cos() - p.y * c.sin(),
        p.x * c.sin() + p.y * c.cos(),
        p.z,
    );
    p + Vector::new(x, y, z) - point
}

#[test]
#[ignore = "takes minutes"]
fn print_statistics() {
    let only = std::env::var("PART").unwrap_or_default();
    let count: usize = std::env::var("COUNT")
        .ok()
        .and_then(|c| c.parse().ok())
        .unwrap_or(20);
    for (kind, part) in stock() {
        if !only.is_empty() && !only.split(',').any(|p| p == kind) {
            continue;
        }
        let scenario = Scenario {
            part,
            ..Scenario::default()
        };
        let mut line = Line::new(&scenario);
        println!("== {kind} limit {}", line.limit_mm);
        for word in &line.words {
            println!("   {word}");
        }
        let mut random = Random::new(5);
        let (mut passed, mut failed, mut invalid) = (0, 0, 0);
        let mut values: Vec<(f64, f64, f64)> = Vec::new();
        for n in 0..count {
            let placement = match n {
                0..3 => Placement::default(),
                _ => line.placement(&mut random),
            };
            let found = line.judge(&placement);
            let say = |word: &str| {
                println!(
                    "   {n} {word}: {:?} {:?}",
                    found.reason,
                    found
                        .gauges
                        .iter()
                        .filter(|g| !g.decision.pass)
                        .map(|g| (&*g.name, g.value, g.low, g.high))
                        .collect::<Vec<_>>()
                )
            };
            match found.verdict() {
                Verdict::Pass => passed += 1,
                Verdict::Fail => {
                    failed += 1;
                    say("FAIL")
                }
                _ => {
                    invalid += 1;
                    say("INVALID")
                }
            }
            let g = &found.gauges[0];
            if n >= 3 {
                values.push((
                    g.value.unwrap_or(f64::NAN),
                    g.sigma.unwrap_or(f64::NAN),
                    g.expected.unwrap_or(f64::NAN),
                ));
            }
        }
        let n = values.len() as f64;
        let mean = |f: &dyn Fn(&(f64, f64, f64)) -> f64| values.iter().map(f).sum::<f64>() / n;
        let most = values.iter().map(|v| v.0.abs()).fold(0.0, f64::max);
        let m = mean(&|v| v.0.abs());
        let scatter = (mean(&|v| (v.0.abs() - m).powi(2)) * n / (n - 1.0)).sqrt();
        let signed = mean(&|v| v.0);
        let signed_scatter = (mean(&|v| (v.0 - signed).powi(2))).sqrt();
        println!(
            "   {passed} PASS {failed} FAIL {invalid} INVALID; largest {most:.4} = {:.3} of limit; |value| {m:.4} ± {scatter:.4}, signed scatter {signed_scatter:.4}, σ {:.4}, expected {:.4}; scatter/σ {:.2}",
            most / line.limit_mm,
            mean(&|v| v.1),
            mean(&|v| v.2),
            scatter / mean(&|v| v.1)
        );
    }
}
