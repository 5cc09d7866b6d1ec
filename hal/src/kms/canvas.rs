//! A picture in the display card's memory, which is shown without copying.

use drm::buffer::{Buffer, DrmFourcc};
use drm::control::dumbbuffer::DumbBuffer;
use drm::control::{Device, framebuffer};

use super::card::{Card, refused};
use crate::error::Error;
use crate::projector::Raster;

/// Pixel format: bytes blue, green, red, unused. Every driver supports it.
pub(super) const FORMAT: DrmFourcc = DrmFourcc::Xrgb8888;
/// Bytes of a pixel.
const PIXEL: usize = 4;

/// A buffer and its handle for showing.
#[derive(Debug)]
pub(super) struct Canvas {
    buffer: DumbBuffer,
    pub shown_as: framebuffer::Handle,
}

impl Canvas {
    /// A buffer of the card for pictures of this size; its content is undefined.
    pub fn new(card: &Card, (width, height): (u32, u32)) -> Result<Self, Error> {
        let attempt = || format!("making a display buffer of {width}×{height} pixels");
        let buffer = card
            .create_dumb_buffer((width, height), FORMAT, 32)
            .map_err(|error| refused(attempt(), &error))?;
        match card.add_framebuffer(&buffer, 24, 32) {
            Ok(shown_as) => Ok(Self { buffer, shown_as }),
            Err(error) => {
                let _ = card.destroy_dumb_buffer(buffer);
                Err(refused(attempt(), &error))
            }
        }
    }

    /// Draws a raster of the buffer's size.
    pub fn draw(&mut self, card: &Card, raster: &Raster) -> Result<(), Error> {
        let pitch = self.buffer.pitch() as usize;
        let mut memory = card
            .map_dumb_buffer(&mut self.buffer)
            .map_err(|error| refused("writing to a display buffer", &error))?;
        draw(raster, pitch, &mut memory);
        Ok(())
    }

    /// Frees the memory. If the card is gone, this fails and nothing remains to be done.
    pub fn free(&self, card: &Card) {
        let _ = card.destroy_framebuffer(self.shown_as);
        let _ = card.destroy_dumb_buffer(self.buffer);
    }
}

/// Writes grey levels as pixels, `pitch` bytes from row to row.
fn draw(raster: &Raster, pitch: usize, memory: &mut [u8]) {
    let width = raster.width() as usize;
    // Whole rows are copied from ordinary memory, as single bytes may be slow to write to the
    // card's.
    let mut line = vec![0; width * PIXEL];
    for (row, into) in raster
        .pixels()
        .chunks_exact(width)
        .zip(memory.chunks_mut(pitch))
    {
        for (grey, pixel) in row.iter().zip(line.chunks_exact_mut(PIXEL)) {
            pixel[..3].fill(*grey);
        }
        into[..line.len()].copy_from_slice(&line);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_raster_is_drawn_grey_for_grey_whatever_lies_between_the_rows() {
        let raster = Raster::new(3, 2, vec![0, 1, 2, 253, 254, 255]).unwrap();
        for padding in [0, 4, 52] {
            let pitch = 3 * PIXEL + padding;
            let mut memory = vec![0xEE; 2 * pitch];
            draw(&raster, pitch, &mut memory);
            for (index, grey) in raster.pixels().iter().enumerate() {
                let at = index / 3 * pitch + index % 3 * PIXEL;
                assert_eq!(
                    memory[at..at + PIXEL],
                    [*grey, *grey, *grey, 0],
                    "pixel {index}, {padding} between"
                );
            }
            assert!(
                memory[3 * PIXEL..pitch].iter().all(|byte| *byte == 0xEE),
                "only pixels are written"
            );
        }
    }
}
