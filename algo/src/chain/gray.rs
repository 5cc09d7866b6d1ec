//! Gray code: which cell of the projector lights a pixel, from one picture per bit (Sansoni,
//! Carocci & Rodella 1999, with phase shifts as here), and where the cells end within the fringes.
//!
//! Edge e of the cells lies at Φ = origin + e · width, so the phases that pixels have there check the
//! stated offset, width, and sign of the shifts ([`Edges`]).

use super::Cells;
use crate::frame::FrameView;
use crate::pipeline::PhaseMap;
use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

/// Most bits of a code: as many cells as the widest projector has columns.
pub const MAX_CODE_BITS: u8 = 13;
/// Largest misalignment of cells and fringes that is not a matter of conventions, in turns: these
/// differ by quarters of a turn.
pub const EXPECTED_TURNS: f64 = 0.125;
/// Fewest edges that are significant: random phases of so many edges have [`CONCENTRATED`] by chance
/// once in 25 000 times.
const FEWEST: usize = 24;
/// Concentration of phases at edges that belong together: 0 for any phases, 1 for equal ones, and
/// 0.65 if they are spread evenly over half a turn.
const CONCENTRATED: f64 = 0.65;
/// Largest change of the phase over an edge whose place is of use, turns: spread over it, phases
/// have a concentration of 0.74.
const LOCATED: f64 = 0.42;
/// Farthest pixels between which an edge may lie: on it bits are not decisive.
const FARTHEST: usize = 4;
/// Largest change of the phase from pixel to pixel that is not aliased, in turns.
const LARGEST_STEP: f64 = 0.45;
/// Noise of the distance of two pixels, in cells.
const NOISE: f64 = 0.1;
/// How far the width of cells is sought around that which the phase advances by per cell, as a
/// share of it.
const SOUGHT: f64 = 0.05;

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
pub struct CodeWord {
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
    /// Number of cells on a raster of `length` pixels across them that can be told apart. Where there
    /// is one cell more than the bits can number, as in a code of as many cells as fringes that is
    /// shifted by half a cell, the last two show the same Gray code, and neither counts.
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
    pub fn read(&self) -> Result<Vec<CodeWord>, CodeError> {
        let count = self.bits.len();
        let (width, height) = self.size()?;
        let mut seen = vec![CodeWord::default(); width * height];
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
        self.bits[bit].row(v).add_to(&mut own);
        for frame in against {
            frame.row(v).add_to(&mut sum);
        }
        let count = against.len() as i64;
        let pairs = own.iter().zip(&sum);
        pairs
            .map(|(&own, &sum)| i64::from(own) * count - i64::from(sum))
            .collect()
    }
}

/// The edges of a code's cells in the wrapped phase of a level.
#[derive(Clone, Debug, Default)]
pub struct Edges {
    /// Neighbouring pixels in different cells.
    changes: usize,
    /// Of these pairs, those whose cells are as near to each other as the phase says.
    smooth: usize,
    /// Of those, the pairs whose edge is located well enough.
    located: usize,
    /// Σ exp(2πi φ) at located edges. The index is the sum of the numbers of both cells and 1,
    /// which is twice the number of the edge.
    sums: Vec<[f64; 2]>,
    /// Along rows and along columns, what the phase advances by in turns, and the code in cells.
    advances: [(f64, f64); 2],
}

impl Edges {
    /// The edges of cells (in turns of the phase function) in a level of this ratio: its wrapped
    /// phase, and what each pixel sees of the code.
    pub fn of(wrapped: &PhaseMap, code: &[CodeWord], cells: &Cells, ratio: f64) -> Self {
        let (width, pixels) = (wrapped.width.max(1), wrapped.phase.len());
        let mut edges = Self {
            sums: vec![[0.0; 2]; 2 << cells.bits],
            ..Self::default()
        };
        let turns = cells.width * ratio;
        for row in (0..pixels).step_by(width) {
            edges.line(0, row..row + width, wrapped, code, cells, turns);
        }
        for column in 0..width.min(pixels) {
            let pixels = (column..pixels).step_by(width);
            edges.line(1, pixels, wrapped, code, cells, turns);
        }
        edges
    }

    /// Adds the edges along a row or a column.
    fn line(
        &mut self,
        axis: usize,
        pixels: impl Iterator<Item = usize>,
        wrapped: &PhaseMap,
        code: &[CodeWord],
        cells: &Cells,
        turns: f64,
    ) {
        let all = ((1_u32 << cells.bits) - 1) as u16;
        // The last pixel that is surely in a cell: its phase, cell, and what the phase advanced by
        // since then in so many pixels.
        let mut last: Option<(f64, i32, f64, usize)> = None;
        let mut before = 0.0;
        for at in pixels {
            if !wrapped.trust[at].has_phase() {
                last = None;
                continue;
            }
            let phase = wrapped.phase[at].turns();
            let step = phase - before - libm::rint(phase - before);
            before = phase;
            last = last
                .filter(|last| libm::fabs(step) < LARGEST_STEP && last.3 < FARTHEST)
                .map(|(from, cell, advance, count)| (from, cell, advance + step, count + 1));
            if code[at].decisive & all != all {
                continue;
            }
            let cell = i32::from(cells.coding.cell(code[at].word, cells.bits));
            if let Some((from, other, advance, _)) = last {
                self.pair((other, cell), from, advance, turns, axis);
            }
            last = Some((phase, cell, 0.0, 0));
        }
    }

    /// Adds a pair of pixels, with the phase of the first and what the phase advances by up to the
    /// second.
    fn pair(&mut self, cells: (i32, i32), phase: f64, advance: f64, turns: f64, axis: usize) {
        let change = cells.1 - cells.0;
        self.changes += usize::from(change != 0);
        // The numbers of the cells of two points that are x cells apart differ by less than x + 1.
        if f64::from(change.abs()) > libm::fabs(advance) / turns + 1.0 + NOISE {
            return;
        }
        self.advances[axis].0 += advance;
        self.advances[axis].1 += f64::from(change);
        self.smooth += usize::from(change != 0);
        if change != 0 && libm::fabs(advance) <= LOCATED {
            self.located += 1;
            let (sin, cos) = libm::sincos(TAU * (phase + advance / 2.0));
            let sum = &mut self.sums[(cells.0 + cells.1 + 1) as usize];
            *sum = [sum[0] + cos, sum[1] + sin];
        }
    }

    /// Whether there are enough edges to be significant.
    pub fn are_many(&self) -> bool {
        self.located >= FEWEST
    }

    /// Share of the edges between cells that are as near to each other as the phase says.
    pub fn smoothness(&self) -> f64 {
        self.smooth as f64 / self.changes.max(1) as f64
    }

    /// What the phase advances by per cell, in turns, from the sums over all pixels: negative if it
    /// falls where the code rises.
    pub fn turns_per_cell(&self) -> f64 {
        let [rows, columns] = self.advances;
        let (turns, cells) = match libm::fabs(rows.1) >= libm::fabs(columns.1) {
            true => rows,
            false => columns,
        };
        if cells == 0.0 { 0.0 } else { turns / cells }
    }

    /// The number of the last edge.
    pub fn last(&self) -> f64 {
        let seen = self.sums.iter().rposition(|sum| *sum != [0.0; 2]);
        seen.unwrap_or(0) as f64 / 2.0
    }

    /// Number of cells between the first and the last edge.
    pub fn span(&self) -> f64 {
        let first = self.sums.iter().position(|sum| *sum != [0.0; 2]);
        self.last() - first.unwrap_or(0) as f64 / 2.0
    }

    /// The phase at edge 0, in turns from −½ to ½, and how well the phases at all edges agree with
    /// cells that are `turns` wide (negative where the phase falls), from 0 to 1.
    pub fn origin(&self, turns: f64) -> (f64, f64) {
        let mut sum = [0.0; 2];
        let seen = self.sums.iter().enumerate();
        for (twice, &[re, im]) in seen.filter(|(_, sum)| **sum != [0.0; 2]) {
            let angle = libm::remainder(turns * twice as f64 / 2.0, 1.0);
            let (sin, cos) = libm::sincos(TAU * angle);
            sum = [sum[0] + re * cos + im * sin, sum[1] + im * cos - re * sin];
        }
        let size = libm::sqrt(sum[0] * sum[0] + sum[1] * sum[1]);
        (
            libm::atan2(sum[1], sum[0]) / TAU,
            size / self.located.max(1) as f64,
        )
    }

    /// The width of cells in turns, near to [`Self::turns_per_cell`], that the phases at the edges
    /// agree with best.
    pub fn fitted(&self) -> f64 {
        let near = self.turns_per_cell();
        let span = self.span().max(1.0);
        let reach = SOUGHT * libm::fabs(near) + 1.0 / span;
        // The agreement falls to zero a turn over the whole span away.
        let coarse = 1.0 / (8.0 * span);
        let best = self.best(near, reach, coarse);
        self.best(best, coarse, coarse / 64.0)
    }

    fn best(&self, near: f64, reach: f64, step: f64) -> f64 {
        let count = libm::ceil(reach / step) as i32;
        let tried = (-count..=count).map(|at| near + f64::from(at) * step);
        let agreeing = tried.map(|turns| (turns, self.origin(turns).1));
        let best = agreeing.fold(
            (near, -1.0),
            |best, next| {
                if next.1 > best.1 { next } else { best }
            },
        );
        best.0
    }

    /// By how many turns of a level of this ratio the phases at the edges of cells are off those
    /// that the cells should end at, if there are enough edges that agree, and it is not a matter
    /// of conventions.
    pub fn misalignment(&self, cells: &Cells, ratio: f64) -> Option<f64> {
        let (origin, concentration) = self.origin(cells.width * ratio);
        let off = libm::remainder(origin - cells.origin * ratio, 1.0);
        let agrees = self.are_many()
            && concentration >= CONCENTRATED
            && self.turns_per_cell() > 0.0
            && libm::fabs(off) <= EXPECTED_TURNS;
        agrees.then_some(off)
    }

    /// Whether the phases at the edges agree with cells that are `turns` wide.
    pub fn agree(&self, turns: f64) -> bool {
        self.origin(turns).1 >= CONCENTRATED
    }
}
