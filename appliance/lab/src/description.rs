//! What the user says about projected pictures: levels of fringes and their shifts, Gray codes, and
//! the order of projection.

use algo::chain::{Coding, GrayCode, MAX_CODE_BITS};
use thiserror::Error;

/// First shifts differ by quarters or thirds of a turn: the parts of a turn, and how near a measured
/// difference must be to a multiple of one, turns.
const USUAL: [(f64, f64); 2] = [(4.0, 0.0625), (3.0, 0.04)];

/// How the sine of a level is written down.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Convention {
    /// I = A + B sin 2π(Φ + shift).
    Sin,
    /// I = A + B cos 2π(Φ + shift).
    Cos,
}

/// Whether the shift rises or falls from frame to frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum ShiftSign {
    /// Frame k of N has the shift + k/N turn.
    #[value(name = "+")]
    Rising,
    /// Frame k of N has the shift − k/N turn.
    #[value(name = "-")]
    Falling,
}

/// The fringes of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Direction {
    /// Fringes parallel to the projector's columns.
    Vertical,
    /// Fringes parallel to its rows.
    Horizontal,
    /// Vertical ones, then horizontal ones.
    Both,
    /// Horizontal ones, then vertical ones.
    HorizontalFirst,
}

/// A part of the order of projection.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Section {
    /// The frames of all levels.
    Sine,
    /// The pictures of the Gray code.
    Gray,
    /// A white raster.
    White,
    /// A black raster.
    Black,
}

/// The convention of shifts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shifts {
    /// Sine or cosine.
    pub convention: Convention,
    /// Rising or falling.
    pub sign: ShiftSign,
    /// Shift of each level's first frame, in turns.
    pub first: f64,
}

/// The order in which the bits of a Gray code are projected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum BitOrder {
    /// The most significant bit first.
    Msb,
    /// The least significant bit first.
    Lsb,
}

/// Gray codes. Lists have one element for both codes, or one for the vertical and one for the
/// horizontal one.
#[derive(Clone, Debug, PartialEq)]
pub struct Gray {
    /// Numbers of bits.
    pub bits: Vec<u8>,
    /// Widths of cells in projector pixels; empty where a cell is a fringe of the finest level, or
    /// of a code alone a pixel.
    pub cell_px: Vec<f64>,
    /// How far before the raster's edge the first cell begins, projector pixels; empty where it
    /// begins there.
    pub offset_px: Vec<f64>,
    /// The order of the bits.
    pub order: BitOrder,
    /// How the numbers of cells are written in the bits.
    pub coding: Coding,
    /// Whether each picture is followed by its inverse.
    pub inverse: bool,
}

/// A list for vertical fringes and one for horizontal ones, or one for both.
#[derive(Clone, Debug, PartialEq)]
pub struct PerDirection<T>(pub Vec<Vec<T>>);

/// The fringes of each level, in the order of projection.
#[derive(Clone, Debug, PartialEq)]
pub enum Fringes {
    /// Numbers of fringes over the projector.
    Count(PerDirection<f64>),
    /// Projector pixels per fringe.
    Pitch(PerDirection<f64>),
    /// No fringes: a Gray code alone.
    None,
}

/// What the user says about the projected pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// Columns and rows of the projector.
    pub projector: (u32, u32),
    /// The fringes of each level.
    pub fringes: Fringes,
    /// Shifts of each level, or of all.
    pub steps: PerDirection<u8>,
    /// The convention of shifts.
    pub shifts: Shifts,
    /// The direction of fringes.
    pub direction: Direction,
    /// The Gray codes, if there are any.
    pub gray: Option<Gray>,
    /// The order of projection. Fringes and codes that are named once for each direction are
    /// projected direction by direction.
    pub order: Vec<Section>,
    /// A phase function instead of straight fringes, row-major, in turns: then only the ratios of
    /// `fringes` count.
    pub function: Option<Vec<f64>>,
}

/// What is wrong with a description, and with which option.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum DescriptionError {
    /// A section is not projected as often as it must be.
    #[error(
        "--order must name sine if there are --fringes or --pitch and else not, gray if there is --gray and else not, each \
         once, or once for each direction; white and black at most once"
    )]
    Order,
    /// A code without fringes, inverses, white and black.
    #[error(
        "a Gray code alone has nothing to compare its pictures with: give --gray-inverse, or white and black in --order"
    )]
    NothingToCompare,
    /// Numbers of shifts neither for all levels nor for each.
    #[error("--steps has {numbers} numbers for {levels} levels: give one for all, or one for each")]
    Steps {
        /// How many numbers there are.
        numbers: usize,
        /// How many levels.
        levels: usize,
    },
    /// Two levels of the same fringes.
    #[error("two levels have {0} fringes: give each level once")]
    SameLevels(f64),
    /// A code beside a phase function.
    #[error("--gray numbers straight fringes: leave out --pattern")]
    Curved,
    /// A code that does not number the finest level's fringes, without the width of its cells.
    #[error(
        "{bits} bits of --gray do not number the {fringes} fringes of the finest level one by one: give \
         the width of a cell with --gray-cell"
    )]
    NoCell {
        /// Bits of the code.
        bits: u8,
        /// Fringes of the finest level.
        fringes: f64,
    },
    /// A code of fewer numbers than cells.
    #[error(
        "{bits} bits of --gray number {} cells, but {cells} cells of {cell_px:.3} px are on the projector: correct \
         --gray, --gray-cell or --gray-offset",
        1_u32 << bits
    )]
    FewBits {
        /// Bits of the code.
        bits: u8,
        /// Cells on the projector.
        cells: f64,
        /// Width of a cell.
        cell_px: f64,
    },
}

impl Convention {
    /// The shift of this function against the sine, in turns.
    pub fn turns(self) -> f64 {
        match self {
            Self::Sin => 0.0,
            Self::Cos => 0.25,
        }
    }
}

impl ShiftSign {
    /// The other one.
    pub fn reversed(self) -> Self {
        match self {
            Self::Rising => Self::Falling,
            Self::Falling => Self::Rising,
        }
    }
}

impl Shifts {
    /// The shift of the sine of frame `k` of `steps`, in turns.
    fn of(self, k: u8, steps: u8) -> f64 {
        let share = f64::from(k) / f64::from(steps);
        let along = match self.sign {
            ShiftSign::Rising => share,
            ShiftSign::Falling => -share,
        };
        along + self.first + self.convention.turns()
    }

    /// The shift of the sine in the first frame, turns.
    pub fn total(self) -> f64 {
        self.first + self.convention.turns()
    }

    /// These shifts with `total` as the shift of the sine in the first frame; in the convention that
    /// states it most plainly: with a first shift of 0, as stated, or of half a turn.
    pub fn with_total(self, sign: ShiftSign, total: f64) -> Self {
        let total = match usual(total - self.total()) {
            Some(turns) => self.total() + turns,
            None => (100.0 * total).round() / 100.0,
        };
        let other = match self.convention {
            Convention::Sin => Convention::Cos,
            Convention::Cos => Convention::Sin,
        };
        let [own, other] = [self.convention, other].map(|convention| {
            let first = total - convention.turns();
            let first = first - first.round();
            Self {
                convention,
                sign,
                first: if first == -0.5 { 0.5 } else { first },
            }
        });
        let plain = [0.0, self.first, 0.5].into_iter().find_map(|first| {
            let is_it = |shifts: &Self| (shifts.first - first).abs() < 1e-9;
            let found = [own, other].into_iter().find(is_it);
            found.map(|shifts| Self { first, ..shifts })
        });
        plain.unwrap_or(own)
    }

    /// The options of these shifts where others were stated.
    pub fn options(self, stated: Self) -> String {
        let convention = match self.convention {
            Convention::Sin => "sin",
            Convention::Cos => "cos",
        };
        let sign = match self.sign {
            ShiftSign::Rising => "+",
            ShiftSign::Falling => "-",
        };
        let first = match (self.first, stated.first) {
            (0.0, 0.0) => String::new(),
            (first, _) => format!(" --first-shift {first}"),
        };
        format!("--convention {convention} --shift {sign}{first}")
    }
}

/// The whole number of quarters or thirds of a turn that `turns` is near enough to stand for.
pub fn usual(turns: f64) -> Option<f64> {
    let parts = USUAL.into_iter().map(|(parts, near)| {
        let usual = (turns * parts).round() / parts;
        (usual, near)
    });
    let mut near = parts.filter(|(usual, near)| (usual - turns).abs() < *near);
    near.next().map(|(usual, _)| usual)
}

impl Direction {
    /// Which fringes are vertical, in the order of projection.
    pub fn vertical(self) -> &'static [bool] {
        match self {
            Self::Vertical => &[true],
            Self::Horizontal => &[false],
            Self::Both => &[true, false],
            Self::HorizontalFirst => &[false, true],
        }
    }
}

impl<T> PerDirection<T> {
    /// The list of this direction.
    fn of(&self, vertical: bool) -> &[T] {
        let own = self.0.get(usize::from(!vertical)).or(self.0.last());
        own.map_or(&[], Vec::as_slice)
    }
}

impl Fringes {
    /// Numbers of vertical or horizontal fringes over `length` projector pixels.
    pub fn over(&self, vertical: bool, length: u32) -> Vec<f64> {
        match self {
            Self::Count(count) => count.of(vertical).to_vec(),
            Self::Pitch(pitch) => {
                let pitch = pitch.of(vertical).iter();
                pitch.map(|pitch| f64::from(length) / pitch).collect()
            }
            Self::None => Vec::new(),
        }
    }
}

impl Description {
    /// How often a section is named in the order of projection.
    pub fn projected(&self, section: Section) -> usize {
        count(&self.order, section)
    }

    /// Checks that each section is projected as often as it must be, and that a code alone has
    /// something to be compared with.
    pub fn check_order(&self, directions: usize) -> Result<(), DescriptionError> {
        let sine = self.fringes != Fringes::None;
        let fits = |section, there: bool| match there {
            true => [1, directions].contains(&self.projected(section)),
            false => self.projected(section) == 0,
        };
        let [white, black] = [Section::White, Section::Black].map(|one| self.projected(one));
        if !fits(Section::Sine, sine)
            || !fits(Section::Gray, self.gray.is_some())
            || white.max(black) > 1
        {
            return Err(DescriptionError::Order);
        }
        let against = self.gray.as_ref().is_some_and(|gray| gray.inverse) || white + black == 2;
        if !sine && !against {
            return Err(DescriptionError::NothingToCompare);
        }
        Ok(())
    }

    /// Ratio and shift of each frame of the levels, in the order of projection.
    pub fn levels(
        &self,
        fringes: &[f64],
        finest: f64,
        vertical: bool,
    ) -> Result<Vec<(f64, f64)>, DescriptionError> {
        let steps = match *self.steps.of(vertical) {
            [all] => vec![all; fringes.len()],
            ref each => each.to_vec(),
        };
        if steps.len() != fringes.len() && !fringes.is_empty() {
            return Err(DescriptionError::Steps {
                numbers: steps.len(),
                levels: fringes.len(),
            });
        }
        let repeated = (1..fringes.len()).find(|&at| fringes[..at].contains(&fringes[at]));
        if let Some(at) = repeated {
            return Err(DescriptionError::SameLevels(fringes[at]));
        }
        let levels = fringes.iter().zip(steps);
        let frames = levels.flat_map(|(count, steps)| {
            (0..steps).map(move |k| (count / finest, self.shifts.of(k, steps)))
        });
        Ok(frames.collect())
    }
}

impl Gray {
    /// The code beside `finest` fringes, or alone beside 0, over `length` projector pixels.
    pub fn code(
        &self,
        vertical: bool,
        finest: f64,
        length: u32,
        curved: bool,
    ) -> Result<GrayCode, DescriptionError> {
        if curved {
            return Err(DescriptionError::Curved);
        }
        let bits = of_direction(&self.bits, vertical)
            .unwrap_or(1)
            .min(MAX_CODE_BITS);
        let length = f64::from(length);
        let cell = match of_direction(&self.cell_px, vertical) {
            Some(cell) => cell,
            None if finest == 0.0 => 1.0,
            None if (finest - 1e-9).log2().ceil().max(1.0) == f64::from(bits) => length / finest,
            None => {
                return Err(DescriptionError::NoCell {
                    bits,
                    fringes: finest,
                });
            }
        };
        let offset = of_direction(&self.offset_px, vertical).unwrap_or(0.0);
        let coding = self.coding;
        let cells = ((length + offset) / cell - 1e-9).ceil();
        // A Gray code of one more cell shows the last two alike, and those alone are lost.
        let doubled = u32::from(offset > 0.0 && !coding.binary);
        match cells <= f64::from((1_u32 << bits) + doubled) {
            true => Ok(GrayCode {
                bits,
                cell,
                offset,
                coding,
            }),
            false => Err(DescriptionError::FewBits {
                bits,
                cells,
                cell_px: cell,
            }),
        }
    }
}

/// How often a section is among these.
pub fn count(sections: &[Section], section: Section) -> usize {
    sections.iter().filter(|other| **other == section).count()
}

/// The element for vertical or horizontal fringes of a list that has one for both, or one for each.
pub fn of_direction<T: Copy>(list: &[T], vertical: bool) -> Option<T> {
    list.get(usize::from(!vertical)).or(list.last()).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shifts_are_named_in_the_plainest_way() {
        let stated = |convention, first| Shifts {
            convention,
            sign: ShiftSign::Rising,
            first,
        };
        let third = -1.0 / 3.0;
        for (convention, first, total, expected) in [
            (Convention::Sin, 0.0, 0.25, "--convention cos --shift +"),
            (Convention::Cos, 0.0, 0.01, "--convention sin --shift +"),
            (
                Convention::Cos,
                0.0,
                0.74,
                "--convention cos --shift + --first-shift 0.5",
            ),
            (
                Convention::Sin,
                0.0,
                -0.25,
                "--convention cos --shift + --first-shift 0.5",
            ),
            (
                Convention::Sin,
                0.5,
                0.0,
                "--convention sin --shift + --first-shift 0",
            ),
            (
                Convention::Sin,
                0.0,
                0.1,
                "--convention sin --shift + --first-shift 0.1",
            ),
            (
                Convention::Sin,
                third,
                third + 0.25,
                "--convention cos --shift + --first-shift -0.3333333333333333",
            ),
        ] {
            let stated = stated(convention, first);
            let named = stated.with_total(ShiftSign::Rising, total);
            assert_eq!(named.options(stated), expected);
        }
    }
}
