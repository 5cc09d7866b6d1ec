//! A recording's Gray code, ready to be decoded: beside the fringes that it numbers, or without
//! any.

use super::scan::PhasesError;
use super::seam;
use algo::chain::{Cells, CodePhases, CodePictures, Coding, GrayCode};
use algo::frame::FrameView;
use algo::phase::LeastModulation;
use algo::pipeline::PhaseMap;
use hal::frame::Frame;
use hal::replay::Recording;
use hal::replay::recording::{PatternSpec, RecordedCode};

/// A Gray code.
#[derive(Clone, Debug)]
pub struct Code<'a> {
    /// Its pictures, and what they are compared with.
    pub pictures: CodePictures<'a>,
    /// Its cells, in turns of the pattern.
    pub cells: Cells,
    /// Whether it numbers columns.
    vertical: bool,
    /// Turns of the pattern per projector pixel.
    pixel: f64,
}

impl<'a> Code<'a> {
    /// A code of a recording. Its pictures are compared with their inverse, else with white and
    /// black, else with the mean of these frames `beside` it.
    ///
    /// # Errors
    /// The code has nothing to be compared with, numbers no straight fringes, or a frame
    /// is not one of its format.
    pub fn new(
        code: &'a RecordedCode,
        recording: &'a Recording,
        beside: Vec<FrameView<'a>>,
    ) -> Result<Self, PhasesError> {
        let raster = &recording.projector;
        let (vertical, fringes, length) = match &recording.patterns[code.pattern] {
            PatternSpec::Vertical { fringes } => (true, *fringes, raster.width),
            PatternSpec::Horizontal { fringes } => (false, *fringes, raster.height),
            PatternSpec::File { .. } => return Err(PhasesError::CurvedFringes),
        };
        let views =
            |frames: &'a [Frame]| frames.iter().map(seam::view).collect::<Result<Vec<_>, _>>();
        let against = match (&recording.white, &recording.black) {
            _ if !code.inverse.is_empty() => {
                let inverse = views(&code.inverse)?.into_iter();
                inverse.map(|inverse| vec![inverse]).collect()
            }
            (Some(white), Some(black)) => vec![vec![seam::view(white)?, seam::view(black)?]],
            _ if beside.is_empty() => {
                return Err(PhasesError::NothingToCompare);
            }
            _ => vec![beside],
        };
        let pixel = fringes / f64::from(length);
        let gray = GrayCode {
            bits: code.bits.len() as u8,
            cell: code.cell_px,
            offset: code.offset_px,
            coding: Coding {
                binary: code.binary,
                inverted: code.inverted,
            },
        };
        Ok(Self {
            pictures: CodePictures {
                bits: views(&code.bits)?,
                against,
            },
            // The edge of pixel 0, whose centre has phase 0, is half a pixel before it.
            cells: Cells {
                origin: (-0.5 - gray.offset) * pixel,
                width: gray.cell * pixel,
                count: gray.cells(length),
                bits: gray.bits,
                coding: gray.coding,
            },
            vertical,
            pixel,
        })
    }
}

/// The code of a pattern that has no fringes.
#[derive(Clone, Debug)]
pub struct CodeAlone<'a> {
    pictures: CodePictures<'a>,
    /// Its cells, in turns of the pattern.
    pub cells: Cells,
    /// Whether it numbers columns.
    pub vertical: bool,
    /// Projector pixels per turn.
    pub pitch: f64,
    full_scale: u16,
}

impl<'a> CodeAlone<'a> {
    /// The code of a pattern of a recording, if it has one and no frames of fringes.
    ///
    /// # Errors
    /// As for [`Code::new`].
    pub fn of(recording: &'a Recording, pattern: usize) -> Result<Option<Self>, PhasesError> {
        let has_fringes = recording
            .frames
            .iter()
            .any(|frame| frame.pattern == pattern);
        let code = recording.codes.iter().find(|code| code.pattern == pattern);
        let Some(code) = code.filter(|_| !has_fringes) else {
            return Ok(None);
        };
        let Code {
            pictures,
            cells,
            vertical,
            pixel,
        } = Code::new(code, recording, Vec::new())?;
        Ok(Some(Self {
            pictures,
            cells,
            vertical,
            pitch: 1.0 / pixel,
            full_scale: recording.format().full_scale(),
        }))
    }

    /// The same pictures, read with their bits in the other order if `reversed`, and as another
    /// coding.
    #[must_use]
    pub fn read_as(&self, reversed: bool, coding: Coding) -> Self {
        let mut reading = self.clone();
        reading.cells.coding = coding;
        let CodePictures { bits, against } = &mut reading.pictures;
        if reversed {
            if against.len() == bits.len() {
                against.reverse();
            }
            bits.reverse();
        }
        reading
    }

    /// The absolute phase of every pixel, trusted from a modulation of `least` on.
    ///
    /// # Errors
    /// Its pictures form no code.
    pub fn phases(&self, least: LeastModulation) -> Result<PhaseMap, PhasesError> {
        self.read(least).map(|phases| phases.map)
    }

    /// As [`Self::phases`], with the bits that each was found without.
    ///
    /// # Errors
    /// Its pictures form no code.
    pub fn read(&self, least: LeastModulation) -> Result<CodePhases, PhasesError> {
        let phases = self
            .pictures
            .phases(&self.cells, self.vertical, least, self.full_scale);
        Ok(phases?)
    }

    /// Pictures whose mean is what the camera sees under even light: each bit with its inverse, or
    /// white and black.
    pub fn even(&self) -> Vec<FrameView<'a>> {
        let CodePictures { bits, against } = &self.pictures;
        let is_inverse = against.iter().all(|frames| frames.len() == 1);
        let bits = bits.iter().filter(|_| is_inverse);
        against.iter().flatten().chain(bits).copied().collect()
    }
}
