//! Parts that mirror, are black or printed on, against the same part of matte paint: taught with one click,
//! and measured where they lie elsewhere. What light by way of another face does to heights.

use crate::every_part::{Line, stock};
use crate::limits::cycle;
use crate::placement::{bed, one_click, taught_within};
use algo::pattern::{PhaseFunction, Shot};
use algo::phase::Trust;
use algo::units::AbsolutePhase;
use appliance::head::calibrated::{CalibratedHead, MeasuredPart, straight_fringes};
use appliance::station::Verdict;
use sim::parts::Defect;
use sim::scenario::RigDevice;
use sim::{Material, Part, Placement, Print, Scenario};
use std::time::Duration;
use tests::random::Random;

const TIMEOUT: Duration = Duration::from_secs(2);
/// A height farther off is wrong, mm.
const WRONG_MM: f64 = 0.3;

fn part(kind: &str) -> Part {
    let mut stock = stock().into_iter();
    stock.find(|(name, _)| name == kind).unwrap().1
}

fn scenario(kind: &str, material: Material) -> Scenario {
    Scenario {
        part: part(kind),
        sub_rays: 2,
        material: Some(material),
        ..Scenario::default()
    }
}

/// Of wholly lit pixels: how many there are, and of those that are resolved the squares of the errors in mm.
#[derive(Default)]
struct Seen {
    lit: usize,
    squares: Vec<f64>,
    wrong: usize,
}

impl Seen {
    fn rms_um(&self) -> f64 {
        1e3 * (self.squares.iter().sum::<f64>() / self.squares.len() as f64).sqrt()
    }

    /// Measures the part where a placement puts it, by one of the sequences.
    fn add(&mut self, line: &mut Line, part: &Part, placement: &Placement, sequence: usize) {
        line.bed.stage.place(part, placement).unwrap();
        let mut frames = Vec::new();
        let indices = line.plan.indices(sequence);
        let mut keep = |_, frame| frames.push(frame);
        line.bed.head.acquire(indices, TIMEOUT, &mut keep).unwrap();
        let heights = line.plan.layers(sequence, &frames).unwrap().height_mm;
        let truth = line.bed.stage.truth();
        for at in (0..heights.len()).filter(|at| truth.class[*at] == 2) {
            self.lit += 1;
            let error = f64::from(heights[at] - truth.height[at]);
            if error.is_finite() {
                self.squares.push(error * error);
                self.wrong += usize::from(error.abs() > WRONG_MM);
            }
        }
    }
}

/// What the longest sequence sees of a part of each material.
fn seen(kind: &str, materials: &[Material], placements: usize) -> Vec<Seen> {
    let of = |material: &Material| {
        let scenario = scenario(kind, *material);
        let mut line = Line::new(&scenario);
        let (mut random, mut seen) = (Random::new(17), Seen::default());
        let longest = line.plan.sequence_count() - 1;
        for _ in 0..placements {
            let placement = line.placement(&mut random);
            seen.add(&mut line, &scenario.part, &placement, longest);
        }
        seen
    };
    materials.iter().map(of).collect()
}

#[test]
fn what_mirrors_is_seen_nearly_as_whole_as_what_does_not() {
    let materials = [Material::Matte, Material::Oiled];
    let all = seen("sheet_metal", &materials, 2);
    let [matte, oiled] = &all[..] else { panic!() };
    let share = oiled.squares.len() as f64 / matte.squares.len() as f64;
    println!(
        "oiled: {share:.3} of matte, {:.1} and {:.1} um",
        oiled.rms_um(),
        matte.rms_um()
    );
    assert!(share > 0.97 && oiled.rms_um() < 2.1 * matte.rms_um());
    assert!(oiled.wrong + matte.wrong == 0);
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn every_round_and_flat_part_that_mirrors_is_seen_nearly_as_whole() {
    let materials = [Material::Matte, Material::RolledSteel, Material::Oiled];
    let (mut wrong, mut all) = (0, 0);
    for kind in ["sheet_metal", "cone", "sphere", "tube"] {
        let found = seen(kind, &materials, 50);
        for (material, seen) in materials.iter().zip(&found) {
            let share = seen.squares.len() as f64 / found[0].squares.len() as f64;
            let ratio = seen.rms_um() / found[0].rms_um();
            println!(
                "{kind} {material:?}: {share:.4} of matte, RMS {:.1} um, {ratio:.2} of matte, {} of {} wrong",
                seen.rms_um(),
                seen.wrong,
                seen.squares.len()
            );
            let least = if *material == Material::Oiled {
                0.93
            } else {
                0.97
            };
            assert!(share > least);
            // Where the tube's wall is steep, placements take fringe orders beyond what 12 frames unwrap, of
            // matte paint as well.
            if kind != "tube" {
                (wrong, all) = (wrong + seen.wrong, all + seen.squares.len());
            }
        }
    }
    println!("{wrong} of {all} are off by more than {WRONG_MM} mm");
    assert!(wrong * 100_000 <= all);
}

#[test]
fn a_black_part_with_a_print_is_taught_and_its_edges_are_refused() {
    let mut printed = scenario("sphere", Material::BlackPlastic);
    printed.print = Some(Print::default());
    let (width, height) = (256, 256);
    (printed.rig.camera.width, printed.rig.camera.height) = (width, height);
    let taught = one_click(&mut bed(&printed)).unwrap();
    assert!(taught.manifest.light_edges);
    // It is dark but for the print, and exposed for longer.
    assert!(taught.manifest.exposures > 1, "{:?}", taught.choice.reasons);
    let said = taught.choice.reasons.join(" ");
    assert!(said.contains("times as long"), "{said}");
    let mut line = Line::new(&printed);
    let mut seen = Seen::default();
    let placement = Placement {
        shift_mm: [0.3, -0.2, 0.1],
        ..Placement::default()
    };
    let longest = line.plan.sequence_count() - 1;
    seen.add(&mut line, &printed.part, &placement, longest);
    let RigDevice { width, height, .. } = printed.rig.camera;
    println!(
        "{} of {} pixels, RMS {:.1} um",
        seen.squares.len(),
        width * height,
        seen.rms_um()
    );
    let far = |square: &&f64| square.sqrt() > 5e-3 * seen.rms_um();
    let far = seen.squares.iter().filter(far).count();
    assert!(10 * seen.squares.len() > 9 * seen.lit, "{}", seen.lit);
    // Hardly an edge of the print is taken for a step.
    assert!(300 * far < seen.squares.len(), "{far}");
    // A matte part has no edges of light on its faces.
    let matte = one_click(&mut bed(&scenario("cone", Material::Matte))).unwrap();
    assert!(!matte.manifest.light_edges && matte.recipe.arrays.amplitude.is_empty());
}

/// Good sheets of a material and dented ones, wherever they lie: no verdict is wrong.
#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn sheets_that_mirror_pass_and_their_dents_fail_also_in_the_highlight() {
    const GOOD: usize = 500;
    const DENTS: usize = 50;
    for material in [Material::RolledSteel, Material::Oiled] {
        let mut line = Line::new(&scenario("sheet_metal", material));
        let mut random = Random::new(29);
        let judged = |line: &mut Line, part: &Part, random: &mut Random| {
            let placement = line.placement(random);
            line.bed.stage.place(part, &placement).unwrap();
            cycle(&mut line.bed, &line.plan).verdict()
        };
        let good = part("sheet_metal");
        let verdicts: Vec<Verdict> = (0..GOOD)
            .map(|_| judged(&mut line, &good, &mut random))
            .collect();
        let mut dented = Vec::new();
        for at in 0..DENTS {
            // Left of the holes, or where the face mirrors, between a hole and the crease.
            let [x, y] = [random.share(), random.share()];
            let (x, y) = match at % 2 {
                0 => (-55.0 + 45.0 * x, -12.0 + 24.0 * y),
                _ => (36.0 + 3.0 * x, -14.0 + 36.0 * y),
            };
            let dent = Defect::Dent {
                x,
                y,
                depth_mm: 0.3,
                diameter_mm: 8.0,
            };
            let mut dent_of = good.clone();
            dent_of.defects_mut().unwrap().push(dent);
            dented.push(judged(&mut line, &dent_of, &mut random));
        }
        let count = |all: &[Verdict], verdict| all.iter().filter(|of| **of == verdict).count();
        let [pass, fail] = [Verdict::Pass, Verdict::Fail].map(|of| count(&verdicts, of));
        let [missed, found] = [Verdict::Pass, Verdict::Fail].map(|of| count(&dented, of));
        println!(
            "{material:?}: {pass} of {GOOD} good ones PASS, {fail} FAIL; {found} of {DENTS} dents FAIL, {missed} PASS"
        );
        assert!(fail == 0 && 100 * pass >= 99 * GOOD);
        assert!(missed == 0 && 10 * found >= 9 * DENTS);
    }
}

/// The part, measured with a pattern, with and without light by way of another face.
fn with_and_without(
    scenario: &Scenario,
    (function, shots, map): (&PhaseFunction, &[Shot], Option<&[AbsolutePhase]>),
) -> [MeasuredPart; 2] {
    [0, 1].map(|bounces| {
        let mut bed = bed(&Scenario {
            bounces,
            ..scenario.clone()
        });
        let mut head = CalibratedHead::new(&mut bed.head, &bed.calibration, TIMEOUT);
        head.measure(function, shots, map, &|_| ()).unwrap()
    })
}

/// What a bounce does to heights: printed, and asserted of the patterns of production.
#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn a_bounce_is_averaged_out_by_dense_levels_and_not_by_geometric_ones() {
    for (kind, diffuse) in [
        ("sheet_metal", 0.35),
        ("sheet_metal", 0.86),
        ("handset", 0.35),
        ("handset", 0.86),
    ] {
        let mut scenario = Scenario {
            part: part(kind),
            sub_rays: 2,
            ..Scenario::default()
        };
        scenario.light.diffuse = diffuse;
        let taught = taught_within(&mut bed(&scenario), 1.0).unwrap();
        let raster = &scenario.rig.projector;
        let straight = straight_fringes((raster.width as usize, raster.height as usize)).unwrap();
        let full = &taught.manifest.sequences.last().unwrap().frames;
        let (function, golden) = (&taught.recipe.function, &taught.recipe.arrays.golden_phase);
        let golden: Vec<AbsolutePhase> = golden
            .iter()
            .map(|turns| AbsolutePhase::from_turns(*turns))
            .collect();
        for (name, pattern) in [
            ("geometric", (&straight.0, &straight.1[..], None)),
            ("dense", (function, &full[..], Some(&golden[..]))),
        ] {
            let [direct, both] = with_and_without(&scenario, pattern);
            let (mut lit, mut far, mut most, mut squares) = (0, 0, 0.0_f64, 0.0);
            let (dark, bright) = (&direct.frames[0].counts(), &both.frames[0].counts());
            for at in 0..direct.phases.trust.len() {
                let resolved =
                    [&direct, &both].map(|part| part.phases.trust[at]) == [Trust::Resolved; 2];
                let mm = both.heights.height[at].mm() - direct.heights.height[at].mm();
                if !resolved || bright[at] - dark[at] < 2.0 {
                    continue;
                }
                lit += 1;
                squares += mm * mm;
                most = most.max(mm.abs());
                far += usize::from(mm.abs() > 5.0 * f64::from(both.heights.sigma[at]));
            }
            let rms = 1e3 * (squares / f64::from(lit.max(1))).sqrt();
            println!(
                "{kind}, diffuse {diffuse}, {name}: {lit} pixels with a bounce of 2 counts, RMS {rms:.1} um, most {:.0} um, {far} beyond 5 sigma",
                1e3 * most
            );
        }
    }
}
