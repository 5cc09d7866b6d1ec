//! The frames that the kernels are timed on, as files for other programs.

use super::frames::Buffer;
use super::workload::{RANGE, Workload};
use hal::npy;

/// File names and contents: `frame-00.npy` and so on (8 bits), `phase.npy` (the true Φ in turns),
/// and `sequence.json` with ratio and shift of each frame and the fringes of the finest level.
pub fn frame_files((width, height): (usize, usize)) -> Vec<(String, Vec<u8>)> {
    let workload = Workload::geometric();
    let set = workload.render((width, height));
    let mut files = Vec::new();
    if let Buffer::Eight(all) = set.samples() {
        for (at, frame) in all.frames(set.pixels()).enumerate() {
            files.push((format!("frame-{at:02}.npy"), npy::write(width, frame)));
        }
    }
    let phases: Vec<f64> = (0..set.pixels())
        .map(|at| workload.phase(at, (width, height)))
        .collect();
    files.push(("phase.npy".into(), npy::write(width, &phases)));
    let sequence = serde_json::json!({
        "fringes": RANGE.span(),
        "frames": workload.frames.iter().map(|shot| serde_json::json!({"ratio": shot.ratio, "shift": shot.shift})).collect::<Vec<_>>(),
    });
    files.push(("sequence.json".into(), format!("{sequence:#}\n").into()));
    files
}
