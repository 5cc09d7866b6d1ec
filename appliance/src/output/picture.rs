//! Colour pictures of a height map with a scale bar and its unit.

use super::canvas::{Canvas, LINE};
use super::colour::{UNRESOLVED, viridis};

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
}
