//! Weighted deviations: measurement in strips compared with the comparison of whole maps, for parts
//! in place and displaced parts.

use super::placement::{bed, scenario, taught};
use super::production::{compare, expected, frames, parts, plan, plan_with};
use super::whole_maps::{Comparison, Golden, factors};
use algo::inspect::Weight;
use algo::pipeline::HeightMap;
use algo::units::Height;
use appliance::head::seam;
use appliance::recipe::plan::Plan;
use appliance::recipe::teach::TaughtRecipe;
use appliance::recipe::{AlignmentKind, Recipe};
use hal::frame::Frame;
use sim::Placement;

/// Largest difference between the two, mm, on gentle slopes: strips interpolate between nodes where
/// on the taught part a pixel looks, this file computes it for each pixel.
const BROUGHT_MM: f64 = 5e-5;
/// How far that interpolation is off, pixels: a shift by half a pixel is bent by 1e-4 pixels
/// between two nodes. It counts on steep slopes and beside creases.
const BENT_PX: f64 = 2e-4;

/// Sets weights in a pattern, so that squares of a gauge have several different ones. `valid` holds
/// them as [`Weight::bits`]: 1 is full weight, 60 and 190 are 60/256 and 190/256.
fn weigh(taught: &mut TaughtRecipe) {
    let width = taught.manifest.camera.width as usize;
    let valid = std::sync::Arc::make_mut(&mut taught.recipe.arrays.valid);
    let valid = valid.iter_mut().enumerate();
    for (place, valid) in valid.filter(|(_, valid)| **valid != 0) {
        *valid = [1, 60, 190][(place % width / 23 + place / width / 17) % 3];
    }
}

#[test]
fn strips_weigh_deviations_as_the_comparison_of_whole_maps_does() {
    // On a part whose largest square happens to have full weight, weights change nothing.
    let mut changed = 0;
    for (name, part) in parts() {
        let mut bed = bed(&scenario(part.clone()));
        let mut taught = taught(&mut bed).unwrap();
        weigh(&mut taught);
        let placement = Placement {
            shift_mm: [0.2, -0.1, 0.15],
            ..Placement::default()
        };
        bed.stage.place(&part, &placement).unwrap();
        let full = taught.manifest.sequences.len() - 1;
        let (still, recipe) = plan(&bed, &taught, full);
        let taken = frames(&mut bed, &still);
        compare(&format!("{name}, weighed"), &still, &recipe, &taken);
        let (plan, recipe) = plan_with(&bed, &taught, full, AlignmentKind::Rigid);
        // On the cone's steep wall, one pixel more or less with a weight changes micrometres.
        if name != "cone" {
            changed += usize::from(compare_displaced(name, &plan, &recipe, &taken));
        }
    }
    assert!(changed > 0, "the weights change no reading");
}

/// Compares the deviation of an aligned part with maps in which golden is moved to where each pixel
/// sees the part. Returns whether the weights change it.
fn compare_displaced(name: &str, plan: &Plan, recipe: &Recipe, frames: &[Frame]) -> bool {
    let production = plan.production();
    let views: Vec<_> = frames
        .iter()
        .map(|frame| seam::view(frame).unwrap())
        .collect();
    let mut strips = production.strips(37);
    let found = production.inspect(&views, &mut strips, None).unwrap();
    let motion = found.placed.unwrap().motion;
    let heights = plan.layers(0, frames).unwrap().height_mm;
    let width = recipe.conditions.camera.0 as usize;
    let triangulator = production.triangulator();
    let arrays = &recipe.arrays;
    let taught: Vec<_> = arrays
        .golden_height
        .iter()
        .map(|mm| Height::from_mm(f64::from(*mm)))
        .collect();
    let factor = factors(recipe, plan, &taught);
    // Golden as the pixel `at` sees it after the part's motion: the measured z minus its deviation,
    // and the factor there, with and without the weight. It looks `aside` pixels beside its place.
    let moved_golden = |at: usize, z: f64, aside: f64| {
        let point = triangulator.point(at % width, at / width, Height::from_mm(z))?;
        let back = motion.undo(point);
        let (u, v) = triangulator.camera().project(back)?;
        let place = v.floor() as usize * width + u.floor() as usize;
        let corners = [place, place + 1, place + width, place + width + 1];
        if !corners
            .iter()
            .all(|&at| arrays.valid.get(at).is_some_and(|&valid| valid != 0))
        {
            return None;
        }
        let [a, b, c, d] = corners.map(|at| f64::from(arrays.golden_height[at]));
        let (along, down) = (u.fract() + aside, v.fract());
        let (upper, lower) = (a + (b - a) * along, c + (d - c) * along);
        let deviation = back.z - (upper + (lower - upper) * down);
        let weight = Weight::from_bits(arrays.valid[place]).share();
        let factors = [factor[place], factor[place] / weight];
        Some((Height::from_mm(z - deviation), factors))
    };
    let measured = HeightMap {
        width,
        height: heights
            .iter()
            .map(|&mm| Height::from_mm(f64::from(mm)))
            .collect(),
        sigma: vec![f32::NAN; heights.len()],
    };
    let golden = |aside: f64, weighed: bool| {
        let golden = heights.iter().enumerate().map(|(at, &mm)| {
            let z = f64::from(mm);
            let golden = z.is_finite().then(|| moved_golden(at, z, aside)).flatten();
            let (height, factors) = golden.unwrap_or((Height::UNKNOWN, [1.0; 2]));
            (height, factors[usize::from(!weighed)])
        });
        let (height, factor) = golden.unzip();
        Golden {
            sides: recipe.arrays.smoothing.to_vec(),
            width,
            height,
            factor,
        }
    };
    let aside = [-BENT_PX, BENT_PX].map(|aside| golden(aside, true));
    let (golden, unweighed) = (golden(0.0, true), golden(0.0, false));
    let gauge = &recipe.gauges[0];
    let region = &recipe.features[gauge.of[0]].region;
    let reading = found.readings[0].unwrap().value;
    let value = |golden: &Golden| {
        let comparison = Comparison::new(golden, &measured);
        expected(&comparison, &gauge.measure, region).value
    };
    let (expected, full) = (value(&golden), value(&unweighed));
    // Another square may be the extreme one, of the other sign.
    let bent = aside.map(|golden| (value(&golden).abs() - expected.abs()).abs());
    let allowed = BROUGHT_MM + bent[0].max(bent[1]);
    println!("{name}: {reading} {expected} ± {allowed}, without weights {full}");
    assert!((reading - expected).abs() < allowed, "{name}");
    (reading - full).abs() > 10.0 * BROUGHT_MM
}
