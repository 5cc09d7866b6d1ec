//! Gray code: which cell of the projector lights a pixel, from one picture per bit (Sansoni,
//! Carocci & Rodella 1999, with phase shifts as here).

use crate::frame::{FrameView, Samples};
use alloc::vec;
use alloc::vec::Vec;

/// Most bits of a code: as many cells as the widest projector has columns.
pub const MAX_CODE_BITS: u8 = 13;

/// A Gray code over the columns or rows of a projector: cell c shows the bits of c ^ (c >> 1), the
/// most significant first. Neighbouring cells differ in one bit, so a pixel on their border is
/// never wrong by more than one cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GrayCode {
    /// Number of bits, and of pictures.
    pub bits: u8,
    /// Width of a cell in projector pixels.
    pub cell: f64,
    /// How far before the raster's edge the first cell begins, projector pixels.
    pub offset: f64,
    /// How the numbers of cells are written.
    pub coding: Coding,
}

/// How the number of a cell is written in its bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Coding {
    /// Cell c shows the bits of c itself instead of those of its Gray code.
    pub binary: bool,
    /// Bits that are set are dark instead of bright.
    pub inverted: bool,
}

/// What a pixel sees of a code.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Seen {
    /// A bit for each picture, the last one's lowest: whether the pixel is bright in it.
    pub word: u16,
    /// The bits of `word` that noise cannot change: their contrast is at least half of that of the
    /// clearest bit.
    pub decisive: u16,
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
    /// What each bit is compared with: a bit is set where its sample is above the mean of these
    /// frames. One list for all bits (white and black, or the shifts of a level, whose mean is the
    /// offset A), or one list per bit (the inverse picture).
    pub against: Vec<Vec<FrameView<'a>>>,
}

impl GrayCode {
    /// Number of cells on a raster of `length` pixels across them that can be told apart. Where the
    /// bits number one cell less than there are, as where a code of as many cells as fringes was
    /// moved by half a cell, the last two show the same Gray code, and neither counts.
    pub fn cells(&self, length: u32) -> u32 {
        let most = 1_u32 << self.bits;
        let cells = libm::ceil((f64::from(length) + self.offset) / self.cell - 1e-9).max(1.0);
        match cells <= f64::from(most) {
            true => cells as u32,
            false => most - 1,
        }
    }

    /// Whether the picture of `bit` (0 is the most significant) lights the projector pixel `at`.
    pub fn lights(&self, bit: u8, at: u32) -> bool {
        let cell = libm::floor((f64::from(at) + 0.5 + self.offset) / self.cell) as u32;
        self.coding.word(cell, self.bits) >> (self.bits - 1 - bit) & 1 == 1
    }
}

impl Coding {
    /// The word of a cell in so many bits.
    pub fn word(self, cell: u32, bits: u8) -> u16 {
        let code = if self.binary {
            cell
        } else {
            cell ^ (cell >> 1)
        };
        let dark = if self.inverted { u32::MAX } else { 0 };
        ((code ^ dark) & ((1_u32 << bits) - 1)) as u16
    }

    /// The cell of a word of so many bits.
    pub fn cell(self, word: u16, bits: u8) -> u16 {
        let dark = if self.inverted { u16::MAX } else { 0 };
        let mut cell = (word ^ dark) & ((1_u32 << bits) - 1) as u16;
        if !self.binary {
            // Gray to binary: each bit is the one before it, changed where the Gray bit is set.
            for shift in [1, 2, 4, 8] {
                cell ^= cell >> shift;
            }
        }
        cell
    }
}

impl CodePictures<'_> {
    /// Columns and rows of its pictures.
    ///
    /// # Errors
    /// If the pictures do not form a code.
    pub(super) fn size(&self) -> Result<(usize, usize), CodeError> {
        let count = self.bits.len();
        let first = self.bits.first();
        let first = first.filter(|_| count <= usize::from(MAX_CODE_BITS));
        let first = first.ok_or(CodeError::Bits(count))?;
        let size = (first.width(), first.height());
        let mut all = self.bits.iter().chain(self.against.iter().flatten());
        let lists = [1, count].contains(&self.against.len());
        if !lists
            || self.against.iter().any(Vec::is_empty)
            || all.any(|frame| (frame.width(), frame.height()) != size)
        {
            return Err(CodeError::Pictures);
        }
        Ok(size)
    }

    /// What each pixel sees of the code, row-major.
    ///
    /// # Errors
    /// If the pictures do not form a code.
    pub fn read(&self) -> Result<Vec<Seen>, CodeError> {
        let count = self.bits.len();
        let (width, height) = self.size()?;
        let mut seen = vec![Seen::default(); width * height];
        crate::pipeline::for_each_row(&mut seen, width, |v, row| {
            let contrasts: Vec<Vec<i64>> = (0..count).map(|bit| self.contrasts(bit, v)).collect();
            for (u, seen) in row.iter_mut().enumerate() {
                let most = contrasts.iter().map(|bit| bit[u].abs()).max().unwrap_or(0);
                for contrast in contrasts.iter().map(|bit| bit[u]) {
                    let decisive = most > 0 && 2 * contrast.abs() >= most;
                    seen.word = seen.word << 1 | u16::from(contrast > 0);
                    seen.decisive = seen.decisive << 1 | u16::from(decisive);
                }
            }
        });
        Ok(seen)
    }

    /// By how much the samples of a row of a bit's picture are above what they are compared with,
    /// the same multiple for all bits.
    fn contrasts(&self, bit: usize, v: usize) -> Vec<i64> {
        let against = self.against.get(bit).unwrap_or(&self.against[0]);
        let width = self.bits[bit].width();
        let (mut own, mut sum) = (vec![0_u32; width], vec![0_u32; width]);
        add(&mut own, &self.bits[bit], v);
        for frame in against {
            add(&mut sum, frame, v);
        }
        let count = against.len() as i64;
        let pairs = own.iter().zip(&sum);
        pairs
            .map(|(&own, &sum)| i64::from(own) * count - i64::from(sum))
            .collect()
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
