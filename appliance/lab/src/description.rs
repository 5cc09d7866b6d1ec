//! Options that describe projected pictures, for `import` and `patterns`: levels of fringes and their
//! shifts, Gray codes, and the order of projection.

use crate::lists::{PerDirection, Series, Size, directions, of_direction, series, size};
use crate::shifts::Shifts;
use algo::chain::{Coding, GrayCode, MAX_CODE_BITS};
use appliance::error::{Exit, Result};
use hal::bounds::{MAX_FRINGES, MAX_SIDE};
use thiserror::Error;

/// Most levels of a recording that can be decoded.
const MAX_LEVELS: usize = 8;

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

/// The order in which the bits of a Gray code are projected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum BitOrder {
    /// The most significant bit first.
    Msb,
    /// The least significant bit first.
    Lsb,
}

/// Gray codes, if there are any.
#[derive(Clone, Debug, clap::Args)]
pub struct Gray {
    /// Bits of a Gray code beside the fringes; two numbers for the vertical and the horizontal one.
    #[arg(id = "gray", long = "gray", value_name = "BITS", value_parser = series(1u8, 13, 2))]
    bits: Option<Series<u8>>,
    /// Width of the Gray code's cells, projector pixels; without it one cell per fringe of the
    /// finest level, or per pixel without fringes. Two numbers for the vertical and the horizontal
    /// code.
    #[arg(id = "gray_cell", long = "gray-cell", value_name = "PX", value_parser = series(1.0, f64::from(MAX_SIDE), 2))]
    pub cell_px: Option<Series<f64>>,
    /// How far before the raster's edge the first cell begins, projector pixels: half a cell where
    /// edges lie in the middle of fringes.
    #[arg(id = "gray_offset", long = "gray-offset", value_name = "PX", value_parser = series(0.0, f64::from(MAX_SIDE), 2))]
    pub offset_px: Option<Series<f64>>,
    /// Order of the Gray code's bits: most or least significant first.
    #[arg(
        id = "gray_order",
        long = "gray-order",
        value_name = "GRAY_ORDER",
        default_value = "msb"
    )]
    pub order: BitOrder,
    /// The cells are numbered in plain binary instead of a Gray code.
    #[arg(id = "gray_binary", long = "gray-binary")]
    binary: bool,
    /// Bits that are set are dark.
    #[arg(id = "gray_invert", long = "gray-invert")]
    inverted: bool,
    /// Each picture of the Gray code is followed by its inverse.
    #[arg(id = "gray_inverse", long = "gray-inverse")]
    pub inverse: bool,
}

/// What was or will be projected.
#[derive(Clone, Debug, clap::Args)]
pub struct Description {
    /// Columns and rows of the projector.
    #[arg(long, value_name = "WxH", value_parser = size)]
    projector: Size,
    /// Fringes over the projector of each level, in the order of projection; need not be whole
    /// numbers. 1,8,32/1,8,16: vertical ones, then horizontal ones. Without fringes there is a Gray
    /// code alone.
    #[arg(long, value_name = "F,...", conflicts_with = "pitch", value_parser = directions(1e-3, MAX_FRINGES, MAX_LEVELS))]
    fringes: Option<PerDirection<f64>>,
    /// Projector pixels per fringe of each level, instead of --fringes.
    #[arg(long, value_name = "PX,...", value_parser = directions(2.0, 1e6, MAX_LEVELS))]
    pitch: Option<PerDirection<f64>>,
    /// Shifts of all levels, or of each.
    #[arg(long, value_name = "N,...", default_value = "4", value_parser = directions(3u8, 64, MAX_LEVELS))]
    steps: PerDirection<u8>,
    /// The convention of shifts.
    #[command(flatten)]
    pub shifts: Shifts,
    /// Direction of the fringes; both: all vertical ones, then all horizontal ones;
    /// horizontal-first: the other way round.
    #[arg(long, default_value = "vertical")]
    pub direction: Direction,
    /// The Gray codes.
    #[command(flatten)]
    pub gray: Gray,
    /// Order of projection; without it sine, then gray if there is one.
    #[arg(long, value_name = "PART,...", value_delimiter = ',')]
    pub order: Vec<Section>,
    /// A phase function instead of straight fringes, row-major, in turns: then only the ratios of
    /// `fringes` count.
    #[arg(skip)]
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

impl Description {
    /// The projector's columns and rows.
    pub fn projector(&self) -> (u32, u32) {
        let Size(width, height) = self.projector;
        (width, height)
    }

    /// The description with the usual order of projection where none is stated, and with a phase
    /// function instead of straight fringes if one is given.
    ///
    /// # Errors
    /// If neither fringes, pitches nor a Gray code are given, or a Gray code is described that
    /// there is not (64).
    pub fn complete(&self, function: Option<Vec<f64>>) -> Result<Self> {
        let gray = &self.gray;
        if !self.has_fringes() && (gray.bits.is_none() || function.is_some()) {
            let words = "give --fringes or --pitch, or the bits of a Gray code alone with --gray";
            return Exit::Usage.fail(words);
        }
        let described = gray.cell_px.is_some()
            || gray.offset_px.is_some()
            || gray.order != BitOrder::Msb
            || gray.binary
            || gray.inverted
            || gray.inverse;
        if gray.bits.is_none() && described {
            let words =
                "options that begin with --gray- describe a Gray code: give its bits with --gray";
            return Exit::Usage.fail(words);
        }
        let mut complete = Self {
            function,
            ..self.clone()
        };
        if complete.order.is_empty() {
            let sine = self.has_fringes().then_some(Section::Sine);
            let gray = gray.bits.is_some().then_some(Section::Gray);
            complete.order = sine.into_iter().chain(gray).collect();
        }
        Ok(complete)
    }

    fn has_fringes(&self) -> bool {
        self.fringes.is_some() || self.pitch.is_some()
    }

    /// Numbers of vertical or horizontal fringes over `length` projector pixels, level by level.
    pub fn fringes_over(&self, vertical: bool, length: u32) -> Vec<f64> {
        match (&self.fringes, &self.pitch) {
            (Some(fringes), _) => fringes.of(vertical).to_vec(),
            (None, Some(pitch)) => {
                let pitch = pitch.of(vertical).iter();
                pitch.map(|pitch| f64::from(length) / pitch).collect()
            }
            (None, None) => Vec::new(),
        }
    }

    /// How often a section is named in the order of projection.
    pub fn projected(&self, section: Section) -> usize {
        count(&self.order, section)
    }

    /// Checks that each section is projected as often as it must be, and that a code alone has
    /// something to be compared with.
    pub fn check_order(&self, directions: usize) -> Result<(), DescriptionError> {
        let sine = self.has_fringes();
        let fits = |section, there: bool| match there {
            true => [1, directions].contains(&self.projected(section)),
            false => self.projected(section) == 0,
        };
        let [white, black] = [Section::White, Section::Black].map(|one| self.projected(one));
        if !fits(Section::Sine, sine)
            || !fits(Section::Gray, self.gray.bits.is_some())
            || white.max(black) > 1
        {
            return Err(DescriptionError::Order);
        }
        let against = self.gray.inverse || white + black == 2;
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
    /// How the numbers of cells are written in the bits.
    pub fn coding(&self) -> Coding {
        let &Self {
            binary, inverted, ..
        } = self;
        Coding { binary, inverted }
    }

    /// The code beside `finest` fringes, or alone beside 0, over `length` projector pixels, if there
    /// is one.
    pub fn code(
        &self,
        vertical: bool,
        finest: f64,
        length: u32,
        curved: bool,
    ) -> Result<Option<GrayCode>, DescriptionError> {
        let Some(bits) = of_direction(&self.bits, vertical) else {
            return Ok(None);
        };
        if curved {
            return Err(DescriptionError::Curved);
        }
        let bits = bits.min(MAX_CODE_BITS);
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
        let coding = self.coding();
        let cells = ((length + offset) / cell - 1e-9).ceil();
        // A Gray code of one more cell shows the last two alike, and those alone are lost.
        let doubled = u32::from(offset > 0.0 && !coding.binary);
        match cells <= f64::from((1_u32 << bits) + doubled) {
            true => Ok(Some(GrayCode {
                bits,
                cell,
                offset,
                coding,
            })),
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
