//! What is projected, in which order: levels of fringes, Gray codes, white and black. `fringed patterns` makes pictures of it, and
//! `fringed import` takes pictures for it.

use algo::chain::{Coding, GrayCode, MAX_CODE_BITS};
use hal::frame::{Frame, FrameFormat};
use hal::replay::Recording;
use hal::replay::recording::{PatternSpec, RecordedCode, RecordedFrame, RecordedProjector};

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

/// Gray codes. Lists have one element for both codes, or one for the vertical and one for the horizontal one.
#[derive(Clone, Debug, PartialEq)]
pub struct Gray {
    /// Numbers of bits.
    pub bits: Vec<u8>,
    /// Widths of cells in projector pixels; empty where a cell is a fringe of the finest level.
    pub cell_px: Vec<f64>,
    /// How far before the raster's edge the first cell begins, projector pixels; empty where it begins there.
    pub offset_px: Vec<f64>,
    /// The order of the bits.
    pub order: BitOrder,
    /// How the numbers of cells are written in them.
    pub coding: Coding,
    /// Whether each picture is followed by its inverse.
    pub inverse: bool,
}

/// The fringes of each level, in the order of projection.
#[derive(Clone, Debug, PartialEq)]
pub enum Fringes {
    /// Numbers of fringes over the projector.
    Count(Vec<f64>),
    /// Projector pixels per fringe.
    Pitch(Vec<f64>),
}

/// What the user says about the projected pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// Columns and rows of the projector.
    pub projector: (u32, u32),
    /// The fringes of each level.
    pub fringes: Fringes,
    /// Shifts of each level, or of all.
    pub steps: Vec<u8>,
    /// The convention of shifts.
    pub shifts: Shifts,
    /// The direction of fringes.
    pub direction: Direction,
    /// The Gray codes, if there are any.
    pub gray: Option<Gray>,
    /// The order of projection.
    pub order: Vec<Section>,
    /// A phase function instead of straight fringes, row-major, in turns: then only the ratios of `fringes` count.
    pub function: Option<Vec<f64>>,
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

impl Fringes {
    /// Numbers of fringes over `length` projector pixels.
    fn over(&self, length: u32) -> Vec<f64> {
        match self {
            Self::Count(count) => count.clone(),
            Self::Pitch(pitch) => pitch
                .iter()
                .map(|pitch| f64::from(length) / pitch)
                .collect(),
        }
    }
}

impl Layout {
    /// The pictures that a description means.
    ///
    /// # Errors
    /// In words that name the option: numbers of steps, bits or cells that do not fit the levels.
    pub fn of(description: &Description) -> Result<Self, String> {
        let (columns, rows) = description.projector;
        let directions: &[bool] = match (&description.function, description.direction) {
            (Some(_), _) | (None, Direction::Vertical) => &[true],
            (None, Direction::Horizontal) => &[false],
            (None, Direction::Both) => &[true, false],
        };
        let (mut patterns, mut codes) = (Vec::new(), Vec::new());
        let (mut sines, mut bits) = (Vec::new(), Vec::new());
        for (pattern, &vertical) in directions.iter().enumerate() {
            let length = if vertical { columns } else { rows };
            let fringes = description.fringes.over(length);
            let finest = fringes.iter().copied().fold(0.0, f64::max);
            patterns.push(match (&description.function, vertical) {
                (Some(turns), _) => PatternSpec::File {
                    rows: rows as usize,
                    columns: columns as usize,
                    turns: turns.clone(),
                },
                (None, true) => PatternSpec::Vertical { fringes: finest },
                (None, false) => PatternSpec::Horizontal { fringes: finest },
            });
            for (ratio, shift) in description.levels(&fringes, finest)? {
                sines.push(Shown::Sine {
                    pattern,
                    ratio,
                    shift,
                });
            }
            if let Some(gray) = &description.gray {
                let code = gray.code(pattern, finest, length, description.function.is_some())?;
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
                    bits.extend(inverses.iter().map(|&inverse| Shown::Bit {
                        pattern,
                        bit,
                        inverse,
                    }));
                }
                codes.push(code);
            }
        }
        let shown = description.order.iter().flat_map(|section| match section {
            Section::Sine => sines.clone(),
            Section::Gray => bits.clone(),
            Section::White => vec![Shown::White],
            Section::Black => vec![Shown::Black],
        });
        let once = |section| {
            let count = description.order.iter().filter(|other| **other == section);
            count.count()
        };
        let gray = usize::from(description.gray.is_some());
        if once(Section::Sine) != 1
            || once(Section::Gray) != gray
            || once(Section::White).max(once(Section::Black)) > 1
        {
            return Err(
                "--order must name sine once, gray once if there is --gray and else not, white and black at most once"
                    .into(),
            );
        }
        Ok(Self {
            shown: shown.collect(),
            patterns,
            codes,
        })
    }
}

impl Layout {
    /// The recording of frames of these pictures, in their order, without models.
    pub fn recording(
        &self,
        (width, height): (u32, u32),
        format: FrameFormat,
        frames: impl IntoIterator<Item = Frame>,
    ) -> Recording {
        let codes = self.codes.iter().enumerate();
        let codes = codes.map(|(pattern, code)| RecordedCode {
            pattern,
            cell_px: code.cell,
            offset_px: code.offset,
            binary: code.coding.binary,
            inverted: code.coding.inverted,
            bits: Vec::new(),
            inverse: Vec::new(),
        });
        let mut recording = Recording {
            width: format.width,
            height: format.height,
            bit_depth: format.bit_depth,
            description: String::new(),
            notes: Vec::new(),
            source: String::new(),
            camera_model: None,
            noise_counts: None,
            projector: RecordedProjector {
                width,
                height,
                model: None,
                plane: None,
            },
            patterns: self.patterns.clone(),
            frames: Vec::new(),
            codes: codes.collect(),
            white: None,
            black: None,
            range_mm: None,
            exposure_us: None,
            part_id: None,
            recipe: None,
            truth_height: None,
            truth_class: None,
        };
        let mut shown: Vec<_> = self.shown.iter().zip(frames).collect();
        // Bits come with the most or the least significant first.
        shown.sort_by_key(|(shown, _)| match shown {
            Shown::Bit { bit, .. } => *bit,
            _ => 0,
        });
        for (shown, frame) in shown {
            match *shown {
                Shown::Sine {
                    pattern,
                    ratio,
                    shift,
                } => recording.frames.push(RecordedFrame {
                    ratio,
                    shift_turns: shift,
                    harmonics: Vec::new(),
                    pattern,
                    timestamp_ns: None,
                    frame,
                }),
                Shown::Bit {
                    pattern, inverse, ..
                } => {
                    let code = &mut recording.codes[pattern];
                    match inverse {
                        true => code.inverse.push(frame),
                        false => code.bits.push(frame),
                    }
                }
                Shown::White => recording.white = Some(frame),
                Shown::Black => recording.black = Some(frame),
            }
        }
        recording
    }

    /// Whether a pattern's code numbers columns.
    pub fn is_vertical(&self, pattern: usize) -> bool {
        matches!(self.patterns[pattern], PatternSpec::Vertical { .. })
    }
}

impl Description {
    /// Ratio and shift of each frame of the levels, in the order of projection.
    fn levels(&self, fringes: &[f64], finest: f64) -> Result<Vec<(f64, f64)>, String> {
        let steps = match self.steps[..] {
            [all] => vec![all; fringes.len()],
            _ => self.steps.clone(),
        };
        if steps.len() != fringes.len() {
            return Err(format!(
                "--steps has {} numbers for {} levels: give one for all, or one for each",
                steps.len(),
                fringes.len()
            ));
        }
        let repeated = (1..fringes.len()).find(|&at| fringes[..at].contains(&fringes[at]));
        if let Some(at) = repeated {
            return Err(format!(
                "two levels have {} fringes: give each level once",
                fringes[at]
            ));
        }
        let levels = fringes.iter().zip(steps);
        let frames = levels.flat_map(|(count, steps)| {
            (0..steps).map(move |k| (count / finest, self.shifts.of(k, steps)))
        });
        Ok(frames.collect())
    }
}

impl Gray {
    /// The code beside the fringes of a pattern over `length` projector pixels.
    fn code(
        &self,
        pattern: usize,
        finest: f64,
        length: u32,
        curved: bool,
    ) -> Result<GrayCode, String> {
        if curved {
            return Err("--gray numbers straight fringes: leave out --pattern".into());
        }
        let bits = of_pattern(&self.bits, pattern)
            .unwrap_or(1)
            .min(MAX_CODE_BITS);
        let length = f64::from(length);
        let cell = match of_pattern(&self.cell_px, pattern) {
            Some(cell) => cell,
            None if (finest - 1e-9).log2().ceil().max(1.0) == f64::from(bits) => length / finest,
            None => {
                return Err(format!(
                    "{bits} bits of --gray do not number the {finest} fringes of the finest level one by one: give \
                     the width of a cell with --gray-cell"
                ));
            }
        };
        let offset = of_pattern(&self.offset_px, pattern).unwrap_or(0.0);
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
            false => Err(format!(
                "{bits} bits of --gray number {} cells, but {cells} cells of {cell:.3} px are on the projector: correct \
                 --gray, --gray-cell or --gray-offset",
                1_u32 << bits
            )),
        }
    }
}

/// The element for a pattern of a list that has one for both, or one for each.
pub fn of_pattern<T: Copy>(list: &[T], pattern: usize) -> Option<T> {
    list.get(pattern).or(list.last()).copied()
}
