//! The points of run time against error, and their means over the parts.

use serde::Serialize;

/// One implementation on one sequence, or the mean over the parts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Point {
    /// The part; `mean` over all.
    pub part: &'static str,
    /// `f64`, `f32`, or the back-end of the decoder.
    pub implementation: &'static str,
    /// `fixed` with geometric levels, or `better` with dense ones or a single one.
    pub sequence: &'static str,
    /// Frames of a set.
    pub frames: usize,
    /// Shifts of the finest level, N.
    #[serde(rename = "steps")]
    pub shifts: usize,
    /// Bits of a sample.
    pub bits: u8,
    /// Whether rows in which the part is not seen are skipped.
    pub skipping: bool,
    /// Processor time of the decoding per pixel of a frame.
    pub ns_per_px: f64,
    /// Processor time of the decoding, in floors.
    pub x_floor: f64,
    /// Processor time of the decoding of a set, ms.
    pub ms_per_set: f64,
    /// RMS error of the height without gross errors, mm.
    pub rms_mm: f64,
    /// Wholly lit pixels that are not resolved.
    pub unresolved_px: f64,
    /// Errors above 1 mm.
    pub gross_px: f64,
}

impl Point {
    /// Whether both points are of the same pattern, frames and depth.
    pub fn same_frames(&self, other: &Self) -> bool {
        (self.sequence, self.frames, self.shifts, self.bits)
            == (other.sequence, other.frames, other.shifts, other.bits)
    }
}

/// The means over the parts, in the order of the first part's points.
pub fn means(points: &[Point]) -> Vec<Point> {
    let mut means: Vec<Point> = Vec::new();
    for first in points {
        let same = |other: &Point| {
            other.same_frames(first)
                && other.implementation == first.implementation
                && other.skipping == first.skipping
        };
        if means.iter().any(same) {
            continue;
        }
        let all: Vec<&Point> = points.iter().filter(|point| same(point)).collect();
        let mean = |of: fn(&Point) -> f64| {
            all.iter().map(|point| of(point)).sum::<f64>() / all.len() as f64
        };
        means.push(Point {
            part: "mean",
            ns_per_px: mean(|point| point.ns_per_px),
            x_floor: mean(|point| point.x_floor),
            ms_per_set: mean(|point| point.ms_per_set),
            rms_mm: mean(|point| point.rms_mm),
            unresolved_px: mean(|point| point.unresolved_px),
            gross_px: mean(|point| point.gross_px),
            ..first.clone()
        });
    }
    means
}
