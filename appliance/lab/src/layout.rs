//! What is projected, in which order: levels of fringes, Gray codes, white and black. `fringed-lab
//! patterns` makes pictures of it, and `fringed-lab import` takes pictures for it.

use algo::chain::{Coding, GrayCode, MAX_CODE_BITS};
use hal::bounds::MAX_FRINGES;
use hal::replay::recording::PatternSpec;
use thiserror::Error;

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
pub enum LayoutError {
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

/// One projected picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shown {
    /// A frame of a level.
    Sine {
        /// Index of its pattern.
        pattern: usize,
        /// The level's share of the phase function.
        ratio: f64,
        /// Shift of the sine in turns.
        shift: f64,
    },
    /// A picture of a Gray code.
    Bit {
        /// Index of the code's pattern.
        pattern: usize,
        /// The bit, 0 is the most significant.
        bit: u8,
        /// Whether it is the inverse.
        inverse: bool,
    },
    /// A white raster.
    White,
    /// A black raster.
    Black,
}

/// The projected pictures in their order.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// The patterns, as a recording has them.
    pub patterns: Vec<PatternSpec>,
    /// The code of each pattern; empty without codes.
    pub codes: Vec<GrayCode>,
    /// The pictures in the order of projection.
    pub shown: Vec<Shown>,
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
}

impl Direction {
    /// Which fringes are vertical, in the order of projection.
    fn vertical(self) -> &'static [bool] {
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
    fn over(&self, vertical: bool, length: u32) -> Vec<f64> {
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

impl Layout {
    /// The pictures that a description means.
    ///
    /// # Errors
    /// Numbers of steps, bits or cells that do not fit the levels.
    pub fn of(description: &Description) -> Result<Self, LayoutError> {
        let (columns, rows) = description.projector;
        let directions: &[bool] = match &description.function {
            Some(_) => &[true],
            None => description.direction.vertical(),
        };
        description.check_order(directions.len())?;
        let (mut patterns, mut codes) = (Vec::new(), Vec::new());
        // Of each direction.
        let mut sines = vec![Vec::new(); directions.len()];
        let mut bits = sines.clone();
        for (pattern, &vertical) in directions.iter().enumerate() {
            let length = if vertical { columns } else { rows };
            let fringes = description.fringes.over(vertical, length);
            let mut finest = fringes.iter().copied().fold(0.0, f64::max);
            let code = description.gray.as_ref().map(|gray| {
                let curved = description.function.is_some();
                gray.code(vertical, finest, length, curved)
            });
            let code = code.transpose()?;
            if let (true, Some(code)) = (fringes.is_empty(), &code) {
                // A turn of a code alone is a cell, or two or four of very many.
                finest = f64::from(length) / code.cell;
                while finest > MAX_FRINGES {
                    finest /= 2.0;
                }
            }
            patterns.push(match (&description.function, vertical) {
                (Some(turns), _) => PatternSpec::File {
                    rows: rows as usize,
                    columns: columns as usize,
                    turns: turns.clone(),
                },
                (None, true) => PatternSpec::Vertical { fringes: finest },
                (None, false) => PatternSpec::Horizontal { fringes: finest },
            });
            for (ratio, shift) in description.levels(&fringes, finest, vertical)? {
                sines[pattern].push(Shown::Sine {
                    pattern,
                    ratio,
                    shift,
                });
            }
            if let (Some(gray), Some(code)) = (&description.gray, code) {
                for at in 0..code.bits {
                    let bit = match gray.order {
                        BitOrder::Msb => at,
                        BitOrder::Lsb => code.bits - 1 - at,
                    };
                    let inverses: &[bool] = if gray.inverse {
                        &[false, true]
                    } else {
                        &[false]
                    };
                    bits[pattern].extend(inverses.iter().map(|&inverse| Shown::Bit {
                        pattern,
                        bit,
                        inverse,
                    }));
                }
                codes.push(code);
            }
        }
        let mut shown = Vec::new();
        for (at, section) in description.order.iter().enumerate() {
            let of_directions = match section {
                Section::Sine => &sines,
                Section::Gray => &bits,
                Section::White | Section::Black => {
                    let white = *section == Section::White;
                    shown.push(if white { Shown::White } else { Shown::Black });
                    continue;
                }
            };
            match description.projected(*section) {
                1 => shown.extend(of_directions.concat()),
                _ => shown.extend(&of_directions[count(&description.order[..at], *section)]),
            }
        }
        Ok(Self {
            shown,
            patterns,
            codes,
        })
    }
}

impl Layout {
    /// Whether a pattern's code numbers columns.
    pub fn is_vertical(&self, pattern: usize) -> bool {
        matches!(self.patterns[pattern], PatternSpec::Vertical { .. })
    }
}

impl Description {
    /// How often a section is named in the order of projection.
    fn projected(&self, section: Section) -> usize {
        count(&self.order, section)
    }

    /// Checks that each section is projected as often as it must be, and that a code alone has
    /// something to be compared with.
    fn check_order(&self, directions: usize) -> Result<(), LayoutError> {
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
            return Err(LayoutError::Order);
        }
        let against = self.gray.as_ref().is_some_and(|gray| gray.inverse) || white + black == 2;
        if !sine && !against {
            return Err(LayoutError::NothingToCompare);
        }
        Ok(())
    }

    /// Ratio and shift of each frame of the levels, in the order of projection.
    fn levels(
        &self,
        fringes: &[f64],
        finest: f64,
        vertical: bool,
    ) -> Result<Vec<(f64, f64)>, LayoutError> {
        let steps = match *self.steps.of(vertical) {
            [all] => vec![all; fringes.len()],
            ref each => each.to_vec(),
        };
        if steps.len() != fringes.len() && !fringes.is_empty() {
            return Err(LayoutError::Steps {
                numbers: steps.len(),
                levels: fringes.len(),
            });
        }
        let repeated = (1..fringes.len()).find(|&at| fringes[..at].contains(&fringes[at]));
        if let Some(at) = repeated {
            return Err(LayoutError::SameLevels(fringes[at]));
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
    fn code(
        &self,
        vertical: bool,
        finest: f64,
        length: u32,
        curved: bool,
    ) -> Result<GrayCode, LayoutError> {
        if curved {
            return Err(LayoutError::Curved);
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
                return Err(LayoutError::NoCell {
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
            false => Err(LayoutError::FewBits {
                bits,
                cells,
                cell_px: cell,
            }),
        }
    }
}

/// How often a section is among these.
fn count(sections: &[Section], section: Section) -> usize {
    sections.iter().filter(|other| **other == section).count()
}

/// The element for vertical or horizontal fringes of a list that has one for both, or one for each.
pub fn of_direction<T: Copy>(list: &[T], vertical: bool) -> Option<T> {
    list.get(usize::from(!vertical)).or(list.last()).copied()
}
