//! Output of a measurement for people: pictures and point clouds. Pictures are drawn on a [`Canvas`],
//! a raster for pixels and text.

pub mod board;
pub mod cloud;
pub mod npz;
pub mod picture;

use embedded_graphics::Drawable;
use embedded_graphics::mono_font::iso_8859_1::FONT_7X14;
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::BinaryColor;
use embedded_graphics::prelude::{DrawTarget, OriginDimensions, Pixel, Point, Size};
use embedded_graphics::text::{Baseline, Text};

/// The font of all pictures.
const FONT: MonoFont<'static> = FONT_7X14;
/// Height of a line of text, pixels.
pub const LINE: usize = FONT.character_size.height as usize;
/// Width of a letter with the space after it, pixels.
pub const LETTER: usize = FONT.character_size.width as usize;
/// Lightness of the background and of text.
const BACKGROUND: u8 = 24;
const INK: u8 = 225;

/// A raster of `N` channels of 8 bits: 1 is grey, 3 is red, green, blue.
pub struct Canvas<const N: usize> {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Row by row.
    pub pixels: Vec<[u8; N]>,
}

impl<const N: usize> Canvas<N> {
    /// An empty picture.
    pub fn new(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            pixels: vec![[BACKGROUND; N]; width * height],
        }
    }

    /// Sets a pixel; outside the picture nothing happens.
    pub fn set(&mut self, x: usize, y: usize, colour: [u8; N]) {
        if x < self.width && y < self.height {
            self.pixels[y * self.width + x] = colour;
        }
    }

    /// Writes a line of Latin text with its upper left corner at (x, y).
    pub fn text(&mut self, text: &str, x: usize, y: usize) {
        self.text_in(text, x, y, [INK; N]);
    }

    /// As [`Self::text`], in a colour.
    pub fn text_in(&mut self, text: &str, x: usize, y: usize, colour: [u8; N]) {
        let style = MonoTextStyle::new(&FONT, BinaryColor::On);
        let at = Point::new(x as i32, y as i32);
        let mut ink = Ink {
            canvas: self,
            colour,
        };
        // Drawing on this canvas cannot fail: its error type has no values.
        let Ok(_) = Text::with_baseline(text, at, style, Baseline::Top).draw(&mut ink);
    }

    /// As a PNG.
    pub fn png(&self, compression: png::Compression) -> Vec<u8> {
        let colour = match N {
            1 => png::ColorType::Grayscale,
            _ => png::ColorType::Rgb,
        };
        let size = (self.width, self.height);
        encoded(size, colour, compression, self.pixels.as_flattened())
    }
}

/// A PNG of grey levels, row-major in rows of `width`.
pub fn grey_png(width: usize, grey: &[u8]) -> Vec<u8> {
    let size = (width, grey.len() / width.max(1));
    encoded(
        size,
        png::ColorType::Grayscale,
        png::Compression::Fast,
        grey,
    )
}

fn encoded(
    (width, height): (usize, usize),
    colour: png::ColorType,
    compression: png::Compression,
    pixels: &[u8],
) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(colour);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(compression);
    let written = encoder
        .write_header()
        .and_then(|mut writer| writer.write_image_data(pixels));
    debug_assert!(
        written.is_ok(),
        "a picture has at least one pixel and memory does not fail"
    );
    bytes
}

/// A canvas on which text is drawn in one colour.
struct Ink<'a, const N: usize> {
    canvas: &'a mut Canvas<N>,
    colour: [u8; N],
}

impl<const N: usize> OriginDimensions for Ink<'_, N> {
    fn size(&self) -> Size {
        Size::new(self.canvas.width as u32, self.canvas.height as u32)
    }
}

impl<const N: usize> DrawTarget for Ink<'_, N> {
    type Color = BinaryColor;
    type Error = core::convert::Infallible;

    fn draw_iter<I>(&mut self, pixels: I) -> Result<(), Self::Error>
    where
        I: IntoIterator<Item = Pixel<Self::Color>>,
    {
        for Pixel(at, _) in pixels.into_iter().filter(|pixel| pixel.1.is_on()) {
            if let (Ok(x), Ok(y)) = (usize::try_from(at.x), usize::try_from(at.y)) {
                self.canvas.set(x, y, self.colour);
            }
        }
        Ok(())
    }
}
