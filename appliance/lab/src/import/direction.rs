//! Whether fringes run the way that they are said to: pictures whose names begin with H and V lie
//! in the other order than pictures of columns and rows.

use crate::Failed;
use algo::pipeline::PhaseMap;
use appliance::head::channel::Channel;
use appliance::head::code::CodeAlone;
use appliance::measure::least_modulation;
use hal::replay::Recording;
use hal::replay::recording::PatternSpec;

/// How much more the phase must rise in the other direction.
const MORE: f64 = 2.0;

/// What looks wrong, in words with remedies. With models the distances from epipolar lines say it.
pub(super) fn notes(recording: &Recording) -> Option<String> {
    if recording.camera_model.is_some() {
        return None;
    }
    let mut across = Vec::new();
    for (pattern, spec) in recording.patterns.iter().enumerate() {
        let vertical = match spec {
            PatternSpec::Vertical { .. } => true,
            PatternSpec::Horizontal { .. } => false,
            PatternSpec::File { .. } => return None,
        };
        let has_fringes = !recording.frames.is_empty();
        let [right, down] = slopes(&coarsest(recording, pattern).ok()?, has_fringes);
        let (own, other) = if vertical {
            (right, down)
        } else {
            (down, right)
        };
        across.push(other > MORE * own);
    }
    if !across.iter().all(|&across| across) {
        return None;
    }
    let (seen, remedy) = match &recording.patterns[..] {
        [PatternSpec::Vertical { .. }, _] => (
            "vertical fringes run along the picture's rows and horizontal ones along its columns",
            "if the horizontal ones were projected first, give --direction horizontal-first",
        ),
        [_, _] => (
            "horizontal fringes run along the picture's columns and vertical ones along its rows",
            "if the vertical ones were projected first, give --direction both",
        ),
        [PatternSpec::Vertical { .. }] => (
            "vertical fringes run along the picture's rows",
            "if they are horizontal ones, give --direction horizontal",
        ),
        _ => (
            "horizontal fringes run along the picture's columns",
            "if they are vertical ones, give --direction vertical",
        ),
    };
    Some(format!(
        "{seen}: {remedy}; it is right where the camera is turned by 90° against the projector"
    ))
}

/// The wrapped phase of a pattern's coarsest level, or the absolute one of a Gray code alone.
///
/// # Errors
/// In words: the frames make no levels.
fn coarsest(recording: &Recording, pattern: usize) -> Result<PhaseMap, Failed> {
    let least = least_modulation(recording);
    if let Some(code) = CodeAlone::of(recording, pattern)? {
        return Ok(code.phases(least)?);
    }
    let channel = Channel::new(recording, pattern, least)?;
    Ok(channel.wrapped_levels()?.swap_remove(0))
}

/// Mean change of the phase from column to column and from row to row, in turns, without its sign;
/// the phase `wraps` at whole turns, or does not.
fn slopes(map: &PhaseMap, wraps: bool) -> [f64; 2] {
    [true, false].map(|along_rows| {
        let (mut sum, mut count) = (0.0, 0_usize);
        for rise in changes(map, along_rows, 1, |pixel| map.trust[pixel].has_phase()) {
            sum += if wraps { rise - rise.round() } else { rise };
            count += 1;
        }
        (sum / count.max(1) as f64).abs()
    })
}

/// The changes of the phase, in turns, between pixels that lie `apart` in a row or in a column, both
/// of which are `known`.
fn changes(
    map: &PhaseMap,
    along_rows: bool,
    apart: usize,
    known: impl Fn(usize) -> bool,
) -> impl Iterator<Item = f64> {
    let width = map.width.max(1);
    let (length, step) = match along_rows {
        true => (width, 1),
        false => (map.phase.len() / width, width),
    };
    let first = (0..map.phase.len()).filter(move |pixel| pixel / step % length + apart < length);
    let pairs = first.map(move |pixel| (pixel, pixel + apart * step));
    let pairs = pairs.filter(move |&(here, next)| known(here) && known(next));
    pairs.map(|(here, next)| (map.phase[next] - map.phase[here]).turns())
}

/// Between how many of these pixels the phase rises, and between how many it falls.
pub(super) fn rising_and_falling(map: &PhaseMap, along_rows: bool, apart: usize) -> [usize; 2] {
    let known = |pixel: usize| map.phase[pixel].is_known();
    let (mut rising, mut falling) = (0, 0);
    for turns in changes(map, along_rows, apart, known) {
        rising += usize::from(turns > 0.0);
        falling += usize::from(turns < 0.0);
    }
    [rising, falling]
}
