//! A live picture: the frame in fewer pixels, and its PNG with saturated pixels in red.

use crate::output::canvas::Canvas;
use hal::frame::{Frame, Samples};

/// Most columns of a picture.
pub const MAX_COLUMNS: usize = 728;
/// The colour of a saturated pixel.
const SATURATED: [u8; 3] = [220, 20, 20];
/// The colour of corners that were found.
const FOUND: [u8; 3] = [40, 220, 90];
/// Radius of the circle around a corner, pixels, and around the first one.
const RADIUS: i32 = 4;
const FIRST: i32 = 8;

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
