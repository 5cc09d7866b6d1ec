//! All runs of the chosen parts: parts × optics × seeds × methods.

use super::methods::{SHOWN_ADAPTIVE, SHOWN_FIXED};
use super::runner::{Run, Runner};
use super::scenes::{OpticsKind, Scene};
use super::table::{self, RunRow};
use algo::pattern::{Encoder, Shot};
use algo::phase::Trust;
use appliance::head::calibrated::MeasureError;
use appliance::output::grey_png;
use hal::frame::Samples;
use hal::npy;

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
    /// File names and contents of what some methods showed, saw and measured.
    pub shown: Vec<(String, Vec<u8>)>,
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
            for seed in 1..=self.seeds {
                for method in scene.methods(self.sines) {
                    let done = results.rows.len() as f64;
                    let words = format!("{about}, seed {seed}: {}", method.name());
                    progress(done / total, &words);
                    let run = runner.run(method, seed)?;
                    let row = RunRow::new(scene, optics, method, seed, run.values);
                    results.rows.push(row);
                    if seed == 1 && [SHOWN_FIXED, SHOWN_ADAPTIVE].contains(&method) {
                        let name = format!("{}-{}-{}", scene.name, optics.word(), method.name());
                        results.shown.extend(shown(&name, &run));
                    }
                }
            }
        }
        table::set_ratios(&mut results.rows);
        Ok(results)
    }
}

/// The finest pattern and its frame as pictures, and the measured heights in mm as an array of the
/// frame's size, NaN where a pixel is not resolved.
fn shown(name: &str, run: &Run) -> [(String, Vec<u8>); 3] {
    let raster = Encoder::new(None, &[]).raster(&run.function, Shot::sine(1.0, 0.0));
    let frame = &run.measured.frames[run.finest];
    let format = frame.format();
    let bytes: Vec<u8> = match frame.samples() {
        Samples::Eight(samples) => samples.to_vec(),
        Samples::Sixteen(samples) => {
            let shift = format.bit_depth.saturating_sub(8);
            samples.iter().map(|s| (s >> shift) as u8).collect()
        }
    };
    let rows = bytes.chunks(format.stride);
    let seen: Vec<u8> = rows
        .flat_map(|row| &row[..format.width as usize])
        .copied()
        .collect();
    let measured = &run.measured;
    let heights = measured.heights.height.iter().zip(&measured.phases.trust);
    let heights: Vec<f32> = heights
        .map(|(height, trust)| match trust {
            Trust::Resolved => height.mm() as f32,
            _ => f32::NAN,
        })
        .collect();
    [
        (
            format!("{name}-pattern.png"),
            grey_png(raster.width, &raster.pixels),
        ),
        (
            format!("{name}-frame.png"),
            grey_png(format.width as usize, &seen),
        ),
        (
            format!("{name}-height.npy"),
            npy::write(measured.heights.width, &heights),
        ),
    ]
}
