//! Bounds of `recipe.json`: a value outside is refused, naming its key, before anything is computed
//! with it. Those of single values stand beside them in [`super::file`].
//!
//! The same bounds hold for files that are read and for edits; `docs/formats.md` lists them.

use super::file::{LONGEST_NAME, PatternFile, RecipeFile, SequenceFile};
use super::gauge::GaugeFile;
use crate::station::MAX_GAUGES;
use algo::inspect::{MAX_PLACES, Marking};
use algo::pattern::{MAX_FRAMES, Sequence, Shot};
use hal::bounds::{
    Bound, Fields, MAX_FRINGES, MAX_RANGE_MM, MAX_SHIFT_TURNS, OutOfBounds, RATIOS, clipped,
    length, text, within,
};

/// Sequences that a part can be measured with; teaching makes four.
const MAX_SEQUENCES: usize = 8;
/// Corners of an outline, and places of each kind that are touched.
const MAX_CORNERS: usize = 256;
const MAX_TOUCHES: usize = 64;
/// Slots of gauges.
const MAX_SLOT: u16 = MAX_GAUGES as u16;

/// Checks what a person has marked.
///
/// # Errors
/// In words that name the key, the number and the bounds.
pub fn check_marking(marking: &Marking) -> Result<(), OutOfBounds> {
    let corners = marking.outline.len();
    if corners > 0 {
        length("marking.outline", corners, 3, MAX_CORNERS)?;
    }
    length("marking.part", marking.part.len(), 0, MAX_TOUCHES)?;
    length("marking.others", marking.others.len(), 0, MAX_TOUCHES)
}

impl RecipeFile {
    /// Checks each value by itself; [`Recipe::check`](super::Recipe::check) checks that they fit
    /// each other and the arrays.
    ///
    /// # Errors
    /// In words that name the key, the value and the bounds.
    pub fn check_bounds(&self) -> Result<(), String> {
        self.check_whole()?;
        self.check_features()?;
        self.check_count()?;
        let largest = self.longest();
        each("gauges", ": ", &self.gauges, |gauge| {
            gauge.check_bounds(largest)
        })?;
        check_slots(&self.gauges)?;
        self.check_references()
    }

    /// As [`Self::check_bounds`], of what is neither feature nor datum system nor gauge.
    ///
    /// # Errors
    /// As above.
    pub(super) fn check_whole(&self) -> Result<(), String> {
        Fields.check("", self)?;
        if !self.part_number.is_ascii() {
            let key = format!("part_number {:?}", self.part_number);
            return Err(format!("{key} has characters that are not ASCII"));
        }
        if let PatternFile::Vertical { fringes } | PatternFile::Horizontal { fringes } =
            self.pattern
        {
            within("pattern.fringes", fringes, 1e-3, MAX_FRINGES)?;
        }
        check_marking(&self.marking)?;
        length("sequences", self.sequences.len(), 1, MAX_SEQUENCES)?;
        each(
            "sequences",
            ".",
            &self.sequences,
            SequenceFile::check_bounds,
        )?;
        within("production", self.production, 0, self.sequences.len() - 1)?;
        let [low, high] = self.range_mm;
        within("range_mm", low, -MAX_RANGE_MM, MAX_RANGE_MM)?;
        within("range_mm", high, low, MAX_RANGE_MM)?;
        if let Some(counts) = self.golden_offset_counts {
            let full_scale = f64::from((1_u32 << self.camera.bit_depth) - 1);
            within("golden_offset_counts", counts, 0.0, full_scale)?;
        }
        Ok(())
    }

    /// Checks how many gauges there are.
    ///
    /// # Errors
    /// As above.
    pub(super) fn check_count(&self) -> Result<(), String> {
        Ok(length("gauges", self.gauges.len(), 1, MAX_GAUGES)?)
    }

    /// Pixels of the longer side of the camera's frames.
    pub(super) fn longest(&self) -> usize {
        self.camera.width.max(self.camera.height) as usize
    }
}

/// Refuses slots that two gauges have, and gauges that are not in the order of their slots.
pub(super) fn check_slots(gauges: &[GaugeFile]) -> Result<(), String> {
    let mut pairs = gauges.iter().zip(gauges.iter().skip(1));
    let Some((first, second)) = pairs.find(|(first, second)| first.slot >= second.slot) else {
        return Ok(());
    };
    let [one, other] = [first, second].map(|gauge| clipped(&gauge.name));
    Err(match first.slot == second.slot {
        true => format!(
            "gauges {one:?} and {other:?} both have slot {}: give each its own",
            first.slot
        ),
        false => format!(
            "gauge {other:?} of slot {} stands behind {one:?} of slot {}: write them in the order of their slots",
            second.slot, first.slot
        ),
    })
}

/// Checks each element of the list `name`; an error begins with the element's place and
/// `separator`.
pub(super) fn each<T>(
    name: &str,
    separator: &str,
    list: &[T],
    check: impl Fn(&T) -> Result<(), String>,
) -> Result<(), String> {
    let mut places = list.iter().enumerate();
    places.try_for_each(|(at, element)| {
        check(element).map_err(|error| format!("{name}[{at}]{separator}{error}"))
    })
}

impl SequenceFile {
    fn check_bounds(&self) -> Result<(), String> {
        length("frames", self.frames.len(), 3, MAX_FRAMES)?;
        let [low, high] = RATIOS;
        each("frames", ": ", &self.frames, |shot: &Shot| {
            within("ratio", shot.ratio, low, high)?;
            within("shift", shot.shift, -MAX_SHIFT_TURNS, MAX_SHIFT_TURNS)?;
            let mut harmonics = shot.waveform.harmonics();
            harmonics.try_for_each(|(_, share)| within("share of a harmonic", share, -1.0, 1.0))?;
            Ok(())
        })?;
        Fields.check("", self)?;
        Sequence::from_frames(&self.frames)
            .map(drop)
            .map_err(|error| format!("frames: {error}"))
    }
}

impl GaugeFile {
    /// Checks each value by itself, for frames whose longer side has `largest` pixels.
    ///
    /// # Errors
    /// In words that name the key, the value and the bounds.
    pub(super) fn check_bounds(&self, largest: usize) -> Result<(), String> {
        text("name", &self.name, LONGEST_NAME)?;
        within("slot", self.slot, 1, MAX_SLOT)?;
        length("of", self.of.len(), 0, MAX_PLACES)?;
        let mut names = self.of.iter().chain(&self.datum);
        names.try_for_each(|name| text("of", name, LONGEST_NAME))?;
        self.check_numbers()?;
        let kind = self.measures.kind();
        let mut parameters = kind.parameters().into_iter();
        parameters.try_for_each(|parameter| parameter.check(largest))
    }
}
