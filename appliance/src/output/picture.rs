//! Pictures as PNG: a height map in colours with a scale bar and its unit; the residuals of a
//! calibration as arrows, and where in the frame its board was seen.

use super::{Canvas, LETTER, LINE};
use algo::calibration::Arrow;

/// Maps are subsampled to at most this many columns.
const MAX_WIDTH: usize = 1024;
/// Room for the scale bar, its ticks and their numbers.
const SCALE_WIDTH: usize = 96;
/// Least height of a picture, for its scale.
const MIN_HEIGHT: usize = 120;
const MARGIN: usize = 12;
const BAR_WIDTH: usize = 16;
/// Share of the heights at each end that the scale leaves out, so that single outliers do not
/// stretch it.
const TAIL: f64 = 0.005;
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

/// A PNG of `mm` (row-major, NaN = unresolved), coloured by height, with a scale bar in mm.
pub fn height_png(width: u32, height: u32, mm: &[f32]) -> Vec<u8> {
    let (width, height) = (width as usize, height as usize);
    let shrink = width.div_ceil(MAX_WIDTH).max(1);
    let (columns, rows) = (width / shrink, height / shrink);
    let mut canvas = Canvas::new(columns + SCALE_WIDTH, rows.max(MIN_HEIGHT));
    let [low, high] = scale_of(mm);
    let span = f64::from(high - low).max(1e-6);
    for row in 0..rows {
        for column in 0..columns {
            let z = mm[row * shrink * width + column * shrink];
            let colour = if z.is_nan() {
                UNRESOLVED
            } else {
                viridis(f64::from(z - low) / span)
            };
            canvas.set(column, row, colour);
        }
    }
    draw_scale(&mut canvas, columns + MARGIN, low, high);
    canvas.png(png::Compression::Fast)
}

/// The heights at both ends of the scale.
fn scale_of(mm: &[f32]) -> [f32; 2] {
    let mut known: Vec<f32> = mm.iter().copied().filter(|z| !z.is_nan()).collect();
    if known.is_empty() {
        return [0.0, 1.0];
    }
    let tail = (known.len() as f64 * TAIL) as usize;
    let last = known.len() - 1;
    let mut at = |place: usize| *known.select_nth_unstable_by(place, f32::total_cmp).1;
    [at(tail), at(last - tail)]
}

/// The bar with ticks at round heights, and the unit on top.
fn draw_scale(canvas: &mut Canvas<3>, left: usize, low: f32, high: f32) {
    let (top, bottom) = (MARGIN + LINE + 6, canvas.height - MARGIN);
    canvas.text("z in mm", left, MARGIN);
    for y in top..bottom {
        let share = (bottom - 1 - y) as f64 / (bottom - top - 1).max(1) as f64;
        for x in left..left + BAR_WIDTH {
            canvas.set(x, y, viridis(share));
        }
    }
    let (low, high) = (f64::from(low), f64::from(high));
    let span = (high - low).max(1e-6);
    let step = round_step(span / 5.0);
    let digits = (-step.log10().floor()).max(0.0) as usize;
    let mut tick = (low / step).ceil();
    while tick * step <= high {
        let share = (tick * step - low) / span;
        let y = bottom - 1 - (share * (bottom - top - 1) as f64) as usize;
        for x in left + BAR_WIDTH..left + BAR_WIDTH + 4 {
            canvas.set(x, y, [200; 3]);
        }
        let label = format!("{:.*}", digits, tick * step + 0.0);
        let label_top = y.saturating_sub(LINE / 2).min(canvas.height - LINE);
        canvas.text(&label, left + BAR_WIDTH + 8, label_top);
        tick += 1.0;
    }
}

/// The smallest of 1, 2, 5 × 10ⁿ that is at least `least`.
fn round_step(least: f64) -> f64 {
    let decade = 10_f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|factor| factor * decade)
        .find(|step| *step >= least * 0.999_999)
        .unwrap_or(10.0 * decade)
}

/// Red, green, blue.
pub type Rgb = [u8; 3];

/// Where nothing was resolved.
pub const UNRESOLVED: Rgb = [38, 40, 46];

/// The colour of a share 0…1 of the scale: viridis, which is even in lightness and readable without
/// colour vision. Fit of degree 6 by M. Zucker (CC0).
pub fn viridis(share: f64) -> Rgb {
    const RED: [f64; 7] = [
        0.27772733,
        0.10509304,
        -0.33086183,
        -4.6342305,
        6.22827,
        4.776385,
        -5.435456,
    ];
    const GREEN: [f64; 7] = [
        0.005407345,
        1.4046135,
        0.21484756,
        -5.799101,
        14.179933,
        -13.745145,
        4.6458526,
    ];
    const BLUE: [f64; 7] = [
        0.3340998, 1.3845901, 0.09509516, -19.33244, 56.690552, -65.35303, 26.312435,
    ];
    let t = share.clamp(0.0, 1.0);
    [RED, GREEN, BLUE].map(|channel| {
        let value = channel.iter().rev().fold(0.0, |sum, c| sum * t + c);
        (value.clamp(0.0, 1.0) * 255.0).round() as u8
    })
}

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
        let index = |place: f64, size: usize, cells: usize| {
            ((place.max(0.0) as usize) * cells / size.max(1)).min(cells - 1)
        };
        (index(x, size.0, cells.0), index(y, size.1, cells.1))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_of_the_scale_are_round() {
        for (least, step) in [
            (0.9, 1.0),
            (1.1, 2.0),
            (23.0, 50.0),
            (0.03, 0.05),
            (6.0, 10.0),
        ] {
            assert!((round_step(least) - step).abs() < 1e-9 * step, "{least}");
        }
    }

    #[test]
    fn one_stray_height_does_not_take_the_colours() {
        let mut mm: Vec<f32> = (0..1000).map(|i| i as f32 / 1000.0).collect();
        mm[3] = 500.0;
        mm[4] = f32::NAN;
        let [low, high] = scale_of(&mm);
        assert!(low < 0.02 && (0.9..1.0).contains(&high), "{low} {high}");
        assert_eq!(scale_of(&[f32::NAN]), [0.0, 1.0]);
    }

    #[test]
    fn empty_small_and_wide_maps_all_give_a_picture() {
        for (width, height) in [(1, 1), (3, 700), (2500, 2)] {
            let png = height_png(width, height, &vec![f32::NAN; (width * height) as usize]);
            assert_eq!(&png[1..4], b"PNG");
        }
    }

    #[test]
    fn lightness_rises_over_the_whole_scale() {
        let lightness = |share: f64| {
            let [r, g, b] = viridis(share).map(f64::from);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        let steps: Vec<f64> = (0..=32).map(|i| lightness(f64::from(i) / 32.0)).collect();
        assert!(
            steps.windows(2).all(|pair| pair[1] > pair[0] - 0.5),
            "{steps:?}"
        );
        assert!(steps[32] - steps[0] > 150.0);
    }
}
