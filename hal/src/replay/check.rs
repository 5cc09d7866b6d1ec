//! Checks of a recording's manifest, both when it is read and before it is written.

use std::path::{Component, Path};

use super::Wrong;
use super::manifest::{CodeEntry, Manifest, PatternEntry};
use crate::bounds::{
    Bound, Fields, MAX_FRINGES, MAX_HARMONIC, MAX_NAME, MAX_SIDE, OutOfBounds, clipped,
    fingerprint, within,
};
use crate::model::DeviceModel;

/// Most notes: a few per pattern.
const MAX_NOTES: usize = 64;
/// Most frames in a recording; two patterns of a hundred frames each would be many.
const MAX_FRAMES: usize = 1024;
/// Most bytes of decoded samples in a recording.
const MAX_BYTES: u64 = 2 << 30;
/// How far the shifts of a level may be off even spacing, turns.
pub(crate) const SHIFT_TOLERANCE_TURNS: f64 = 1e-6;
/// Narrowest cell of a Gray code, projector pixels.
const MIN_CELL_PX: f64 = 1.0;
/// Most bits of a Gray code: enough for the widest projector.
const MAX_BITS: usize = 13;
/// Fewest frames that determine offset, modulation and phase.
const MIN_SHIFTS: usize = 3;

/// Checks everything that can be checked without opening another file.
pub(crate) fn manifest(manifest: &Manifest) -> Result<(), Wrong> {
    values(manifest)?;
    patterns(manifest)?;
    frames(manifest)?;
    codes(manifest)?;
    levels(manifest)
}

/// Checks the values that do not depend on others.
fn values(manifest: &Manifest) -> Result<(), Wrong> {
    let wrong = |problem: String| {
        Wrong::new(
            problem,
            "correct the value, or leave it out if it is optional",
        )
    };
    let refused = |bounds: OutOfBounds| wrong(bounds.to_string());
    Fields.check("", manifest).map_err(refused)?;
    let (camera, projector) = (&manifest.camera, &manifest.projector);
    for (device, model) in [("camera", &camera.model), ("projector", &projector.model)] {
        if let Some(name) = model.as_ref().and_then(DeviceModel::first_not_finite) {
            return Err(wrong(format!("{device}.model.{name} is not finite")));
        }
    }
    if let Some([lowest, highest]) = manifest.range_mm
        && lowest >= highest
    {
        return Err(wrong(format!(
            "range_mm is [{lowest:?}, {highest:?}]: write two heights in mm, the lower one first"
        )));
    }
    within("the number of notes", manifest.notes.len(), 0, MAX_NOTES).map_err(refused)?;
    if let Some(recipe) = &manifest.recipe {
        fingerprint("recipe.fingerprint", &recipe.fingerprint).map_err(refused)?;
    }
    Ok(())
}

fn patterns(manifest: &Manifest) -> Result<(), Wrong> {
    let patterns = &manifest.pattern.0;
    if !(1..=2).contains(&patterns.len()) {
        return Err(Wrong::new(
            format!(
                "the recording holds {} patterns, expected 1 or 2",
                patterns.len()
            ),
            "write one pattern, or a list of a vertical and a horizontal one",
        ));
    }
    for (index, pattern) in patterns.iter().enumerate() {
        match pattern {
            PatternEntry::Vertical { fringes } | PatternEntry::Horizontal { fringes } => {
                if !(*fringes > 0.0 && *fringes <= MAX_FRINGES) {
                    return Err(Wrong::new(
                        format!(
                            "pattern {index} has {fringes} fringes, expected above 0 and at most {MAX_FRINGES}"
                        ),
                        "write the number of fringes over the projector",
                    ));
                }
            }
            PatternEntry::File { file } => inside(file)?,
        }
    }
    Ok(())
}

fn frames(manifest: &Manifest) -> Result<(), Wrong> {
    let wrong = |problem: String, remedy: &str| Err(Wrong::new(problem, remedy));
    let frames = &manifest.frames;
    let camera = &manifest.camera;
    let bytes = u64::from(camera.width)
        * u64::from(camera.height)
        * if camera.bit_depth == 8 { 1 } else { 2 }
        * (frames.len() + manifest.pictures().count()) as u64;
    let none = frames.is_empty() && !codes_alone(manifest);
    if none || frames.len() > MAX_FRAMES || bytes > MAX_BYTES {
        return wrong(
            format!(
                "the recording has {} frames with {} MiB of samples, expected 1…{MAX_FRAMES} frames and at most {} MiB",
                frames.len(),
                bytes >> 20,
                MAX_BYTES >> 20
            ),
            "record one measurement only, without fringes a Gray code for each pattern with something to compare it with",
        );
    }
    for frame in frames {
        inside(&frame.file)?;
        if let Err(problem) = Fields.check("", frame) {
            return wrong(
                format!("frame {:?}: {problem}", frame.file),
                "the level's share of the full phase function, and the shift in turns",
            );
        }
        for (at, &(order, share)) in frame.harmonics.iter().enumerate() {
            let repeated = frame.harmonics[..at]
                .iter()
                .any(|(earlier, _)| *earlier == order);
            let checked = within("order", order, 2, MAX_HARMONIC)
                .and_then(|()| within("share", share, -1.0, 1.0))
                .map_err(String::from)
                .and_then(|()| match repeated {
                    true => Err(format!("order {order} is there twice")),
                    false => Ok(()),
                });
            if let Err(problem) = checked {
                return wrong(
                    format!("frame {:?}: harmonics: {problem}", frame.file),
                    "a list of [order, share of the fundamental's amplitude]",
                );
            }
        }
        if frame.pattern >= manifest.pattern.0.len() {
            return wrong(
                format!(
                    "frame {:?} names pattern {}, the recording has {} (counted from 0)",
                    frame.file,
                    frame.pattern,
                    manifest.pattern.0.len()
                ),
                "correct the frame's pattern",
            );
        }
    }
    Ok(())
}

/// Whether every pattern has a Gray code that can be decoded without fringes.
fn codes_alone(manifest: &Manifest) -> bool {
    let both = manifest.white.is_some() && manifest.black.is_some();
    (0..manifest.pattern.0.len()).all(|pattern| {
        let mut codes = manifest.codes.iter();
        codes.any(|code| code.pattern == pattern && (both || !code.inverse.is_empty()))
    })
}

/// Checks the Gray codes, and the names of all pictures that are not frames of levels.
fn codes(manifest: &Manifest) -> Result<(), Wrong> {
    for (key, picture) in manifest.pictures() {
        inside(picture).map_err(|wrong| wrong.under(key))?;
    }
    let wrong = |problem: String, remedy: &str| Err(Wrong::new(problem, remedy));
    for (at, code) in manifest.codes.iter().enumerate() {
        let CodeEntry {
            pattern,
            cell_px,
            offset_px,
            binary,
            bits,
            inverse,
            ..
        } = code;
        let length = match manifest.pattern.0.get(*pattern) {
            Some(PatternEntry::Vertical { .. }) => manifest.projector.width,
            Some(PatternEntry::Horizontal { .. }) => manifest.projector.height,
            _ => {
                return wrong(
                    format!("codes names pattern {pattern}, which is not vertical or horizontal"),
                    "name the pattern whose fringes the code numbers, counted from 0",
                );
            }
        };
        if manifest.codes[..at]
            .iter()
            .any(|earlier| earlier.pattern == *pattern)
        {
            return wrong(
                format!("codes has two entries for pattern {pattern}"),
                "keep one of them",
            );
        }
        within("cell_px", *cell_px, MIN_CELL_PX, f64::from(MAX_SIDE))
            .map_err(|problem| Wrong::new(problem, "the width of a cell in projector pixels"))?;
        within("offset_px", *offset_px, 0.0, f64::from(MAX_SIDE))
            .map_err(|problem| Wrong::new(problem, "how far before the raster the code begins"))?;
        let count = bits.len();
        if !(1..=MAX_BITS).contains(&count) || ![0, count].contains(&inverse.len()) {
            return wrong(
                format!(
                    "codes has {count} bits and {} inverse pictures, expected 1 to {MAX_BITS} bits and as many \
                     inverse pictures or none",
                    inverse.len()
                ),
                "name one picture per bit, the most significant first",
            );
        }
        let cells = ((f64::from(length) + offset_px) / cell_px - 1e-9).ceil();
        // One more Gray cell than the bits number: the last two show the same bits.
        let doubled = u32::from(*offset_px > 0.0 && !binary);
        if cells > f64::from((1_u32 << count) + doubled) {
            return wrong(
                format!(
                    "{count} bits number {} cells, but cells of cell_px {cell_px} are {cells} on {length} projector pixels",
                    1_u32 << count
                ),
                "correct cell_px, or name all bits",
            );
        }
    }
    Ok(())
}

/// Checks that a file that the manifest names lies inside the recording's folder.
fn inside(file: &str) -> Result<(), Wrong> {
    let plain = !file.is_empty()
        && file.len() <= MAX_NAME
        && !file.contains('\\')
        && Path::new(file)
            .components()
            .all(|part| matches!(part, Component::Normal(_)));
    if plain {
        return Ok(());
    }
    Err(Wrong::new(
        format!(
            "the file {:?} does not lie inside the recording's folder",
            clipped(file)
        ),
        "name files relative to the folder, without . or ..",
    ))
}

/// Checks that the frames of equal ratio and pattern form a level whose shifts divide one turn
/// evenly.
fn levels(manifest: &Manifest) -> Result<(), Wrong> {
    let mut seen: Vec<(u64, usize)> = Vec::new();
    for frame in &manifest.frames {
        let level = (frame.ratio.to_bits(), frame.pattern);
        if seen.contains(&level) {
            continue;
        }
        seen.push(level);
        let shifts: Vec<f64> = manifest
            .frames
            .iter()
            .filter(|frame| (frame.ratio.to_bits(), frame.pattern) == level)
            .map(|frame| frame.shift_turns)
            .collect();
        // A recording of a fringe and its complement alone, as a station keeps it.
        let pair = shifts.len() == 2 && manifest.frames.len() == 2;
        if shifts.len() < MIN_SHIFTS && !pair {
            return Err(Wrong::new(
                format!(
                    "the level of ratio {} (pattern {}) has {} frames, expected at least {MIN_SHIFTS}",
                    frame.ratio,
                    frame.pattern,
                    shifts.len()
                ),
                "record at least three shifts per level, all under exactly the same ratio",
            ));
        }
        if !evenly_spaced(&shifts) {
            return Err(Wrong::new(
                format!(
                    "the shift_turns of ratio {} (pattern {}) are {shifts:?}, not equally spaced over one turn",
                    frame.ratio, frame.pattern
                ),
                format!(
                    "space its {} shifts by 1/{} turn",
                    shifts.len(),
                    shifts.len()
                ),
            ));
        }
    }
    Ok(())
}

/// Whether the shifts divide one turn evenly, in any order and from any start.
fn evenly_spaced(shifts: &[f64]) -> bool {
    let mut turns: Vec<f64> = shifts.iter().map(|shift| shift.rem_euclid(1.0)).collect();
    turns.sort_by(f64::total_cmp);
    let spacing = 1.0 / turns.len() as f64;
    let Some(&first) = turns.first() else {
        return false;
    };
    // The last gap closes the circle.
    let next = turns.iter().skip(1).copied().chain([first + 1.0]);
    turns
        .iter()
        .zip(next)
        .all(|(here, next)| (next - here - spacing).abs() <= SHIFT_TOLERANCE_TURNS)
}

#[cfg(test)]
mod tests {
    use super::{evenly_spaced, manifest};
    use crate::replay::manifest::parse;

    /// What is wrong with a recording of one level whose first frame has these harmonics.
    fn problem(harmonics: &str) -> Option<String> {
        let frame = |k: u32, harmonics: &str| {
            let shift = f64::from(k) / 4.0;
            format!(
                "{{\"file\": \"{k}.png\", \"ratio\": 1.0, \"shift_turns\": {shift}, \"harmonics\": {harmonics}}}"
            )
        };
        let frames = [
            frame(0, harmonics),
            frame(1, "[]"),
            frame(2, "[]"),
            frame(3, "[]"),
        ]
        .join(", ");
        let text = format!(
            "{{\"format\": \"fringed-recording\", \"version\": 1, \"camera\": {{\"width\": 8, \"height\": 8, \
             \"bit_depth\": 8}}, \"projector\": {{\"width\": 8, \"height\": 8}}, \"pattern\": {{\"kind\": \"vertical\", \
             \"fringes\": 2.0}}, \"frames\": [{frames}]}}"
        );
        let found = parse(&text).and_then(|read| manifest(&read));
        found.err().map(|wrong| wrong.to_string())
    }

    #[test]
    fn harmonics_have_orders_and_shares_within_bounds_and_each_order_once() {
        assert_eq!(problem("[[2, 0.1], [15, -1.0]]"), None);
        for (harmonics, words) in [
            ("[[1, 0.1]]", "order is 1"),
            ("[[16, 0.1]]", "order is 16"),
            ("[[3, 1.5]]", "share is 1.5"),
            ("[[3, 0.1], [3, 0.2]]", "twice"),
            ("[3, 0.1]", "invalid type"),
        ] {
            let problem = problem(harmonics).unwrap_or_default();
            assert!(problem.contains(words), "{harmonics}: {problem}");
        }
    }

    #[test]
    fn shifts_divide_a_turn_in_any_order_and_from_any_start() {
        assert!(evenly_spaced(&[0.25, -1.0 / 12.0, -5.0 / 12.0]));
        assert!(evenly_spaced(&[0.7, 0.2, 0.95, 0.45]));
        assert!(evenly_spaced(&[1e-9, 1.0 / 3.0, 2.0 / 3.0]));
        assert!(
            evenly_spaced(&[-1e-18, 0.5, 3.25, 0.75]),
            "a shift just below 0 is a shift of 0"
        );
    }

    #[test]
    fn shifts_that_repeat_or_are_uneven_are_not_spaced_over_a_turn() {
        assert!(!evenly_spaced(&[0.0, 0.0, 0.5]));
        assert!(!evenly_spaced(&[0.0, 0.25, 0.5]));
        assert!(!evenly_spaced(&[0.0, 0.25, 0.5, 0.75001]));
        assert!(!evenly_spaced(&[]));
    }
}
