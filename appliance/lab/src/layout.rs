//! Which pictures are projected, in which order: `fringed-lab patterns` makes them, and `fringed-lab
//! import` makes a recording of frames of them.

use crate::description::{BitOrder, Description, DescriptionError, Section, count};
use algo::chain::GrayCode;
use hal::bounds::MAX_FRINGES;
use hal::frame::{Frame, FrameFormat};
use hal::replay::Recording;
use hal::replay::recording::{PatternSpec, RecordedCode, RecordedFrame, RecordedProjector};

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

impl Layout {
    /// The pictures that a description means.
    ///
    /// # Errors
    /// Numbers of steps, bits or cells that do not fit the levels.
    pub fn of(description: &Description) -> Result<Self, DescriptionError> {
        let (columns, rows) = description.projector();
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
            let fringes = description.fringes_over(vertical, length);
            let mut finest = fringes.iter().copied().fold(0.0, f64::max);
            let (gray, curved) = (&description.gray, description.function.is_some());
            let code = gray.code(vertical, finest, length, curved)?;
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
            if let Some(code) = code {
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

    /// Whether a pattern's code numbers columns.
    pub fn is_vertical(&self, pattern: usize) -> bool {
        matches!(self.patterns[pattern], PatternSpec::Vertical { .. })
    }

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
        let projector = RecordedProjector {
            width,
            height,
            model: None,
            plane: None,
        };
        let mut recording = Recording {
            patterns: self.patterns.clone(),
            codes: codes.collect(),
            ..Recording::new(format, projector)
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
}
