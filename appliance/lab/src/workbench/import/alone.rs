//! What looks wrong with an imported Gray code without fringes.

use super::code::{options, otherwise};
use crate::workbench::layout::Description;
use algo::phase::Trust;
use algo::pipeline::PhaseMap;
use appliance::head::code::CodeAlone;
use appliance::measure::least_modulation;
use hal::replay::Recording;

/// Share of the pixels that must be lit.
const LIT: f64 = 0.01;
/// Share of the lit pixels that may be in doubt.
const DOUBT: f64 = 0.4;
/// Distance of the pixels that are compared, as a share of the frame.
const APART: usize = 16;
/// Least excess of pairs whose cells rise over those whose cells fall, or the other way round, as a
/// share of both: a code that is read in another order or form has at most 0.4, a right one nearly
/// 1, but for the edges of parts.
const ONE_WAY: f64 = 0.7;

/// The remedy where no other reading of the pictures fits.
const REMEDY: &str = "check the order of the pictures, --gray, --gray-cell, --gray-order, --gray-binary, --gray-invert and --order";

/// What looks wrong, in words with remedies: the options of another reading of the pictures, if one
/// fits.
///
/// # Errors
/// In words: the pictures form no code.
pub(super) fn notes(
    recording: &Recording,
    description: &Description,
) -> Result<Vec<String>, String> {
    let mut notes = Vec::new();
    let least = least_modulation(recording);
    for pattern in 0..recording.patterns.len() {
        let (Some(code), Some(gray)) = (CodeAlone::of(recording, pattern)?, &description.gray)
        else {
            continue;
        };
        let Some(words) = problem(&code.phases(least)?) else {
            continue;
        };
        let number = if code.vertical { "columns" } else { "rows" };
        let fits = otherwise(code.cells.coding).find(|&(reversed, coding)| {
            let read = code.read_as(reversed, coding).phases(least);
            read.is_ok_and(|map| problem(&map).is_none())
        });
        let remedy = match fits {
            Some((reversed, coding)) => format!("give {}", options(reversed, coding, gray)),
            None => REMEDY.to_owned(),
        };
        notes.push(format!("Gray code of {number}: {words}{remedy}"));
    }
    Ok(notes)
}

/// What is wrong with the phases of a code, up to the remedy.
fn problem(map: &PhaseMap) -> Option<String> {
    let pixels = map.trust.len() as f64;
    let (resolved, doubt) = (map.count(Trust::Resolved), map.count(Trust::Residual));
    let lit = (resolved + doubt) as f64;
    if lit < LIT * pixels {
        return Some(format!(
            "only {:.1} % of the pixels are lit: if the pictures are only dim, give the camera's noise with --noise; else ",
            100.0 * lit / pixels
        ));
    }
    if doubt as f64 > DOUBT * lit {
        return Some(format!(
            "{:.0} % of the lit pixels have two bits in doubt, or a cell beyond the projector's edge: ",
            100.0 * doubt as f64 / lit
        ));
    }
    let [right, down] = one_way(map);
    (right.max(down) < ONE_WAY).then(|| {
        "the cells rise and fall by turns along the rows and the columns of the picture: ".into()
    })
}

/// The excess of pairs whose phase changes in one way, along rows and along columns.
fn one_way(map: &PhaseMap) -> [f64; 2] {
    let width = map.width.max(1);
    let height = map.phase.len() / width;
    [(width, 1), (height, width)].map(|(length, step)| {
        let apart = (length / APART).max(1);
        let (mut rising, mut falling) = (0_usize, 0_usize);
        for (at, here) in map.phase.iter().enumerate() {
            if (at / step) % length + apart >= length {
                continue;
            }
            let next = map.phase[at + apart * step];
            if here.is_known() && next.is_known() {
                let turns = (next - *here).turns();
                rising += usize::from(turns > 0.0);
                falling += usize::from(turns < 0.0);
            }
        }
        rising.abs_diff(falling) as f64 / (rising + falling).max(1) as f64
    })
}
