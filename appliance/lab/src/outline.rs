//! The recording that the pictures of a layout make.

use super::layout::{Layout, Shown};
use hal::frame::{Frame, FrameFormat};
use hal::replay::Recording;
use hal::replay::recording::{RecordedCode, RecordedFrame, RecordedProjector};

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
