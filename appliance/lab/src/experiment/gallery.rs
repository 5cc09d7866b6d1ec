//! Pictures of a part: pattern, fringe image and point cloud, one row per method.

use super::methods::Method;
use super::runner::Run;
use super::shade;
use algo::pattern::{Encoder, Shot};
use appliance::output::canvas::{Canvas, LINE};
use hal::frame::Samples;

/// What a method showed, saw and measured.
pub struct View {
    caption: [String; 3],
    tiles: [Canvas<1>; 3],
}

/// Height of a caption with the space under it, pixels.
const CAPTION: usize = LINE + 8;
/// Columns and rows of a tile, and the space between tiles.
const TILE: usize = 512;
const GAP: usize = 8;
/// Grey levels of pattern and fringe image: enough for the eye, and noise does not fill the file.
const LEVELS: u8 = 16;

impl View {
    /// The view of a run.
    pub fn of(method: Method, run: &Run) -> Self {
        let shot = Shot::sine(1.0, 0.0);
        let raster = Encoder::new(None, &[]).raster(&run.function, shot);
        let frame = &run.measured.frames[run.finest];
        let format = frame.format();
        let bytes: Vec<u8> = match frame.samples() {
            Samples::Eight(samples) => samples.to_vec(),
            Samples::Sixteen(samples) => {
                let shift = format.bit_depth.saturating_sub(8);
                samples.iter().map(|s| (s >> shift) as u8).collect()
            }
        };
        let name = method.name();
        Self {
            caption: [
                format!("{name}: pattern, its middle, 1 px = 1 projector px"),
                format!("{name}: camera, finest level"),
                format!("{name}: measured points, shaded"),
            ],
            tiles: [
                middle(&raster.pixels, raster.width, raster.width),
                middle(&bytes, format.stride, format.width as usize),
                shade::render(&run.measured, TILE),
            ],
        }
    }
}

/// The middle of a raster, at most a tile large, in [`LEVELS`] grey levels.
fn middle(pixels: &[u8], stride: usize, width: usize) -> Canvas<1> {
    let rows = pixels.len() / stride.max(1);
    let (left, top) = (
        width.saturating_sub(TILE) / 2,
        rows.saturating_sub(TILE) / 2,
    );
    let mut tile = Canvas::new(TILE.min(width), TILE.min(rows));
    let step = 255 / (LEVELS - 1);
    for y in 0..tile.height {
        for x in 0..tile.width {
            let grey = pixels[(top + y) * stride + left + x];
            let level = (u16::from(grey) + u16::from(step) / 2) / u16::from(step);
            tile.set(x, y, [level as u8 * step]);
        }
    }
    tile
}

/// One picture of all views: a row each.
pub fn png(views: &[View]) -> Vec<u8> {
    let (across, down) = (TILE + GAP, TILE + CAPTION + GAP);
    let mut canvas = Canvas::new(3 * across + GAP, views.len().max(1) * down + GAP);
    for (row, view) in views.iter().enumerate() {
        let top = GAP + row * down;
        for (column, (tile, caption)) in view.tiles.iter().zip(&view.caption).enumerate() {
            let left = GAP + column * across;
            canvas.text(caption, left, top);
            canvas.put(tile, left, top + CAPTION);
        }
    }
    canvas.png(png::Compression::High)
}
