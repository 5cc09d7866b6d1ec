//! Structural resolution: how much of a dent's depth is left in the measured heights, by its
//! diameter.

use super::measure;
use crate::experiment::{OpticsKind, Run, Scene};
use appliance::head::calibrated::MeasureError;
use serde::Serialize;
use sim::Part;
use sim::parts::{Defect, SheetMetal};

/// What is left of a dent's depth in the middle of the dent, without noise.
#[derive(Clone, Debug, Serialize)]
pub struct Resolution {
    /// The optics.
    pub optics: &'static str,
    /// Diameter of the dent, mm.
    pub diameter_mm: f64,
    /// What is left in the height of a single pixel.
    pub of_pixel: f64,
    /// What is left in the mean of 9 × 9 pixels.
    pub of_mean: f64,
}

/// Diameters, mm.
const DIAMETERS: [f64; 7] = [0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0];
/// Depth, mm.
const DEPTH: f64 = 0.2;
/// Where the dent is: on the flat plate between bead, slot and the large hole, mm.
const AT: [f64; 2] = [-20.0, 4.0];
/// Side of the mean, pixels: that of a deviation's squares unless the recipe says otherwise.
const SIDE: usize = 9;

/// Measures the sheet-metal part good and with dents, without noise.
///
/// # Errors
/// If the part cannot be simulated or measured.
pub fn resolution(scene: &Scene, optics: OpticsKind) -> Result<Vec<Resolution>, MeasureError> {
    let with = |defects| Scene {
        part: Part::SheetMetal(SheetMetal {
            defects,
            ..Default::default()
        }),
        noise_counts: 0.0,
        ..scene.clone()
    };
    let (runner, good) = measure(&with(Vec::new()), optics, 1)?;
    let truth = runner.truth().height.clone();
    let mut found = Vec::new();
    for diameter_mm in DIAMETERS {
        let dent = Defect::Dent {
            x: AT[0],
            y: AT[1],
            depth_mm: DEPTH,
            diameter_mm,
        };
        let (runner, dented) = measure(&with(vec![dent]), optics, 1)?;
        let depths = truth.iter().zip(&runner.truth().height);
        let depths: Vec<f64> = depths.map(|(a, b)| f64::from(a - b)).collect();
        let known = (0..depths.len()).filter(|&at| depths[at].is_finite());
        let Some(middle) = known.max_by(|&a, &b| depths[a].total_cmp(&depths[b])) else {
            continue;
        };
        let left = |side| mean_change(&good, &dented, middle, side) / DEPTH;
        found.push(Resolution {
            optics: optics.word(),
            diameter_mm,
            of_pixel: left(1),
            of_mean: left(SIDE),
        });
    }
    Ok(found)
}

/// By how much the mean height of a square about a pixel is lower in the second run, mm.
fn mean_change(good: &Run, dented: &Run, middle: usize, side: usize) -> f64 {
    let width = good.measured.heights.width;
    let reach = side / 2 * (width + 1);
    let first = middle.saturating_sub(reach);
    let places =
        (0..side).flat_map(|row| (0..side).map(move |column| first + row * width + column));
    let height = |run: &Run, at: usize| run.measured.heights.height[at].mm();
    let sum: f64 = places.map(|at| height(good, at) - height(dented, at)).sum();
    sum / (side * side) as f64
}
