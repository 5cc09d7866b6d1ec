//! The live picture: the frame in fewer pixels, its PNG with saturated pixels in red, and what it says of
//! light, of the sharpness of edges, and of the modulation of fringes over the last pictures.

mod patterns;
mod volume;

pub use patterns::{Show, rasters};
pub use volume::{VolumeOutline, outlines};

use crate::head::examine::median;
use crate::output::Canvas;
use hal::frame::{Frame, Samples};
use patterns::SHIFTS;
use serde::Serialize;

/// Most columns of a picture.
pub const MAX_COLUMNS: usize = 728;
/// The colour of a saturated pixel.
const SATURATED: [u8; 3] = [220, 20, 20];
/// The colour of corners that were found.
const FOUND: [u8; 3] = [40, 220, 90];
/// Radius of the circle around a corner, pixels, and around the first one.
const RADIUS: i32 = 4;
const FIRST: i32 = 8;
/// Bins of the histogram.
const BINS: usize = 64;
/// Share of the pixels that may be brighter than the brightest that counts.
const GLINTS: f64 = 0.001;
/// Share of the pixels with the steepest edges that is left out.
const STEEPEST: f64 = 0.005;
/// A pixel is lit if its mean over the shifts is this share of full scale.
const LIT: f64 = 0.05;

/// Every nth pixel of every nth row of a frame. Pixels are left out and not averaged, so that
/// saturated ones and the modulation stay as they are.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The n: along both axes, one of so many pixels of the frame is in the picture.
    pub every: usize,
    /// The samples, row-major.
    pub counts: Vec<u16>,
    /// The largest sample.
    pub full_scale: u16,
}

impl Picture {
    /// The picture of a frame.
    pub fn of(frame: &Frame) -> Self {
        let format = frame.format();
        let (columns, rows) = (format.width as usize, format.height as usize);
        let every = columns.div_ceil(MAX_COLUMNS).max(1);
        let counts = match frame.samples() {
            Samples::Eight(all) => thinned(all, format.stride, columns, rows, every),
            Samples::Sixteen(all) => thinned(all, format.stride, columns, rows, every),
        };
        Self {
            width: columns.div_ceil(every),
            height: rows.div_ceil(every),
            every,
            counts,
            full_scale: format.full_scale(),
        }
    }

    /// The picture as PNG, with a circle around each of these places of the frame, u and v in its
    /// pixels; the first circle is larger.
    pub fn png(&self, marked: &[[f64; 2]]) -> Vec<u8> {
        let mut canvas = Canvas::<3>::new(self.width, self.height);
        let full = u32::from(self.full_scale.max(1));
        for (pixel, count) in canvas.pixels.iter_mut().zip(&self.counts) {
            let grey = (u32::from(*count) * 255 / full).min(255) as u8;
            *pixel = match *count >= self.full_scale {
                true => SATURATED,
                false => [grey; 3],
            };
        }
        for (at, [u, v]) in marked.iter().enumerate() {
            let place = |at: f64| (at / self.every as f64).round() as i32;
            let radius = if at == 0 { FIRST } else { RADIUS };
            circle(&mut canvas, (place(*u), place(*v)), radius);
        }
        canvas.png(png::Compression::Fastest)
    }
}

fn thinned<T: Copy + Into<u16>>(
    all: &[T],
    stride: usize,
    columns: usize,
    rows: usize,
    every: usize,
) -> Vec<u16> {
    let rows = (0..rows).step_by(every);
    rows.flat_map(|row| {
        let row = &all[row * stride..row * stride + columns];
        row.iter().step_by(every).map(|count| (*count).into())
    })
    .collect()
}

fn circle(canvas: &mut Canvas<3>, (x, y): (i32, i32), radius: i32) {
    for dy in -radius..=radius {
        for dx in -radius..=radius {
            let off = dx * dx + dy * dy - radius * radius;
            if off.abs() <= radius
                && let (Ok(x), Ok(y)) = (usize::try_from(x + dx), usize::try_from(y + dy))
            {
                canvas.set(x, y, FOUND);
            }
        }
    }
}

/// The figures of one picture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// Pixels by their light, from dark to full scale.
    pub histogram: Vec<u32>,
    /// Share of the pixels at full scale.
    pub saturated: f64,
    /// The brightest pixels but for glints, share of full scale.
    pub brightest: f64,
    /// Mean, share of full scale.
    pub mean: f64,
    /// The steepest edge, share of the picture's contrast per pixel of the frame.
    pub sharpness: f64,
}

impl Figures {
    /// The figures of a picture.
    pub fn of(picture: &Picture) -> Self {
        let full = f64::from(picture.full_scale.max(1));
        let mut histogram = vec![0; BINS];
        let (mut saturated, mut sum) = (0.0, 0.0);
        for count in &picture.counts {
            let share = f64::from(*count) / full;
            histogram[((share * BINS as f64) as usize).min(BINS - 1)] += 1;
            saturated += f64::from(u8::from(*count >= picture.full_scale));
            sum += share;
        }
        let pixels = picture.counts.len().max(1) as f64;
        let mut sorted = picture.counts.clone();
        let mut share = |part: f64| quantile(&mut sorted, part) / full;
        let (dark, brightest) = (share(0.01), share(1.0 - GLINTS));
        Self {
            histogram,
            saturated: saturated / pixels,
            brightest,
            mean: sum / pixels,
            sharpness: steepest(picture)
                / full
                / f64::max(brightest - dark, 1e-3)
                / picture.every as f64,
        }
    }
}

/// Half the difference of the neighbours of the steepest pixels, counts.
fn steepest(picture: &Picture) -> f64 {
    let (width, counts) = (picture.width, &picture.counts);
    let mut slopes = Vec::with_capacity(counts.len());
    for row in counts.chunks(width.max(1)) {
        slopes.extend(row.windows(3).map(|three| three[2].abs_diff(three[0])));
    }
    quantile(&mut slopes, 1.0 - STEEPEST) / 2.0
}

/// The value below which lies this part of all values, 0 if there is none.
fn quantile(values: &mut [u16], part: f64) -> f64 {
    match values.len().checked_sub(1) {
        None => 0.0,
        Some(last) => f64::from(*values.select_nth_unstable((part * last as f64) as usize).1),
    }
}

/// The last picture of each shift of the fringes of each pitch.
#[derive(Debug, Default)]
pub struct Fringes {
    pitches: Vec<Shifts>,
}

#[derive(Debug, Default)]
struct Shifts {
    pitch: u32,
    /// The shift that is shown next.
    next: usize,
    pictures: [Option<Picture>; SHIFTS],
}

impl Fringes {
    fn of(&self, pitch: u32) -> Option<&Shifts> {
        self.pitches.iter().find(|shifts| shifts.pitch == pitch)
    }

    /// The shift to show next.
    pub fn next(&self, show: Show) -> usize {
        let shifts = show.pitch().and_then(|pitch| self.of(pitch));
        shifts.map_or(0, |shifts| shifts.next)
    }

    /// Keeps a picture of the shift that was to be shown next.
    pub fn add(&mut self, show: Show, picture: Picture) {
        let Some(pitch) = show.pitch() else { return };
        if self.of(pitch).is_none() {
            self.pitches.push(Shifts {
                pitch,
                ..Shifts::default()
            });
        }
        let mut all = self.pitches.iter_mut();
        if let Some(shifts) = all.find(|shifts| shifts.pitch == pitch) {
            shifts.pictures[shifts.next] = Some(picture);
            shifts.next = (shifts.next + 1) % SHIFTS;
        }
    }

    /// Modulation over offset, B/A, of the fringes of a pitch: the median over the lit pixels, 0…1.
    /// `None` until each shift was seen.
    ///
    /// B = ½ √((I₀ − I₂)² + (I₁ − I₃)²) for shifts of a quarter of a turn (Creath 1988).
    pub fn modulation(&self, pitch: u32) -> Option<f64> {
        let [Some(a), Some(b), Some(c), Some(d)] = &self.of(pitch)?.pictures else {
            return None;
        };
        let size = |picture: &Picture| (picture.width, picture.height);
        if [b, c, d].into_iter().any(|other| size(other) != size(a)) {
            return None;
        }
        let least = 4.0 * LIT * f64::from(a.full_scale);
        let shares = (0..a.counts.len()).filter_map(|at| {
            let [a, b, c, d] = [a, b, c, d].map(|picture| f64::from(picture.counts[at]));
            let sum = a + b + c + d;
            (sum >= least).then(|| 2.0 * (a - c).hypot(b - d) / sum)
        });
        Some(median(shares.collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(counts: Vec<u16>) -> Picture {
        Picture {
            width: counts.len() / 2,
            height: 2,
            every: 1,
            counts,
            full_scale: 255,
        }
    }

    #[test]
    fn light_saturation_and_edges_are_counted() {
        // Two rows, half dark, half at full scale, with one step between them.
        let row = [vec![10; 50], vec![255; 50]].concat();
        let figures = Figures::of(&picture([row.clone(), row].concat()));
        assert_eq!((figures.histogram[2], figures.histogram[63]), (100, 100));
        assert!((figures.saturated - 0.5).abs() < 1e-12 && figures.brightest == 1.0);
        assert!((figures.sharpness - 0.5).abs() < 1e-9, "{figures:?}");
    }

    #[test]
    fn modulation_needs_all_shifts_and_is_that_of_the_fringes() {
        let mut fringes = Fringes::default();
        let shift = |shift: usize| {
            let light = |at: usize| {
                let turns = at as f64 / 16.0 - shift as f64 / 4.0;
                (100.0 + 60.0 * (turns * std::f64::consts::TAU).cos()).round() as u16
            };
            picture((0..64).map(light).collect())
        };
        for at in 0..3 {
            assert_eq!(fringes.next(Show::Fringes8), at);
            fringes.add(Show::Fringes8, shift(at));
        }
        assert_eq!(fringes.modulation(8), None);
        fringes.add(Show::Fringes8, shift(3));
        assert_eq!(fringes.next(Show::Fringes8), 0);
        let modulation = fringes.modulation(8).unwrap();
        assert!((modulation - 0.6).abs() < 0.01, "{modulation}");
        assert_eq!(fringes.modulation(12), None);
    }
}
