//! Measurement in strips compared with exact triangulation and with the comparison of whole maps.

use super::placement::{Bed, TIMEOUT, bed, scenario, taught};
use super::whole_maps::{Comparison, Golden, factors};
use algo::frame::SampleNoise;
use algo::inspect::{Basis, Findings, Measure, Production, Region};
use algo::phase::Trust;
use algo::pipeline::{HeightMap, decode};
use algo::simd::Backend;
use algo::units::{AbsolutePhase, Height, PhaseDelta};
use appliance::head::seam;
use appliance::recipe::file::archive::pack;
use appliance::recipe::plan::Plan;
use appliance::recipe::teach::TaughtRecipe;
use appliance::recipe::{AlignmentKind, Recipe};
use appliance::station::{Inspection, Stages};
use hal::frame::Frame;
use sim::parts::{Cone, Sawtooth, SheetMetal};
use sim::{Part, Placement};
use std::time::Instant;

/// Largest difference between production's heights and the exact ones, mm: the noise of one level
/// of four frames is a hundred times this RMS.
const MAX_RMS_MM: f64 = 0.5e-3;
const MAX_ERROR_MM: f64 = 5e-3;
/// Heights are returned in mm as f32, whose resolution is 1.5e-5 mm at ± 150 mm.
const SINGLE_MM: f64 = 1.6e-5;
/// At least this share of all pixels at all shifts gets its height from a cubic and not from the
/// exact solution. This limits the time, not the error. The sawtooth has the smallest share, 0.798
/// through a lens with a blur of 0.5 px.
const REACHED: f64 = 0.79;
/// The taught σ is stored in units of 32 nm, and σ here is above 10 µm; that of a mean is no worse.
const SIGMA_SHARE: f64 = 2e-3;

pub(crate) fn parts() -> [(&'static str, Part); 3] {
    [
        ("cone", Part::Cone(Cone::default())),
        ("sawtooth", Part::Sawtooth(Sawtooth::default())),
        ("sheet metal", Part::SheetMetal(SheetMetal::default())),
    ]
}

/// A plan with one of the recipe's sequences and without alignment, and the recipe.
pub(crate) fn plan(bed: &Bed, taught: &TaughtRecipe, sequence: usize) -> (Plan, Recipe) {
    plan_with(bed, taught, sequence, AlignmentKind::None)
}

pub(crate) fn plan_with(
    bed: &Bed,
    taught: &TaughtRecipe,
    sequence: usize,
    alignment: AlignmentKind,
) -> (Plan, Recipe) {
    let mut file = taught.manifest.clone();
    file.production = sequence;
    file.alignment = alignment;
    let (bytes, _) = pack(&file, &taught.recipe.arrays).unwrap();
    let recipe = Recipe::from_bytes(&bytes).unwrap();
    let plan = Plan::new(recipe.clone(), &bed.calibration, true).unwrap();
    (plan, recipe)
}

pub(crate) fn frames(bed: &mut Bed, plan: &Plan) -> Vec<Frame> {
    let rasters = plan.rasters(&bed.calibration).unwrap();
    let indices: Vec<usize> = plan.indices(0).to_vec();
    bed.head.load(rasters).unwrap();
    bed.stage.reseed(11);
    let mut frames = Vec::new();
    let mut keep = |_, frame| frames.push(frame);
    bed.head.acquire(&indices, TIMEOUT, &mut keep).unwrap();
    frames
}

#[test]
fn heights_about_golden_are_exact_to_micrometres_within_the_declared_range() {
    for (name, part) in parts() {
        let mut bed = bed(&scenario(part));
        let taught = taught(&mut bed).unwrap();
        let full = taught.manifest.sequences.len() - 1;
        let (plan, _) = plan(&bed, &taught, full);
        let (cubics, exact) = (plan.production().cubics(), plan.production().triangulator());
        let surface = cubics.surface();
        let width = surface.width;
        let mut heights = vec![Height::UNKNOWN; width];
        let (mut all, mut reached) = (0, 0);
        for turns in [-0.49, -0.3, -0.1, -0.02, 0.0, 0.05, 0.2, 0.37, 0.45, 0.49] {
            let delta = PhaseDelta::from_bits((turns * 65_536.0) as i32);
            let (mut squares, mut largest, mut count) = (0.0, 0.0_f64, 0);
            for v in (0..surface.phase.len() / width).step_by(3) {
                let row = &surface.phase[v * width..(v + 1) * width];
                let moved: Vec<_> = row.iter().map(|&phase| phase + delta).collect();
                cubics.heights(Backend::best().unwrap(), v, &moved, &mut heights);
                for (u, height) in heights.iter().enumerate() {
                    if taught.recipe.arrays.valid[v * width + u] == 0 {
                        continue;
                    }
                    all += 1;
                    if !height.is_known() {
                        continue;
                    }
                    let near = height.mm();
                    let solved = exact
                        .solve_near(u as f64, v as f64, moved[u].turns(), near)
                        .unwrap();
                    let error = height.mm() - solved.point.z;
                    squares += error * error;
                    largest = largest.max(error.abs());
                    count += 1;
                }
            }
            reached += count;
            let rms = (squares / f64::from(count.max(1))).sqrt();
            println!(
                "{name} {turns:+.2}: rms {:.4} um, max {:.3} um, {count}",
                rms * 1e3,
                largest * 1e3
            );
            assert!(rms <= MAX_RMS_MM, "{name}, {turns} turns: RMS {rms} mm");
            assert!(
                largest <= MAX_ERROR_MM,
                "{name}, {turns} turns: {largest} mm"
            );
        }
        let share = f64::from(reached) / f64::from(all);
        println!("{name}: {:.2} % reached", share * 100.0);
        assert!(share > REACHED, "{name}: only {share} by the cubics");
    }
}

#[test]
fn strips_find_what_the_comparison_of_whole_maps_finds() {
    for (name, part) in parts() {
        let mut bed = bed(&scenario(part.clone()));
        let taught = taught(&mut bed).unwrap();
        let placement = Placement {
            shift_mm: [0.2, -0.1, 0.15],
            ..Placement::default()
        };
        bed.stage.place(&part, &placement).unwrap();
        for sequence in 0..taught.manifest.sequences.len() {
            let (plan, recipe) = plan(&bed, &taught, sequence);
            let frames = frames(&mut bed, &plan);
            compare(
                &format!("{name}, sequence {sequence}"),
                &plan,
                &recipe,
                &frames,
            );
        }
    }
}

pub(crate) fn compare(name: &str, plan: &Plan, recipe: &Recipe, frames: &[Frame]) {
    let production = plan.production();
    let views: Vec<_> = frames
        .iter()
        .map(|frame| seam::view(frame).unwrap())
        .collect();
    let mut strips = production.strips(37);
    let found = production.inspect(&views, &mut strips, None).unwrap();
    let heights = plan.layers(0, frames).unwrap().height_mm;
    let even = even_noise(recipe);
    let (decoder, window) = (production.decoder(), Some(production.window()));
    let map = decoder.unwrapping().needs_map().then(|| production.map());
    let phases = decode(decoder, &views, map, window).unwrap();
    let mut sigma = vec![f32::NAN; heights.len()];
    let (mut gross, mut compared) = (0, 0);
    for (at, &mm) in heights.iter().enumerate() {
        if mm.is_nan() {
            continue;
        }
        let (u, v) = ((at % phases.width) as f64, (at / phases.width) as f64);
        let phase = phases.phase[at].turns();
        let exact = production
            .triangulator()
            .solve_near(u, v, phase, f64::from(mm))
            .unwrap();
        compared += 1;
        gross += u32::from((exact.point.z - f64::from(mm)).abs() > MAX_ERROR_MM + SINGLE_MM);
        let turns = decoder.phase_noise(phases.modulation[at], even);
        sigma[at] = (turns / exact.slope.abs()) as f32;
    }
    assert_eq!(
        gross, 0,
        "{name}: heights off the exact ones, of {compared}"
    );
    let measured = HeightMap {
        width: phases.width,
        height: heights
            .iter()
            .map(|&mm| Height::from_mm(f64::from(mm)))
            .collect(),
        sigma,
    };
    let golden = golden(recipe, plan);
    let comparison = Comparison::new(&golden, &measured);
    let close = |a: f64, b: f64, share: f64| (a - b).abs() <= share * b.abs();
    for (planned, reading) in recipe.gauges.iter().zip(&found.readings) {
        let reading = reading.unwrap();
        let region = &recipe.features[planned.of[0]].region;
        let expected = expected(&comparison, &planned.measure, region);
        let tolerance = match expected.sigma {
            Some(_) => SINGLE_MM,
            None => 0.0,
        };
        let difference = (reading.value - expected.value).abs();
        assert!(
            difference <= tolerance,
            "{name}, {:?}: {reading:?} {expected:?}",
            planned.measure
        );
        if let (Some(sigma), Some(expected)) = (reading.sigma, expected.sigma) {
            // The extreme of a good part scatters less than the square in which it was found.
            assert!(
                sigma > 0.0 && sigma < expected * (1.0 + SIGMA_SHARE),
                "{name}: sigma {sigma} {expected}"
            );
        }
    }
    assert_eq!(
        found.coverage,
        comparison.golden_coverage(production.window()),
        "{name}"
    );
    let known = measured
        .height
        .iter()
        .filter(|height| height.is_known())
        .count();
    assert_eq!(found.resolved as usize, known, "{name}");
    let noise = rms(&measured.sigma, &golden.height, measured.width);
    assert!(
        close(found.height_noise_mm, noise, SIGMA_SHARE),
        "{name}: {} {noise}",
        found.height_noise_mm
    );
    let taught = rms(
        &golden_sigma(recipe, plan),
        &measured.height,
        measured.width,
    );
    assert!(
        close(found.taught_noise_mm, taught, SIGMA_SHARE),
        "{name}: {} {taught}",
        found.taught_noise_mm
    );
    let skipped = found.skipped;
    let dark = phases.count(Trust::Dark) as u64;
    assert_eq!(
        skipped.dark + skipped.outside,
        dark,
        "{name}: what is outside stays dark in a whole map"
    );
    assert_eq!(
        skipped.unexpected as usize,
        phases.count(Trust::Unexpected),
        "{name}"
    );
}

pub(crate) fn expected(
    comparison: &Comparison<'_>,
    measure: &Measure,
    region: &Region,
) -> algo::inspect::Reading {
    match measure.facts().basis {
        Basis::Squares(side) => comparison.deviation(region, side).unwrap(),
        Basis::Pixels => comparison.coverage(region),
        _ => panic!("a taught recipe measures no {measure:?}"),
    }
}

/// The noise of all pixels alike with which σ_z of the compared part has the RMS that it has by the
/// light of each.
fn even_noise(recipe: &Recipe) -> SampleNoise {
    let arrays = &recipe.arrays;
    let compared = (0..arrays.valid.len()).filter(|&at| arrays.valid[at] != 0);
    let weighted = compared.map(|at| {
        let counts = f64::from(arrays.modulation[at]);
        let weight = (f64::from(arrays.height_slope[at]) / counts).powi(2);
        (weight, weight * recipe.conditions.noise.at(counts).powi(2))
    });
    let sums = weighted.fold((0.0, 0.0), |sum, next| (sum.0 + next.0, sum.1 + next.1));
    SampleNoise::constant((sums.1 / sums.0).sqrt())
}

/// σ of golden's heights with the plan's sequence, mm.
fn golden_sigma(recipe: &Recipe, plan: &Plan) -> Vec<f32> {
    let arrays = &recipe.arrays;
    let decoder = plan.production().decoder();
    let full_scale = f64::from(decoder.full_scale());
    // The modulation as taught is that of the last sequence's waveform.
    let fundamental = |at: usize| recipe.sequences[at].fundamental();
    let brighter = fundamental(0) / fundamental(recipe.sequences.len() - 1);
    let sigma = arrays.modulation.iter().zip(&*arrays.height_slope);
    sigma
        .map(|(&counts, &slope)| {
            let share = (f64::from(counts) / full_scale * 65_535.0).round() as u16;
            let modulation = algo::units::Modulation::from_bits(share);
            let turns = decoder.phase_noise(modulation, recipe.conditions.noise) / brighter;
            (turns * f64::from(slope).abs()) as f32
        })
        .collect()
}

fn golden(recipe: &Recipe, plan: &Plan) -> Golden {
    let arrays = &recipe.arrays;
    // As the first sequence measured it.
    let pixels = arrays.valid.len();
    let turns = |at: usize| match recipe.sequences[0].offset {
        Some(of) => f64::from(arrays.sequence_offset[of * pixels + at]) / 65_536.0,
        None => 0.0,
    };
    let by_first = |at: usize| {
        f64::from(arrays.golden_height[at]) + f64::from(arrays.height_slope[at]) * turns(at)
    };
    // Slopes are taken over pixels that are not compared, too.
    let all: Vec<_> = (0..pixels)
        .map(|at| Height::from_mm(by_first(at)))
        .collect();
    let compared = all.iter().zip(&*arrays.valid);
    Golden {
        width: recipe.conditions.camera.0 as usize,
        factor: factors(recipe, plan, &all),
        sides: arrays.smoothing.to_vec(),
        height: compared
            .map(|(&height, &valid)| match valid {
                0 => Height::UNKNOWN,
                _ => height,
            })
            .collect(),
    }
}

/// Variances are summed on every `WEIGHED`-th row.
const WEIGHED: usize = 4;

/// RMS of sigma over the pixels with a height, on the rows that production uses for it.
fn rms(sigma: &[f32], heights: &[Height], width: usize) -> f64 {
    let weighed = |&(at, _): &(usize, _)| (at / width).is_multiple_of(WEIGHED);
    let pairs = sigma.iter().zip(heights).enumerate().filter(weighed);
    let known: Vec<f64> = pairs
        .map(|(_, pair)| pair)
        .filter(|(sigma, height)| height.is_known() && sigma.is_finite())
        .map(|(&sigma, _)| f64::from(sigma))
        .collect();
    (known.iter().map(|sigma| sigma * sigma).sum::<f64>() / known.len().max(1) as f64).sqrt()
}

#[test]
fn findings_depend_neither_on_strips_nor_on_threads_nor_on_the_back_end() {
    let mut bed = bed(&scenario(Part::SheetMetal(SheetMetal::default())));
    let taught = taught(&mut bed).unwrap();
    for sequence in [1, taught.manifest.sequences.len() - 1] {
        let (plan, _) = plan(&bed, &taught, sequence);
        let frames = frames(&mut bed, &plan);
        let views: Vec<_> = frames
            .iter()
            .map(|frame| seam::view(frame).unwrap())
            .collect();
        let mut production = plan.into_production();
        let find = |production: &Production, threads: usize, rows: usize| -> (Findings, Vec<u32>) {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            let mut heights = vec![0.0; 256 * 256];
            let mut strips = production.strips(rows);
            let mut found = || {
                production
                    .inspect(&views, &mut strips, Some(&mut heights))
                    .unwrap()
            };
            let first = pool.install(&mut found);
            // Used buffers give the same result.
            assert_eq!(pool.install(&mut found), first);
            (first, heights.iter().map(|mm| mm.to_bits()).collect())
        };
        let expected = find(&production, 1, 256);
        assert!(expected.0.resolved > 10_000);
        for backend in Backend::available() {
            production = production.with_backend(backend);
            for (threads, rows) in [(1, 1), (2, 1), (1, 7), (2, 7), (1, 64), (2, 64)] {
                let found = find(&production, threads, rows);
                assert_eq!(
                    found,
                    expected,
                    "{threads} threads, {rows} rows, {}",
                    backend.name()
                );
            }
        }
    }
}

#[test]
fn levels_decoded_on_arrival_give_the_same_inspection() {
    let mut bed = bed(&scenario(Part::SheetMetal(SheetMetal::default())));
    let taught = taught(&mut bed).unwrap();
    for sequence in 0..taught.manifest.sequences.len() {
        let (plan, _) = plan_with(&bed, &taught, sequence, AlignmentKind::Rigid);
        let frames = frames(&mut bed, &plan);
        let levels = plan.production().decoder().levels().len();
        let inspected = |wanted: usize| {
            let (mut arriving, mut arrived) = (plan.arriving(0), 0);
            for count in 1..=frames.len() {
                while arrived < wanted && plan.can_arrive(&arriving, count) {
                    plan.arrive(&mut arriving, &frames[..count]);
                    arrived += 1;
                }
            }
            let inspection = plan.inspect_arrived(&frames, arriving, Instant::now());
            let stages = Stages::default();
            (
                Inspection {
                    stages,
                    ..inspection
                },
                arrived,
            )
        };
        let expected = inspected(0).0;
        assert!(expected.valid_points > 5000);
        // Buffers are reused, and levels that were not decoded on arrival are decoded at the end.
        for wanted in [levels - 1, levels - 1, usize::from(levels > 2), levels - 1] {
            assert_eq!(
                inspected(wanted),
                (expected.clone(), wanted),
                "sequence {sequence}"
            );
        }
    }
}

/// Moves the phases, and so the map.
#[test]
fn unknown_phases_have_no_height() {
    let mut bed = bed(&scenario(Part::Cone(Cone::default())));
    let taught = taught(&mut bed).unwrap();
    let (plan, _) = plan(&bed, &taught, 0);
    let cubics = plan.production().cubics();
    let mut heights = vec![Height::from_nm(0); 256];
    cubics.heights(
        Backend::best().unwrap(),
        128,
        &[AbsolutePhase::UNKNOWN; 256],
        &mut heights,
    );
    assert!(heights.iter().all(|height| !height.is_known()));
}
