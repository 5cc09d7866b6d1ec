//! Pictures of a calibration: the residuals of both devices as arrows, and where in the frame the
//! board was seen.

use super::canvas::{Canvas, LETTER, LINE};
use algo::calibration::Arrow;

/// By how much residuals are drawn larger.
const LARGER: f64 = 200.0;
/// Half the side of the square at the foot of an arrow, pixels.
const FOOT: i64 = 2;
/// Lightness of the parts of the frame where no corner was seen.
const UNSEEN: u8 = 70;
/// Colours of the poses, in turn.
const COLOURS: [[u8; 3]; 6] = [
    [240, 120, 90],
    [120, 200, 110],
    [110, 160, 250],
    [240, 210, 90],
    [210, 130, 230],
    [110, 220, 220],
];

fn colour(pose: usize) -> [u8; 3] {
    COLOURS[pose % COLOURS.len()]
}

/// A device's residuals in all poses, each pose in a colour of its own, as a PNG; `device` is its
/// name and `size` its columns and rows.
pub fn arrows_png(device: &str, size: (usize, usize), poses: &[&[Arrow]]) -> Vec<u8> {
    let mut canvas = Canvas::<3>::new(size.0, size.1);
    for (pose, arrows) in poses.iter().enumerate() {
        for arrow in *arrows {
            let end = (
                arrow.at.0 + LARGER * arrow.off.0,
                arrow.at.1 + LARGER * arrow.off.1,
            );
            line(&mut canvas, arrow.at, end, colour(pose));
            foot(&mut canvas, arrow.at, colour(pose));
        }
    }
    let squares = poses.iter().flat_map(|arrows| arrows.iter());
    let (sum, n) = squares.fold((0.0, 0.0), |(sum, n), arrow| {
        (sum + arrow.off.0.powi(2) + arrow.off.1.powi(2), n + 1.0)
    });
    let rms = (sum / f64::max(n, 1.0)).sqrt();
    let text = format!("{device}: residuals × {LARGER}, {rms:.3} px RMS; the bar is 0.2 px");
    canvas.text(&text, LETTER, LINE / 2);
    let bar = (LETTER as f64, (2 * LINE) as f64);
    let end = (bar.0 + 0.2 * LARGER, bar.1);
    line(&mut canvas, bar, end, [255; 3]);
    canvas.png(png::Compression::Fast)
}

/// Where in the camera's frame corners were seen, each pose in a colour of its own, as a PNG; cells
/// of `cells` columns and rows without any are lighter.
pub fn coverage_png(size: (usize, usize), cells: (usize, usize), poses: &[&[Arrow]]) -> Vec<u8> {
    let cell = |(x, y): (f64, f64)| {
        let of = |at: f64, size: usize, cells: usize| {
            ((at.max(0.0) as usize) * cells / size.max(1)).min(cells - 1)
        };
        (of(x, size.0, cells.0), of(y, size.1, cells.1))
    };
    let mut seen = vec![false; cells.0 * cells.1];
    for arrow in poses.iter().flat_map(|arrows| arrows.iter()) {
        let (column, row) = cell(arrow.at);
        seen[row * cells.0 + column] = true;
    }
    let mut canvas = Canvas::<3>::new(size.0, size.1);
    for y in 0..size.1 {
        for x in 0..size.0 {
            let (column, row) = cell((x as f64, y as f64));
            if !seen[row * cells.0 + column] {
                canvas.set(x, y, [UNSEEN; 3]);
            }
        }
    }
    for (pose, arrows) in poses.iter().enumerate() {
        for arrow in *arrows {
            foot(&mut canvas, arrow.at, colour(pose));
        }
        let text = format!("pose {}", pose + 1);
        canvas.text_in(&text, LETTER, LINE / 2 + pose * LINE, colour(pose));
    }
    canvas.png(png::Compression::Fast)
}

fn set(canvas: &mut Canvas<3>, x: i64, y: i64, colour: [u8; 3]) {
    if let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) {
        canvas.set(x, y, colour);
    }
}

fn foot(canvas: &mut Canvas<3>, (x, y): (f64, f64), colour: [u8; 3]) {
    for dy in -FOOT..=FOOT {
        for dx in -FOOT..=FOOT {
            set(canvas, x.round() as i64 + dx, y.round() as i64 + dy, colour);
        }
    }
}

/// A line of points a pixel apart; the part outside the picture is left out.
fn line(canvas: &mut Canvas<3>, from: (f64, f64), to: (f64, f64), colour: [u8; 3]) {
    let (x, y) = (to.0 - from.0, to.1 - from.1);
    // Residuals are below a pixel; a length beyond all pictures would take long to draw.
    let points = x.abs().max(y.abs()).ceil().clamp(1.0, 1e4);
    for at in 0..=points as usize {
        let share = at as f64 / points;
        let (x, y) = (from.0 + share * x, from.1 + share * y);
        set(canvas, x.round() as i64, y.round() as i64, colour);
    }
}
