//! Boundary values in the manifest and the arrays of a recipe.

use super::{Tally, one_in};
use crate::head::calibration::Calibration;
use crate::head::exposing::Exposing;
use crate::recipe::file::archive::{members, pack, parse, seal};
use crate::recipe::plan::Plan;
use crate::recipe::store::exchange::Destination;
use crate::recipe::teach::golden::Naming;
use crate::recipe::teach::teach;
use crate::recipe::{DatumFile, Recipe, RecipeFile, Store};
use crate::system::headway::Headway;
use algo::inspect::{FeatureKind, Measure};
use hal::frame::Frame;
use serde_json::Value;
use sim::Scenario;
use std::cell::Cell;
use std::mem::discriminant;
use std::sync::Arc;
use std::time::{Duration, Instant};

const TIMEOUT: Duration = Duration::from_secs(5);
/// A head of few pixels.
pub(super) const HEAD: &str = "sub_rays = 1
part = { kind = \"plane\" }
[rig.camera]
width = 64
height = 48
fov_deg = [20.0, 15.0]
[rig.projector]
width = 256
height = 192
";

/// A small head with a recipe, and the frames of a part.
pub(crate) struct Bed {
    pub calibration: Calibration,
    pub file: RecipeFile,
    pub recipe: Recipe,
    pub bytes: Vec<u8>,
    frames: Vec<Frame>,
}

impl Bed {
    pub fn new() -> Self {
        let scenario = Scenario::from_toml(HEAD, "head").unwrap();
        let (mut head, stage) = sim::head(&scenario).unwrap();
        let calibration = Calibration::of_scenario(stage.scenario()).unwrap();
        let naming = Naming {
            number: 1,
            part_number: "P".into(),
            name: "part".into(),
            taught_by: String::new(),
            taught_at_unix_s: 0,
            placement_tolerance_mm: 1.0,
            exposures: None,
            everything: false,
            marking: Default::default(),
            empty: None,
            limit_mm: Some(0.15),
        };
        let taught = teach(&mut head, &calibration, &naming, TIMEOUT, Headway::silent()).unwrap();
        let taught = taught.seal().unwrap();
        let plan = Plan::new(taught.recipe.clone(), &calibration, true).unwrap();
        head.load(plan.rasters(&calibration).unwrap()).unwrap();
        let mut frames = Vec::new();
        head.acquire_while(plan.indices(0), TIMEOUT, &mut |_, frame| {
            frames.push(frame);
            true
        })
        .unwrap();
        Self {
            calibration,
            file: taught.manifest,
            recipe: taught.recipe,
            bytes: taught.bytes,
            frames,
        }
    }

    /// Plans a recipe and judges a part with it, as the station would; any verdict will do.
    pub fn use_recipe(&self, recipe: Recipe) -> Result<(), String> {
        let plan = Plan::new(recipe, &self.calibration, true).map_err(|error| error.to_string())?;
        for sequence in 0..plan.sequence_count() {
            // As many frames as the sequence has; their shifts do not matter.
            let count = plan.indices(sequence).len();
            let frames: Vec<Frame> = self.frames.iter().cloned().cycle().take(count).collect();
            drop(plan.inspect(sequence, &frames, Instant::now()));
            drop(plan.layers(sequence, &frames));
        }
        Ok(())
    }
}

#[test]
fn a_boundary_value_in_a_recipe_is_refused_by_its_key_or_the_recipe_judges_a_part() {
    // Of those that can be read one in so many judges a part.
    let judged = one_in() * one_in();
    let bed = Bed::new();
    let (file, arrays) = (&bed.file, &bed.recipe.arrays);
    let mut full = file.clone();
    full.fingerprint = "0".repeat(64);
    full.exposing = Some(Exposing {
        exposure_us: 5000,
        gain: 2.0,
    });
    for kind in FeatureKind::ALL {
        for place in 0..2 {
            let mut feature = full.features[0].clone();
            feature.name = format!("{} {place}", kind.name());
            feature.kind = kind;
            feature.region[0][0] += place as f64;
            if kind == FeatureKind::Plane {
                feature.thickness_mm = Some(1.0);
            } else if kind.is_contour() {
                (feature.plane, feature.rim_mm) = (Some("plane 0".into()), Some(0.1));
            } else if kind == FeatureKind::Section {
                feature.region.clear();
                (feature.from, feature.to) = (Some([5.0, 9.0]), Some([40.0, 30.0]));
                (feature.left, feature.right) = (Some([0.0, 3.0]), Some([6.0, 9.0]));
                (feature.width_mm, feature.edge_mm) = (Some(10.0), Some(1.5));
            }
            full.features.push(feature);
        }
    }
    full.datums.push(DatumFile {
        name: "datum".into(),
        of: ["plane 0", "circle 0", "circle 1"].map(Into::into).to_vec(),
    });
    let mut kinds = Measure::examples();
    // Golden has no contours and no joint in these regions: nothing measures them.
    let of_heights = |kind: &Measure| {
        let heights = [FeatureKind::Surface, FeatureKind::Plane];
        let takes = kind.facts().takes;
        takes.iter().all(|place| heights.contains(&place[0]))
    };
    kinds.retain(|kind| {
        let mut taught = file.gauges.iter();
        of_heights(kind) && taught.all(|of| discriminant(&of.measures) != discriminant(kind))
    });
    for (at, kind) in kinds.into_iter().enumerate() {
        let mut gauge = full.gauges[0].clone();
        gauge.slot = 30 + at as u16;
        gauge.name = format!("kind {at}");
        let takes = kind.facts().takes.iter().enumerate();
        gauge.of = takes
            .map(|(place, kinds)| format!("{} {place}", kinds[0].name()))
            .collect();
        gauge.measures = kind;
        (gauge.low, gauge.high) = (Some(-0.5), Some(0.5));
        if gauge.measures.facts().unit == crate::station::Unit::Share {
            gauge.low = Some(0.0);
        }
        full.gauges.push(gauge);
    }
    let tree = serde_json::to_value(&full).unwrap();
    let write = |tree: &Value| serde_json::to_string_pretty(tree).unwrap();
    let read = |text: &str| {
        // Parsed alone first: most cases are refused by the manifest, and need no archive with
        // arrays.
        parse(text)?;
        let (bytes, _) = seal(text, members(file, arrays), 0, Headway::silent()).unwrap();
        Recipe::from_bytes(&bytes)
    };
    bed.use_recipe(read(&write(&tree)).unwrap()).unwrap();
    let mut tally = Tally::default();
    let readable = Cell::new(0);
    tally.walk(&tree, |place, value| {
        let recipe = read(&place.replaced(&tree, value, write))?;
        readable.set(readable.get() + 1);
        match readable.get() % judged {
            0 => bed.use_recipe(recipe),
            _ => Ok(()),
        }
    });
    tally.end("recipe", 6500);
}

#[test]
fn arrays_of_any_numbers_never_panic() {
    let bed = Bed::new();
    let mut cases = 0;
    for number in [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::MAX,
        f64::MIN,
        f64::MIN_POSITIVE,
        5e-324,
        -1.0,
        0.0,
        2.0,
        128.0,
        1e9,
    ] {
        // One array at a time: all of its values, every third, or every 1500th.
        for (array, every) in (0..8).flat_map(|array| [1, 3, 1500].map(|every| (array, every))) {
            cases += 1;
            // Other arrays for each number.
            if (cases + cases / 24) % one_in() != 0 {
                continue;
            }
            let mut arrays = bed.recipe.arrays.clone();
            let single = [
                &mut arrays.golden_height,
                &mut arrays.height_slope,
                &mut arrays.height_curvature,
                &mut arrays.modulation,
                &mut arrays.phase_reach,
            ];
            if let Some(values) = single.into_iter().nth(array) {
                let places = Arc::make_mut(values).iter_mut().step_by(every);
                places.for_each(|value| *value = number as f32);
            } else if array < 7 {
                let double = [&mut arrays.golden_phase, &mut arrays.phase_function];
                let values = double.into_iter().nth(array - 5).unwrap();
                let places = Arc::make_mut(values).iter_mut().step_by(every);
                places.for_each(|value| *value = number);
            } else {
                let places = Arc::make_mut(&mut arrays.valid).iter_mut().step_by(every);
                places.for_each(|value| *value = number as u8);
            }
            // Either result is right, as long as nothing panics.
            drop(Recipe::check(&bed.file, arrays).map(|recipe| bed.use_recipe(recipe)));
        }
    }
    println!("{cases} arrays of extreme numbers");
    assert_eq!(cases, 288);
}

#[test]
fn a_recipe_for_a_projector_of_four_billion_columns_is_refused_and_does_not_replace_a_good_one() {
    let bed = Bed::new();
    let mut file = bed.file.clone();
    file.fingerprint = "0".repeat(64);
    (file.projector.width, file.projector.height) = (u32::MAX, u32::MAX);
    file.pattern = serde_json::from_str(r#"{ "kind": "vertical", "fringes": 20.0 }"#).unwrap();
    let text = serde_json::to_string(&file).unwrap();
    let mut without = members(&file, &bed.recipe.arrays);
    without.retain(|(name, _)| *name != "phase_function.npy");
    let (bytes, _) = seal(&text, without, 0, Headway::silent()).unwrap();
    let words = Recipe::from_bytes(&bytes).unwrap_err();
    assert!(
        words
            .words
            .contains("projector.width is 4294967295: write 1 to 8192"),
        "{words}"
    );
    // As if somebody had stored it in the folder: it is listed with its problem, and the previous
    // generation is used. Storing it again over a good recipe does not displace the last good
    // generation either.
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).unwrap();
    store.save(1, &bed.bytes).unwrap();
    store.save(1, &bytes).unwrap();
    assert!(
        store.list()[0]
            .problem
            .as_deref()
            .unwrap()
            .contains("projector.width")
    );
    let loaded = store.load(1).unwrap();
    assert!(loaded.fallback.unwrap().contains("projector.width"));
    store.save(1, &bed.bytes).unwrap();
    store.save(1, &bytes).unwrap();
    bed.use_recipe(store.load(1).unwrap().recipe).unwrap();
}

#[test]
fn a_recipe_is_tried_out_on_the_head_before_it_is_taken() {
    let bed = Bed::new();
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&folder.path().join("recipes")).unwrap();
    let arriving = folder.path().join("arriving.recipe");
    let try_out = |recipe| Ok(Plan::try_out(recipe, &bed.calibration)?);
    let import = |bytes: &[u8]| {
        std::fs::write(&arriving, bytes).unwrap();
        store
            .import(&arriving, Destination::default(), "replace it", try_out)
            .map_err(|error| error.to_string())
    };
    let changed = |change: fn(&mut RecipeFile)| {
        let mut file = bed.file.clone();
        change(&mut file);
        pack(&file, &bed.recipe.arrays).unwrap().0
    };
    // Each value is within its bounds, but together they do not fit this head.
    let beside = import(&changed(|file| file.range_mm = [-10.0, 9000.0])).unwrap_err();
    assert!(beside.contains("range"), "{beside}");
    let foreign = import(&changed(|file| file.calibration = "0".repeat(64))).unwrap_err();
    assert!(foreign.contains("was made for calibration"), "{foreign}");
    assert!(store.numbers().is_empty());
    import(&bed.bytes).unwrap();
    assert_eq!(store.numbers(), [1]);
}
