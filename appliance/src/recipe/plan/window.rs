//! The part of the frame that the gauges need.

use crate::recipe::archive::Arrays;
use crate::recipe::{Demands, Element, Part, Refusal};
use algo::geometry::Triangulator;
use algo::inspect::{Cut, Feature, Gauge, Region, RegionError};
use algo::units::Height;
use std::ops::Range;

/// The region of a section is so many times as wide as the section, and some pixels wider: pixels
/// are not of the same size everywhere.
const WIDER: f64 = 1.2;
const BESIDE_PX: f64 = 2.0;

/// The columns of each row of a frame of (width, height) that some gauge needs: its region, half of
/// its smoothing square and around it as many pixels as the part may be displaced by, which are the
/// second value. Nothing outside is computed. A part's motion is found from all pixels that are
/// compared.
pub(super) fn of(
    (features, gauges): (&[Feature], &[Gauge]),
    (width, height): (usize, usize),
    triangulator: &Triangulator,
    demands: &Demands,
    arrays: &Arrays,
) -> (Vec<Range<usize>>, usize) {
    let (mut window, widest) = (vec![0..0; height], arrays.widest());
    let away = match demands.aligned {
        true => pixels(triangulator, demands.tolerance_mm),
        false => 0,
    };
    for gauge in gauges {
        let margin = away + gauge.measure.facts().margin_px(widest);
        let features = gauge.needs(features).filter_map(|at| features.get(at));
        for (row, columns) in features.flat_map(|feature| feature.region.spans()) {
            let left = columns.start.saturating_sub(margin);
            let right = (columns.end + margin).min(width);
            let near = row.saturating_sub(margin)..(row + margin + 1).min(height);
            for columns in &mut window[near] {
                widen(columns, left..right);
            }
        }
    }
    if demands.aligned {
        for (columns, valid) in window.iter_mut().zip(arrays.valid.chunks(width.max(1))) {
            let first = valid.iter().position(|&valid| valid != 0);
            let last = valid.iter().rposition(|&valid| valid != 0);
            if let Some((first, last)) = first.zip(last) {
                widen(columns, first..last + 1);
            }
        }
    }
    (window, away)
}

/// Gives sections the region that sees them: about their way, somewhat wider than they are.
///
/// # Errors
/// In words: one lies outside of the frame.
pub(super) fn of_sections(
    (features, names): (&mut [Feature], &[String]),
    (width, height): (usize, usize),
    triangulator: &Triangulator,
) -> Result<(), Refusal> {
    let pitch = pitch(triangulator).ok_or("the camera sees no plane in its middle")?;
    for ((place, feature), name) in features.iter_mut().enumerate().zip(names) {
        let Some(Cut {
            from: [u0, v0],
            to: [u1, v1],
            width_mm,
            ..
        }) = feature.cut
        else {
            continue;
        };
        let (along, down) = (u1 - u0, v1 - v0);
        let length = along.hypot(down);
        let half = WIDER * width_mm / 2.0 / pitch + BESIDE_PX;
        let (along, down) = (along / length * half, down / length * half);
        let corners = [
            (u0 - down, v0 + along),
            (u1 - down, v1 + along),
            (u1 + down, v1 - along),
            (u0 + down, v0 - along),
        ];
        let refused = |error: RegionError| Refusal {
            words: error.to_string(),
            of: Some(Element::new(Part::Feature, place, name)),
        };
        feature.region = Region::polygon(&corners, width, height).map_err(refused)?;
    }
    Ok(())
}

fn widen(columns: &mut Range<usize>, by: Range<usize>) {
    *columns = match columns.start == columns.end {
        true => by,
        false => columns.start.min(by.start)..columns.end.max(by.end),
    };
}

/// About how many pixels the image of a part that is displaced by `mm` moves at most.
pub(in crate::recipe) fn pixels(triangulator: &Triangulator, mm: f64) -> usize {
    let middle = triangulator.camera().width() as f64 / 2.0;
    // One pixel more for rounding.
    let pixels = |pitch: f64| (mm / pitch).ceil().min(middle) as usize + 1;
    pitch(triangulator).map_or(0, pixels)
}

/// What a pixel in the middle of the frame sees of a surface that faces the camera, mm.
pub(in crate::recipe) fn pitch(triangulator: &Triangulator) -> Option<f64> {
    let camera = triangulator.camera();
    let (u, v) = (camera.width() / 2, camera.height() / 2);
    let at = |u: usize| triangulator.point(u, v, Height::from_nm(0));
    at(u).zip(at(u + 1)).map(|(a, b)| (b - a).length())
}
