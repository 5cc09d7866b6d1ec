//! Leaves out what a part lies on and what lies beside it, before golden is made.

use super::plan::window;
use algo::geometry::Triangulator;
use algo::inspect::{self, Surroundings};
use algo::phase::Trust;
use algo::pipeline::{HeightMap, PhaseMap};
use algo::units::{AbsolutePhase, Height, Modulation};

/// The surroundings of a measured part that may be displaced by `tolerance_mm`; `None` if nothing but the part is
/// seen.
pub fn of(
    heights: &HeightMap,
    triangulator: &Triangulator,
    tolerance_mm: f64,
) -> Option<Surroundings> {
    let (width, pixels) = (heights.width, heights.height.len());
    let mut sigmas: Vec<f32> = heights
        .sigma
        .iter()
        .copied()
        .filter(|sigma| sigma.is_finite())
        .collect();
    if sigmas.is_empty() {
        return None;
    }
    let middle = sigmas.len() / 2;
    let sigma = f64::from(*sigmas.select_nth_unstable_by(middle, f32::total_cmp).1);
    let point = |at: usize| triangulator.point(at % width, at / width, heights.height[at]);
    let found = inspect::surroundings(pixels, width, sigma, point)?;
    Some(found.clear_of_others(width, window::pixels(triangulator, tolerance_mm)))
}

/// Makes pixels that are not of the part those of nothing.
pub fn leave_out(surroundings: &Surroundings, phases: &mut PhaseMap, heights: &mut HeightMap) {
    let others = surroundings.part.iter().enumerate();
    for (at, _) in others.filter(|(_, part)| !**part) {
        if phases.trust[at] == Trust::Resolved {
            phases.trust[at] = Trust::OutOfRange;
        }
        (phases.phase[at], phases.modulation[at]) = (AbsolutePhase::UNKNOWN, Modulation::default());
        (heights.height[at], heights.sigma[at]) = (Height::UNKNOWN, f32::NAN);
    }
}

/// What is said of them.
pub fn words(surroundings: &Surroundings) -> String {
    let Surroundings {
        part,
        step_mm,
        others,
        ..
    } = surroundings;
    let share = |of: &[bool]| of.iter().filter(|is| **is).count() as f64 / of.len().max(1) as f64;
    let others = match share(others) * 100.0 {
        percent if percent < 0.05 => String::new(),
        percent => format!("; other things on {percent:.1} % of the picture are left out"),
    };
    format!(
        "the part is {:.1} % of the picture and stands out from what it lies on by {step_mm:.2} mm or more{others}",
        share(part) * 100.0
    )
}
