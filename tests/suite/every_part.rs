//! Every stock part, taught with default settings: good parts that lie anywhere within the
//! placement tolerance pass, and dents do not.

use super::limits::cycle;
use super::placement::{Bed, bed, taught_exposed, taught_within, with_two_frames};
use algo::geometry::Vector;
use appliance::recipe::plan::Plan;
use appliance::recipe::teach::TaughtRecipe;
use appliance::recipe::{Recipe, RecipeFile};
use appliance::station::{Inspection, Verdict};
use sim::parts::Defect;
use sim::{Part, Placement, Scenario};
use tests::random::Random;

/// The placement tolerance of the default configuration, mm.
pub(crate) const TOLERANCE_MM: f64 = 1.0;

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
pub(crate) struct Line {
    pub(crate) bed: Bed,
    pub(crate) plan: Plan,
    part: Part,
    /// Corners of the box around what was taught.
    corners: Vec<Vector>,
    limit_mm: f64,
}

impl Line {
    pub(crate) fn new(scenario: &Scenario) -> Self {
        let mut bed = bed(scenario);
        let taught = taught_within(&mut bed, TOLERANCE_MM).unwrap();
        let limit_mm = taught.manifest.gauges[0].high.unwrap();
        Self::of(bed, taught.recipe, limit_mm, scenario.part.clone())
    }

    /// A part that was taught with this limit of the deviation.
    pub(crate) fn of(mut bed: Bed, recipe: Recipe, limit_mm: f64, part: Part) -> Self {
        let arrays = &recipe.arrays;
        let (height, valid) = (arrays.golden_height.clone(), arrays.valid.clone());
        let plan = planned(&mut bed, recipe);
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
            part,
            bed,
            plan,
            limit_mm,
        }
    }

    /// A placement with all six components uniform, scaled so that no corner moves farther than the
    /// tolerance.
    pub(crate) fn placement(&self, random: &mut Random) -> Placement {
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

    /// Judges the part where a placement puts it.
    pub(crate) fn judge(&mut self, placement: &Placement) -> Inspection {
        self.bed.stage.place(&self.part, placement).unwrap();
        cycle(&mut self.bed, &self.plan)
    }
}

/// A recipe's plan, with its patterns loaded.
fn planned(bed: &mut Bed, recipe: Recipe) -> Plan {
    let plan = Plan::new(recipe, &bed.calibration, true).unwrap();
    plan.load(&mut bed.head, &bed.calibration).unwrap();
    plan
}

/// Where a placement takes a point.
pub(crate) fn way(placement: &Placement, point: Vector) -> Vector {
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

/// What good parts read: the deviations of those that lie elsewhere than taught.
#[derive(Debug, Default)]
struct Read {
    values: Vec<f64>,
    sigmas: Vec<f64>,
    invalid: usize,
    failed: usize,
}

impl Read {
    fn add(&mut self, kind: &str, found: &Inspection) {
        match found.verdict() {
            Verdict::Pass => {}
            Verdict::Invalid => {
                println!("{kind}: INVALID, {:?}", found.reason);
                self.invalid += 1;
            }
            verdict => {
                println!("{kind}: {verdict:?}, {:?}", found.gauges);
                self.failed += 1;
            }
        }
        self.values.extend(found.gauges[0].value.map(f64::abs));
        self.sigmas.extend(found.gauges[0].sigma);
    }

    /// The scatter of the deviations, over their stated σ.
    fn scatter_over_sigma(&self) -> f64 {
        let count = self.values.len() as f64;
        let mean = self.values.iter().sum::<f64>() / count;
        let squares = self
            .values
            .iter()
            .map(|value| (value - mean).powi(2))
            .sum::<f64>();
        let stated = self.sigmas.iter().map(|sigma| sigma * sigma).sum::<f64>();
        (squares / (count - 1.0) / (stated / self.sigmas.len() as f64)).sqrt()
    }

    fn largest(&self) -> f64 {
        self.values.iter().copied().fold(0.0, f64::max)
    }
}

/// Teaches each stock part and measures good ones, as they were taught and elsewhere: none fails,
/// hardly one is INVALID, and none comes near the limit. Returns how the deviations of each kind
/// scatter over their σ.
fn good_parts_pass(still: usize, placements: usize, scenario: fn(Part) -> Scenario) -> Vec<f64> {
    let (mut ratios, mut refused) = (Vec::new(), Vec::new());
    for (kind, part) in stock() {
        let mut line = Line::new(&scenario(part));
        let mut as_it_lies = Read::default();
        for _ in 0..still {
            as_it_lies.add(&kind, &line.judge(&Placement::default()));
        }
        assert_eq!((as_it_lies.failed, as_it_lies.invalid), (0, 0), "{kind}");
        let (mut read, mut random) = (Read::default(), Random::new(5));
        for _ in 0..placements {
            let placement = line.placement(&mut random);
            read.add(&kind, &line.judge(&placement));
        }
        let (share, ratio) = (read.largest() / line.limit_mm, read.scatter_over_sigma());
        println!(
            "{kind:12} {placements} placements: largest deviation {:.4} mm, {share:.2} of the limit; scatter/σ {ratio:.2}, {} FAIL, {} INVALID",
            read.largest(),
            read.failed,
            read.invalid
        );
        if share > MOST_OF_LIMIT || read.failed > 0 || read.invalid * 100 > placements {
            refused.push(kind);
        }
        ratios.push(ratio);
    }
    assert!(refused.is_empty(), "{refused:?}");
    ratios
}

/// Largest deviation of a good part, as a share of the limit.
const MOST_OF_LIMIT: f64 = 0.5;

/// The default head with a quarter of the rays of each pixel.
fn quick(part: Part) -> Scenario {
    Scenario {
        part,
        sub_rays: 2,
        ..Scenario::default()
    }
}

#[test]
#[ignore = "takes an hour: `.ci/run full`"]
fn two_hundred_good_parts_of_every_stock_kind_pass_wherever_they_lie_within_the_tolerance() {
    let ratios = good_parts_pass(20, 200, |part| Scenario {
        part,
        ..Scenario::default()
    });
    // 200 values know a scatter to 5 %.
    assert!(
        ratios.iter().all(|ratio| (0.6..=1.5).contains(ratio)),
        "{ratios:?}"
    );
    let squares = ratios.iter().map(|ratio| ratio * ratio).sum::<f64>();
    let together = (squares / ratios.len() as f64).sqrt();
    assert!((0.8..=1.2).contains(&together), "{together}");
}

/// Ways to measure by a recipe: cycles that begin with each of its sequences, and with two frames.
fn ways(taught: TaughtRecipe) -> Vec<(String, Recipe)> {
    let (manifest, arrays) = (&taught.manifest, &taught.recipe.arrays);
    let begin_with = |production: usize| {
        let frames = manifest.sequences[production].frames.len();
        let manifest = RecipeFile {
            production,
            ..manifest.clone()
        };
        let recipe = Recipe::check(&manifest, arrays.clone()).unwrap();
        (format!("{frames} frames first"), recipe)
    };
    let mut all: Vec<_> = (0..manifest.sequences.len()).map(begin_with).collect();
    let two = with_two_frames(taught);
    all.push(("two frames first".into(), two.recipe));
    all
}

#[test]
#[ignore = "takes an hour: `.ci/run full`"]
fn good_parts_of_every_stock_kind_pass_by_every_sequence_exposure_and_bit_depth() {
    const PLACEMENTS: usize = 20;
    let (mut failed, mut invalid, mut all) = (0, 0, 0);
    for (kind, part) in stock() {
        for (bit_depth, exposures) in [(8, 1), (8, 2), (10, 1), (12, 1)] {
            let scenario = Scenario {
                bit_depth,
                ..quick(part.clone())
            };
            let mut bed = bed(&scenario);
            let taught = taught_exposed(&mut bed, TOLERANCE_MM, exposures).unwrap();
            let limit_mm = taught.manifest.gauges[0].high.unwrap();
            let mut line = Line::of(bed, taught.recipe.clone(), limit_mm, scenario.part.clone());
            let ways = match (bit_depth, exposures) {
                (8, 1) => ways(taught),
                _ => vec![("first as taught".into(), taught.recipe)],
            };
            for (way, recipe) in ways {
                line.plan = planned(&mut line.bed, recipe);
                let (mut read, mut random) = (Read::default(), Random::new(5));
                for _ in 0..PLACEMENTS {
                    let placement = line.placement(&mut random);
                    read.add(&kind, &line.judge(&placement));
                }
                println!(
                    "{kind:12} {bit_depth} bits, {exposures} exposures, {way}: largest deviation {:.4} mm, {} FAIL, {} INVALID of {PLACEMENTS}",
                    read.largest(),
                    read.failed,
                    read.invalid
                );
                failed += read.failed;
                invalid += read.invalid;
                all += PLACEMENTS;
            }
        }
    }
    assert_eq!(failed, 0);
    assert!(invalid * 100 <= all, "{invalid} of {all}");
}

/// Parts with a place that both devices see, x and y in mm.
const DENTED: [(&str, [f64; 2]); 5] = [
    ("sheet_metal", [0.0, -8.0]),
    ("flowerpot", [-60.0, 52.0]),
    ("tube", [0.0, -8.0]),
    ("sphere", [0.0, -8.0]),
    ("cone", [-20.0, 35.0]),
];

/// Puts a dent of 0.3 mm and 8 mm where both devices see it on parts of these kinds that lie anywhere: all fail.
fn dents_fail(kinds: &[&str], placements: usize, scenario: fn(Part) -> Scenario) {
    let mut missed = 0;
    for (kind, [x, y]) in DENTED.into_iter().filter(|(kind, _)| kinds.contains(kind)) {
        let (_, part) = stock().into_iter().find(|(name, _)| name == kind).unwrap();
        let mut line = Line::new(&scenario(part.clone()));
        let mut dented = part;
        let dent = Defect::Dent {
            x,
            y,
            depth_mm: 0.3,
            diameter_mm: 8.0,
        };
        dented.defects_mut().unwrap().push(dent);
        line.part = dented;
        let mut random = Random::new(9);
        let mut least = f64::INFINITY;
        for _ in 0..placements {
            let placement = line.placement(&mut random);
            let found = line.judge(&placement);
            let value = found.gauges[0].value.unwrap_or(f64::NAN);
            least = least.min(-value);
            if found.verdict() != Verdict::Fail {
                println!("{kind}: {value:.4} mm, {:?}", found.reason);
                missed += 1;
            }
        }
        println!(
            "{kind:12} {missed} of {placements} dents of 0.3 mm missed, the least at {least:.3} mm"
        );
    }
    assert_eq!(missed, 0);
}

/// Dents that are narrow: 0.5 mm and 3 mm, seven pixels of the default camera and twenty of a large
/// one.
fn narrow_dents_fail(placements: usize, [width, height]: [u32; 2]) {
    let dent = Defect::Dent {
        x: 0.0,
        y: -8.0,
        depth_mm: 0.5,
        diameter_mm: 3.0,
    };
    let mut scenario = quick(Part::default());
    (scenario.rig.camera.width, scenario.rig.camera.height) = (width, height);
    let mut line = Line::new(&scenario);
    line.part.defects_mut().unwrap().push(dent);
    let mut random = Random::new(13);
    let mut least = f64::INFINITY;
    for _ in 0..placements {
        let placement = line.placement(&mut random);
        let found = line.judge(&placement);
        assert_eq!(found.verdict(), Verdict::Fail, "{found:?}");
        least = least.min(-found.gauges[0].value.unwrap());
    }
    println!(
        "{width} × {height}: {placements} dents of 3 mm found, the least at {least:.3} mm of 0.5"
    );
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn fifty_narrow_dents_fail_in_the_frames_of_small_and_large_cameras() {
    narrow_dents_fail(50, [512, 512]);
    narrow_dents_fail(50, [1456, 1088]);
}

#[test]
fn a_dent_fails_on_two_kinds_of_parts_wherever_it_lies_within_the_tolerance() {
    dents_fail(&["sheet_metal", "flowerpot"], 1, quick);
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn fifty_dents_fail_on_every_kind_of_part_wherever_it_lies_within_the_tolerance() {
    dents_fail(&DENTED.map(|(kind, _)| kind), 50, |part| Scenario {
        part,
        ..Scenario::default()
    });
}
