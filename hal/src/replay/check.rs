//! What must hold for the manifest of a recording, whether it is read or about to be written.

use std::path::{Component, Path};

use super::failure::RecordingError;
use super::manifest::{Manifest, PatternEntry};
use crate::model::DeviceModel;

/// Largest width or height of a camera or projector.
const MAX_SIZE: u32 = 16384;
/// Most frames in a recording: two patterns of a hundred frames are plenty.
const MAX_FRAMES: usize = 1024;
/// Most bytes of decoded samples in a recording.
const MAX_BYTES: u64 = 2 << 30;
/// The shifts of a level may be off their even spacing by this much, turns.
pub(crate) const SHIFT_TOLERANCE_TURNS: f64 = 1e-6;
/// Fewest frames that determine offset, modulation and phase.
const MIN_SHIFTS: usize = 3;

/// Checks everything that can be said without opening another file; `path` is the manifest's.
pub(crate) fn manifest(manifest: &Manifest, path: &Path) -> Result<(), RecordingError> {
    let wrong = |problem: String, remedy: &str| Err(RecordingError::content(path, problem, remedy));

    let (camera, projector) = (&manifest.camera, &manifest.projector);
    for (device, width, height) in [
        ("camera", camera.width, camera.height),
        ("projector", projector.width, projector.height),
    ] {
        if !(1..=MAX_SIZE).contains(&width) || !(1..=MAX_SIZE).contains(&height) {
            return wrong(
                format!("{device} is {width}×{height}, expected 1…{MAX_SIZE} each way"),
                "write the device's real size",
            );
        }
    }
    if !(8..=16).contains(&camera.bit_depth) {
        return wrong(
            format!("camera.bit_depth is {}, expected 8…16", camera.bit_depth),
            "write the number of significant bits of a sample",
        );
    }
    for (device, model) in [("camera", &camera.model), ("projector", &projector.model)] {
        if let Some(name) = model.as_ref().and_then(DeviceModel::first_not_finite) {
            return wrong(
                format!("{device}.model.{name} is not finite"),
                "write a number",
            );
        }
    }
    if let Some(noise) = camera.noise_counts
        && !(noise.is_finite() && noise > 0.0)
    {
        return wrong(
            format!("camera.noise_counts is {noise}, expected above 0"),
            "write the standard deviation of one sample in counts, or leave the key out",
        );
    }
    if let Some([lowest, highest]) = manifest.range_mm
        && !(lowest.is_finite() && highest.is_finite() && lowest < highest)
    {
        return wrong(
            format!("range_mm is [{lowest}, {highest}], expected two heights, the lower one first"),
            "write [lowest, highest] in mm",
        );
    }
    if let Some(exposure) = manifest.exposure_us
        && !(exposure.is_finite() && exposure > 0.0)
    {
        return wrong(
            format!("exposure_us is {exposure}, expected above 0"),
            "write the exposure in µs, or leave the key out",
        );
    }
    patterns(manifest, path)?;
    frames(manifest, path)?;
    levels(manifest, path)
}

fn patterns(manifest: &Manifest, path: &Path) -> Result<(), RecordingError> {
    let patterns = &manifest.pattern.0;
    if !(1..=2).contains(&patterns.len()) {
        return Err(RecordingError::content(
            path,
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
                if !(fringes.is_finite() && *fringes > 0.0) {
                    return Err(RecordingError::content(
                        path,
                        format!("pattern {index} has {fringes} fringes, expected above 0"),
                        "write the number of fringes over the projector",
                    ));
                }
            }
            PatternEntry::File { file } => inside(file, path)?,
        }
    }
    Ok(())
}

fn frames(manifest: &Manifest, path: &Path) -> Result<(), RecordingError> {
    let wrong = |problem: String, remedy: &str| Err(RecordingError::content(path, problem, remedy));
    let frames = &manifest.frames;
    let camera = &manifest.camera;
    let bytes = u64::from(camera.width)
        * u64::from(camera.height)
        * if camera.bit_depth == 8 { 1 } else { 2 }
        * frames.len() as u64;
    if frames.is_empty() || frames.len() > MAX_FRAMES || bytes > MAX_BYTES {
        return wrong(
            format!(
                "the recording has {} frames with {} MiB of samples, expected 1…{MAX_FRAMES} frames and at most {} MiB",
                frames.len(),
                bytes >> 20,
                MAX_BYTES >> 20
            ),
            "record one measurement only",
        );
    }
    for frame in frames {
        inside(&frame.file, path)?;
        if !(frame.ratio.is_finite() && frame.ratio > 0.0) {
            return wrong(
                format!(
                    "frame {:?} has ratio {}, expected above 0",
                    frame.file, frame.ratio
                ),
                "write the level's share of the full phase function",
            );
        }
        if !frame.shift_turns.is_finite() {
            return wrong(
                format!("frame {:?} has shift {}", frame.file, frame.shift_turns),
                "write the shift in turns",
            );
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

/// A file a manifest names must lie inside the recording's folder.
fn inside(file: &str, path: &Path) -> Result<(), RecordingError> {
    let plain = !file.is_empty()
        && !file.contains('\\')
        && Path::new(file)
            .components()
            .all(|part| matches!(part, Component::Normal(_)));
    if plain {
        return Ok(());
    }
    Err(RecordingError::content(
        path,
        format!("the file {file:?} does not lie inside the recording's folder"),
        "name files relative to the folder, without . or ..",
    ))
}

/// Frames of equal ratio and pattern form a level, whose shifts divide one turn evenly.
fn levels(manifest: &Manifest, path: &Path) -> Result<(), RecordingError> {
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
            .filter(|other| (other.ratio.to_bits(), other.pattern) == level)
            .map(|other| other.shift_turns)
            .collect();
        if shifts.len() < MIN_SHIFTS {
            return Err(RecordingError::content(
                path,
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
            return Err(RecordingError::content(
                path,
                format!(
                    "the shifts of ratio {} (pattern {}) are {shifts:?}, not equally spaced over one turn",
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
    let step = 1.0 / turns.len() as f64;
    let Some(&first) = turns.first() else {
        return false;
    };
    // The last gap closes the circle.
    let next = turns.iter().skip(1).copied().chain([first + 1.0]);
    turns
        .iter()
        .zip(next)
        .all(|(here, next)| (next - here - step).abs() <= SHIFT_TOLERANCE_TURNS)
}

#[cfg(test)]
mod tests {
    use super::evenly_spaced;

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
