//! The levels of a recording: its frames by their ratio.

use hal::replay::Recording;

/// All frames of one ratio.
#[derive(Clone, Debug)]
pub struct Level {
    /// The ratio r.
    pub ratio: f64,
    /// The shift of each frame, turns.
    pub shifts: Vec<f64>,
    /// The index of each frame in the recording.
    pub frames: Vec<usize>,
}

/// The levels of pattern `at`, from coarse to fine.
pub fn levels_of(recording: &Recording, at: usize) -> Vec<Level> {
    let frames = recording.frames.iter().enumerate();
    let own = frames.filter(|(_, frame)| frame.pattern == at);
    levels_from(own.map(|(place, frame)| (place, frame.ratio, frame.shift_turns)))
}

/// The levels of frames given as place, ratio and shift, from coarse to fine.
pub fn levels_from(frames: impl Iterator<Item = (usize, f64, f64)>) -> Vec<Level> {
    let mut levels: Vec<Level> = Vec::new();
    for (place, ratio, shift) in frames {
        if !levels.iter().any(|level| level.ratio == ratio) {
            levels.push(Level {
                ratio,
                shifts: Vec::new(),
                frames: Vec::new(),
            });
        }
        for level in levels.iter_mut().filter(|level| level.ratio == ratio) {
            level.shifts.push(shift);
            level.frames.push(place);
        }
    }
    levels.sort_by(|a, b| a.ratio.total_cmp(&b.ratio));
    levels
}
