//! A head with few pixels, and a part that was taught on it, for the targets of recipes.

use crate::small_head::tiny_head;
use appliance::head::calibration::Calibration;
use appliance::recipe::plan::Plan;
use appliance::recipe::teach::{Naming, teach};
use appliance::recipe::{Recipe, RecipeFile};
use appliance::system::headway::Headway;
use hal::frame::Frame;
use sim::Scenario;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

/// Longest wait for a frame of the simulated head.
const TIMEOUT: Duration = Duration::from_secs(5);

/// The part as taught.
pub struct Part {
    /// The calibration of the head.
    pub calibration: Calibration,
    /// The manifest of the recipe, number 1.
    pub file: RecipeFile,
    /// Its checked form.
    pub recipe: Recipe,
    /// Its file.
    pub bytes: Vec<u8>,
    /// One frame of each of the plan's rasters.
    frames: Vec<Frame>,
}

/// The part, taught once.
pub static PART: LazyLock<Part> = LazyLock::new(Part::taught);

impl Part {
    fn taught() -> Self {
        let scenario =
            Scenario::from_toml(&tiny_head(24, 18), "the fuzz targets' head").expect("a scenario");
        let (mut head, stage) = sim::head(&scenario).expect("a head");
        let calibration =
            Calibration::of_scenario(stage.scenario()).expect("models that can be used");
        let naming = Naming {
            number: 1,
            part_number: "P-1".into(),
            name: "plane".into(),
            taught_by: "the fuzz targets".into(),
            taught_at_unix_s: 0,
            placement_tolerance_mm: 0.5,
            exposures: None,
            everything: false,
            marking: Default::default(),
            empty: None,
            limit_mm: Some(0.15),
        };
        let taught = teach(&mut head, &calibration, &naming, TIMEOUT, Headway::silent());
        let taught = taught.expect("a plane can be taught").seal();
        let taught = taught.expect("and packed");
        let (file, recipe, bytes) = (taught.manifest, taught.recipe, taught.bytes);
        let plan = Plan::new(recipe.clone(), &calibration, true).expect("a plan");
        let rasters = plan.rasters(&calibration).expect("rasters");
        let all: Vec<usize> = (0..rasters.len()).collect();
        head.load(rasters).expect("loaded");
        let mut frames = Vec::new();
        let mut keep = |_, frame| frames.push(frame);
        head.acquire(&all, TIMEOUT, &mut keep).expect("frames");
        Self {
            calibration,
            file,
            recipe,
            bytes,
            frames,
        }
    }

    /// Judges the part by another recipe, with each of its sequences for which there are enough
    /// frames.
    pub fn judge(&self, plan: &Plan) {
        for sequence in 0..plan.sequence_count() {
            if let Some(frames) = self.frames.get(..plan.indices(sequence).len()) {
                std::hint::black_box(plan.inspect(sequence, frames, Instant::now()));
            }
        }
    }
}
