//! What to project for an adapted pattern, and what to decode the frames with: the folder that
//! `fringed-lab adapt --patterns` writes.

use super::adapt::Adapted;
use algo::pattern::{Encoder, PhaseFunction, Shot, Split, Waveforms};
use algo::units::AbsolutePhase;
use appliance::error::{Exit, Result};
use appliance::output::grey_png;
use appliance::storage::folder::OutputFolder;
use hal::npy;
use rayon::prelude::*;
use serde::Serialize;
use std::path::Path;

/// Reach of a sequence that can show a wrong fringe order, turns: that of two levels of ratios 1
/// and 4/5. Sequences of fewer frames than two levels need are a single level, which is right
/// within 0.40 turn of the expected phase.
const REACH: f64 = 2.3;
const REACH_OF_ONE: f64 = 0.4;

/// Name and version of `sequence.json`.
const FORMAT: &str = "fringed-sequence";
const VERSION: u32 = 1;
/// Names of the other files.
const PHASE_FUNCTION: &str = "phase_function.npy";
const EXPECTED_PHASE: &str = "expected_phase.npy";

/// The most accurate split of so many frames about an expected phase.
pub fn split(frames: usize, waveforms: Waveforms) -> Option<Split> {
    Split::best(frames, REACH, waveforms).or_else(|| Split::best(frames, REACH_OF_ONE, waveforms))
}

/// A sequence of an adapted pattern.
pub struct Projected<'a> {
    function: &'a PhaseFunction,
    /// The expected phase of each camera pixel, row-major in rows of `width`.
    expected: &'a [AbsolutePhase],
    width: usize,
    split: Split,
    shots: Vec<Shot>,
}

/// `sequence.json`.
#[derive(Serialize)]
struct SequenceFile<'a> {
    format: &'a str,
    version: u32,
    frames: Vec<FrameFile>,
    reach_turns: f64,
    unseen_orders: f64,
    phase_function: &'a str,
    expected_phase: &'a str,
}

/// A picture to project, in the words of a recording.
#[derive(Serialize)]
struct FrameFile {
    file: String,
    ratio: f64,
    shift_turns: f64,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    harmonics: Vec<(u8, f64)>,
}

impl<'a> Projected<'a> {
    /// The most accurate sequence of so many frames for the pattern, about the phase that is
    /// expected of a camera with rows of `width` pixels.
    ///
    /// # Errors
    /// In words: there is no sequence of so many frames.
    pub fn new(
        adapted: &'a Adapted,
        width: usize,
        frames: usize,
        waveforms: Waveforms,
    ) -> Result<Self, String> {
        let split = split(frames, waveforms).ok_or_else(|| {
            format!("{frames} frames make no sequence about an expected phase: give 3 to 27")
        })?;
        Ok(Self {
            function: &adapted.function,
            expected: &adapted.expected,
            width,
            shots: split.shots(waveforms),
            split,
        })
    }

    /// The sequence in words, with what it accepts.
    pub fn words(&self) -> String {
        let levels = self.split.levels.iter();
        let levels: Vec<String> = levels
            .map(|(ratio, shifts)| format!("{shifts} of ratio {ratio:.6}"))
            .collect();
        let Split { reach, slips, .. } = self.split;
        let orders = match self.split.levels.len() {
            1 => "a wrong fringe order leaves no residual".to_owned(),
            _ => format!(
                "wrong fringe orders without a residual: {slips:.1e} of the pixels of the least trusted modulation"
            ),
        };
        format!(
            "frames                    {}; right within {reach:.1} turns of the expected phase; {orders}",
            levels.join(" + ")
        )
    }

    /// Writes the folder. Pictures of a longer sequence that was written there before are removed.
    ///
    /// # Errors
    /// If it cannot be written (exit code 73).
    pub fn write(&self, folder: &Path) -> Result<()> {
        let folder = OutputFolder::create(folder)?;
        let file = |at: usize| format!("{at:03}.png");
        let encoder = Encoder::new(None, &self.shots);
        let pictures: Vec<Vec<u8>> = self
            .shots
            .par_iter()
            .map(|&shot| {
                let raster = encoder.raster(self.function, shot);
                grey_png(raster.width, &raster.pixels)
            })
            .collect();
        for (at, picture) in pictures.iter().enumerate() {
            folder.write(&file(at), picture)?;
        }
        let mut beyond = pictures.len();
        while folder.remove(&file(beyond))? {
            beyond += 1;
        }
        let function = npy::write(self.function.columns(), &self.function.turns());
        folder.write(PHASE_FUNCTION, &function)?;
        let turns = |phase: &AbsolutePhase| match phase.is_known() {
            true => phase.turns() as f32,
            false => f32::NAN,
        };
        let expected: Vec<f32> = self.expected.iter().map(turns).collect();
        folder.write(EXPECTED_PHASE, &npy::write(self.width, &expected))?;
        let frames = self.shots.iter().enumerate().map(|(at, shot)| FrameFile {
            file: file(at),
            ratio: shot.ratio,
            shift_turns: shot.shift,
            harmonics: shot.waveform.harmonics().collect(),
        });
        let sequence = SequenceFile {
            format: FORMAT,
            version: VERSION,
            frames: frames.collect(),
            reach_turns: self.split.reach,
            unseen_orders: self.split.slips,
            phase_function: PHASE_FUNCTION,
            expected_phase: EXPECTED_PHASE,
        };
        let json = serde_json::to_string_pretty(&sequence)
            .map_err(Exit::Software.because("write the sequence"))?;
        folder.write("sequence.json", format!("{json}\n").as_bytes())
    }
}
