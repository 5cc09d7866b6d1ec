//! All runs of the chosen parts: parts × optics × seeds × methods.

use super::gallery::{self, View};
use super::methods::{SHOWN_ADAPTIVE, SHOWN_FIXED};
use super::runner::Runner;
use super::scenes::{OpticsKind, Scene};
use super::table::{self, RunRow};
use appliance::head::calibrated::MeasureError;

/// What is to be run.
#[derive(Clone, Debug)]
pub struct Campaign {
    /// The parts.
    pub scenes: Vec<Scene>,
    /// The optics that are asked for; a part's figure may show others as well.
    pub optics: OpticsKind,
    /// Noise seeds 1…seeds.
    pub seeds: u64,
    /// Whether the better sequences show sines instead of the brightest waveforms.
    pub sines: bool,
}

/// The results of all runs.
#[derive(Debug, Default)]
pub struct Results {
    /// One row per run.
    pub rows: Vec<RunRow>,
    /// File names and PNGs of the pictures.
    pub pictures: Vec<(String, Vec<u8>)>,
}

impl Campaign {
    /// Runs everything. `progress` is called with the share done, 0…1, and with the run that
    /// begins.
    ///
    /// # Errors
    /// If the simulated head or a pattern fails.
    pub fn run(&self, progress: &dyn Fn(f64, &str)) -> Result<Results, MeasureError> {
        let mut results = Results::default();
        let settings = self.scenes.iter().flat_map(|scene| {
            let kinds = scene.optics(self.optics);
            kinds.into_iter().map(move |optics| (scene, optics))
        });
        let settings: Vec<_> = settings.collect();
        let count = |(scene, _): &(&Scene, _)| scene.methods(self.sines).len() as u64 * self.seeds;
        let total = settings.iter().map(count).sum::<u64>().max(1) as f64;
        for (scene, optics) in settings {
            let about = format!("{}, {} optics", scene.name, optics.word());
            let done = results.rows.len() as f64;
            progress(done / total, &format!("{about}: light of the scene"));
            let mut runner = Runner::new(scene, optics)?;
            let mut views = Vec::new();
            for seed in 1..=self.seeds {
                for method in scene.methods(self.sines) {
                    let done = results.rows.len() as f64;
                    let words = format!("{about}, seed {seed}: {}", method.name());
                    progress(done / total, &words);
                    let run = runner.run(method, seed)?;
                    let row = RunRow::new(scene, optics, method, seed, run.values);
                    results.rows.push(row);
                    if seed == 1 && [SHOWN_FIXED, SHOWN_ADAPTIVE].contains(&method) {
                        views.push(View::of(method, &run));
                    }
                }
            }
            let name = format!("{}-{}.png", scene.name, optics.word());
            results.pictures.push((name, gallery::png(&views)));
        }
        table::set_ratios(&mut results.rows);
        Ok(results)
    }
}
