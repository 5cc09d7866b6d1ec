//! Memory that a plan keeps, and memory while it is made, by counting allocations, so that neither
//! other threads nor the system affect the figures.

use super::{TIMEOUT, naming};
use algo::inspect::FeatureKind;
use algo::inspect::kinds::Flatness;
use allocation_counter::{AllocationInfo, measure};
use appliance::head::calibration::Calibration;
use appliance::recipe::file::archive;
use appliance::recipe::file::archive::Arrays;
use appliance::recipe::plan::Plan;
use appliance::recipe::teach::golden::TaughtRecipe;
use appliance::recipe::teach::teach;
use appliance::recipe::{FeatureFile, GaugeFile, Recipe, RecipeFile};
use appliance::system::headway::Headway;
use sim::Scenario;

const PIXELS: usize = 320 * 240;
/// Samples of the phase function, in f64.
const FUNCTION: usize = 512 * 384 * 8;
/// A plan's bytes per pixel: Φ₀ and z₀ 8, the cubic 9, taught values 2, the factor of deviations 1,
/// the side of their squares 1.
const PLAN: usize = 21;
/// With two shorter sequences first: each has taught values for its noise, and a map. So has the
/// full one, because the golden surface is by the first.
const LONG_PLAN: usize = PLAN + 2 * (4 + 4) + 4;
/// Most bytes per pixel while a plan is made: the recipe's file 30 without the curvature's 4,
/// golden's differences by three sequences 6, the surface 8, the shares along the normal 4, each
/// sequence 3 and 4, and another 4 while a map is made.
const MAKING: usize = 26 + 6 + 8 + 4 + 3 * 4 + 3 * 4 + 4;
/// Copies of the phase function: as it was read, and as it is used.
const FUNCTIONS: usize = 2;
/// Least bytes of a cell: what was taught of it, and the sums of four strips.
const CELL: usize = 112 + 4 * 16;
/// Memory that does not grow with the frame: strips of rows, cells and spans of regions, the
/// manifest.
const BESIDE: usize = 1 << 20;

/// A head of [`PIXELS`], and what it was taught.
fn taught() -> (Calibration, TaughtRecipe) {
    let scenario = Scenario::from_toml(
        "sub_rays = 1\n[rig.camera]\nwidth = 320\nheight = 240\n[rig.projector]\nwidth = 512\nheight = 384\n",
        "small",
    )
    .unwrap();
    let (mut head, stage) = sim::head(&scenario).unwrap();
    let calibration = Calibration::of_scenario(stage.scenario()).unwrap();
    let taught = teach(
        &mut head,
        &calibration,
        &naming(),
        TIMEOUT,
        Headway::silent(),
    )
    .unwrap()
    .seal()
    .unwrap();
    (calibration, taught)
}

/// The plan of a recipe, and the memory that it took.
fn planned(
    file: &RecipeFile,
    arrays: &Arrays,
    calibration: &Calibration,
) -> (Plan, AllocationInfo) {
    let (bytes, _) = archive::pack(file, arrays).unwrap();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    pool.install(|| {
        let mut plan = None;
        let taken = measure(|| {
            let recipe = Recipe::from_bytes(&bytes).unwrap();
            plan = Some(Plan::new(recipe, calibration, true).unwrap());
        });
        println!(
            "a file of {} bytes, a plan of {} steps with {}: {} bytes kept, {} at most while it was made",
            bytes.len(),
            plan.as_ref().map_or(0, Plan::sequence_count),
            plan.as_ref().map_or(0, Plan::bytes),
            taken.bytes_current,
            taken.bytes_max
        );
        (plan.unwrap(), taken)
    })
}

#[test]
fn a_plan_keeps_nothing_twice_and_making_it_takes_little_more_than_its_file() {
    let (calibration, taught) = taught();
    let last = taught.manifest.sequences.len() - 1;
    for (production, each) in [(last, PLAN), (0, LONG_PLAN)] {
        let mut file = taught.manifest.clone();
        file.production = production;
        let (plan, taken) = planned(&file, &taught.recipe.arrays, &calibration);
        assert!(plan.bytes() >= FUNCTION + each * PIXELS);
        let kept = usize::try_from(taken.bytes_current).unwrap();
        assert!(
            kept >= plan.bytes() && kept <= plan.bytes() + BESIDE,
            "{taken:?}"
        );
        let most = FUNCTIONS * FUNCTION + MAKING * PIXELS + BESIDE;
        assert!(taken.bytes_max as usize <= most, "{taken:?}, not {most}");
    }
}

/// Six gauges with the finest cells that are allowed together.
#[test]
fn a_plan_counts_the_memory_of_its_gauges() {
    let (calibration, taught) = taught();
    let mut file = taught.manifest;
    file.gauges.clear();
    let whole = |left: f64| vec![[left, -0.5], [319.5, -0.5], [319.5, 239.5], [left, 239.5]];
    for slot in 1..=6_u16 {
        let name = format!("whole {slot}");
        let region = whole(f64::from(slot));
        let feature = FeatureFile::new(name.clone(), FeatureKind::Surface, region);
        file.features.push(feature);
        let measures = Flatness { smoothing_px: 2 };
        let gauge = GaugeFile {
            high: Some(1.0),
            ..GaugeFile::new(slot, &name, measures, &[&name])
        };
        file.gauges.push(gauge);
    }
    let (plan, taken) = planned(&file, &taught.recipe.arrays, &calibration);
    let (kept, counted) = (taken.bytes_current as usize, plan.bytes());
    assert!(
        kept <= counted + BESIDE,
        "{kept} bytes, counted as {counted}"
    );
    // The same pixels are kept once.
    let region = file.features[0].region.clone();
    for feature in &mut file.features {
        feature.region.clone_from(&region);
    }
    let (shared, _) = planned(&file, &taught.recipe.arrays, &calibration);
    assert!(
        counted - shared.bytes() > 5 * 160 * 120 * CELL,
        "{}",
        shared.bytes()
    );
}
