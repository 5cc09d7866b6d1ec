//! Gray code: which cell of the projector lights a pixel, from one picture per bit (Sansoni, Carocci & Rodella 1999, with phase
//! shifts as here).

use crate::frame::{FrameView, Samples};
use alloc::vec;
use alloc::vec::Vec;

/// Most bits of a code: as many cells as the widest projector has columns.
pub const MAX_CODE_BITS: u8 = 13;

/// A Gray code over the columns or rows of a projector: cell c shows the bits of c ^ (c >> 1), the most significant first.
/// Neighbouring cells differ in one bit, so a pixel on their border is never wrong by more than one cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GrayCode {
    /// Number of bits, and of pictures.
    pub bits: u8,
    /// Width of a cell in projector pixels; the first cell begins at the raster's edge.
    pub cell: f64,
}

/// Pictures that do not form a code.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CodeError {
    /// No bits, or more than [`MAX_CODE_BITS`].
    #[error("{0} bits of a Gray code: 1 to {MAX_CODE_BITS} can be decoded")]
    Bits(usize),
    /// A picture has another size than the first, or nothing to compare it with.
    #[error("the pictures of a Gray code differ in size, or there is nothing to compare them with")]
    Pictures,
}

/// The pictures of a Gray code.
#[derive(Clone, Debug)]
pub struct CodePictures<'a> {
    /// One per bit, the most significant first.
    pub bits: Vec<FrameView<'a>>,
    /// What each bit is compared with: a bit is set where its sample is above the mean of these frames. One list for all bits (white
    /// and black, or the shifts of a level, whose mean is the offset A), or one list per bit (the inverse picture).
    pub against: Vec<Vec<FrameView<'a>>>,
}

impl GrayCode {
    /// Number of cells on a raster of `length` pixels across them.
    pub fn cells(&self, length: u32) -> u32 {
        let cells = libm::ceil(f64::from(length) / self.cell - 1e-9).max(1.0);
        cells.min(f64::from(1_u32 << self.bits)) as u32
    }

    /// Whether the picture of `bit` (0 is the most significant) lights the projector pixel `at`.
    pub fn lights(&self, bit: u8, at: u32) -> bool {
        let cell = libm::floor((f64::from(at) + 0.5) / self.cell) as u32;
        let code = cell ^ (cell >> 1);
        code >> (self.bits - 1 - bit) & 1 == 1
    }
}

impl CodePictures<'_> {
    /// The cell that each pixel sees, row-major.
    ///
    /// # Errors
    /// If the pictures do not form a code.
    pub fn cells(&self) -> Result<Vec<u16>, CodeError> {
        let count = self.bits.len();
        let Some(first) = self
            .bits
            .first()
            .filter(|_| count <= usize::from(MAX_CODE_BITS))
        else {
            return Err(CodeError::Bits(count));
        };
        let (width, height) = (first.width(), first.height());
        let mut all = self.bits.iter().chain(self.against.iter().flatten());
        let lists = [1, count].contains(&self.against.len());
        if !lists
            || self.against.iter().any(Vec::is_empty)
            || all.any(|frame| (frame.width(), frame.height()) != (width, height))
        {
            return Err(CodeError::Pictures);
        }
        let mut cells = vec![0_u16; width * height];
        crate::pipeline::for_each_row(&mut cells, width, |v, row| {
            let mut mean = vec![0_u32; width];
            for (bit, picture) in self.bits.iter().enumerate() {
                let against = self.against.get(bit).unwrap_or(&self.against[0]);
                mean.fill(0);
                for frame in against {
                    add(&mut mean, frame, v);
                }
                let mut own = vec![0_u32; width];
                add(&mut own, picture, v);
                for ((cell, own), mean) in row.iter_mut().zip(&own).zip(&mean) {
                    let set = own * against.len() as u32 > *mean;
                    // Gray to binary: each bit is the one before it, changed where the Gray bit is set.
                    *cell = *cell << 1 | (*cell & 1 ^ u16::from(set));
                }
            }
        });
        Ok(cells)
    }
}

fn add(sums: &mut [u32], frame: &FrameView<'_>, v: usize) {
    match frame.row(v) {
        Samples::Eight(row) => {
            for (sum, &sample) in sums.iter_mut().zip(row) {
                *sum += u32::from(sample);
            }
        }
        Samples::Sixteen(row) => {
            for (sum, &sample) in sums.iter_mut().zip(row) {
                *sum += u32::from(sample);
            }
        }
    }
}
