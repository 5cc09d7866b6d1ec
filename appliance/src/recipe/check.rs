//! From the file form of a recipe to a checked one.

use super::archive::{ArchiveError, Arrays, short, unpack};
use super::file::{PatternFile, RecipeFile};
use super::gauge::{check_limits, gauges};
use algo::inspect::Gauge;
use algo::pattern::{PhaseFunction, Sequence};
use std::io::{Cursor, Read, Seek};

/// A recipe whose parts fit each other.
#[derive(Clone, Debug)]
pub struct Recipe {
    /// The manifest.
    pub file: RecipeFile,
    /// The arrays, each of the size that the manifest says.
    pub arrays: Arrays,
    /// Φ_P.
    pub function: PhaseFunction,
    /// Levels and shifts of each of its sequences, in the order of the manifest.
    pub sequences: Vec<Sequence>,
    /// What its gauges measure.
    pub gauges: Vec<Gauge>,
}

/// A recipe that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RecipeError {
    /// It cannot be read.
    #[error(transparent)]
    Archive(#[from] ArchiveError),
    /// Its parts do not fit each other.
    #[error("{0}: teach it again")]
    Inconsistent(String),
    /// A gauge has limits that it cannot have.
    #[error("{0}: change the limits")]
    Limits(String),
}

/// Gauges of a recipe: bits and registers of the Modbus map.
pub const MAX_GAUGES: usize = crate::station::MAX_GAUGES;
/// Regions of a recipe.
pub const MAX_REGIONS: usize = 32;

impl Recipe {
    /// Reads and checks a recipe file's bytes.
    ///
    /// # Errors
    /// If it is broken, of a newer version, changed, or inconsistent.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, RecipeError> {
        Self::read(Cursor::new(bytes), bytes.len() as u64)
    }

    /// As [`Self::from_bytes`], from a file of `size` bytes that need not be in memory.
    ///
    /// # Errors
    /// As there.
    pub fn read(source: impl Read + Seek, size: u64) -> Result<Self, RecipeError> {
        let recipe = Self::read_to_edit(source, size)?;
        check_limits(&recipe.file.gauges).map_err(RecipeError::Limits)?;
        Ok(recipe)
    }

    /// As [`Self::read`], but whatever the limits of its gauges are: they may be what is going to be changed.
    ///
    /// # Errors
    /// As there.
    pub(super) fn read_to_edit(source: impl Read + Seek, size: u64) -> Result<Self, RecipeError> {
        let (file, arrays) = unpack(source, size)?;
        Self::fit(file, arrays).map_err(RecipeError::Inconsistent)
    }

    /// First 32 bits of the fingerprint.
    pub fn crc(&self) -> u32 {
        short(&self.file.fingerprint)
    }

    /// Checks that manifest and arrays fit each other, and the limits of the gauges; the error says what does not.
    ///
    /// # Errors
    /// In words.
    pub fn check(file: RecipeFile, arrays: Arrays) -> Result<Self, String> {
        check_limits(&file.gauges)?;
        Self::fit(file, arrays)
    }

    fn fit(file: RecipeFile, arrays: Arrays) -> Result<Self, String> {
        file.check_bounds()?;
        let (width, height) = (file.camera.width as usize, file.camera.height as usize);
        let pixels = width.checked_mul(height).filter(|&pixels| pixels > 0);
        for (name, length) in [
            ("golden_phase", arrays.golden_phase.len()),
            ("golden_height", arrays.golden_height.len()),
            ("height_slope", arrays.height_slope.len()),
            ("height_curvature", arrays.height_curvature.len()),
            ("valid", arrays.valid.len()),
            ("modulation", arrays.modulation.len()),
            ("phase_reach", arrays.phase_reach.len()),
        ] {
            if Some(length) != pixels {
                return Err(format!(
                    "{name} has {length} values for a camera of {width}x{height}"
                ));
            }
        }
        let (columns, rows) = (
            file.projector.width as usize,
            file.projector.height as usize,
        );
        let function = match file.pattern {
            PatternFile::Vertical { fringes } => PhaseFunction::vertical(columns, rows, fringes),
            PatternFile::Horizontal { fringes } => {
                PhaseFunction::horizontal(columns, rows, fringes)
            }
            PatternFile::File => {
                PhaseFunction::sampled(columns, rows, arrays.phase_function.clone())
            }
        };
        let function = function.map_err(|error| format!("projector and pattern: {error}"))?;
        let sequences = file.sequences.iter();
        let sequences = sequences.map(|sequence| Sequence::from_frames(&sequence.frames));
        let sequences = sequences.collect::<Result<_, _>>();
        let sequences = sequences.map_err(|error| error.to_string())?;
        let gauges = gauges(&file.regions, &file.gauges, (width, height))?;
        Ok(Self {
            file,
            arrays,
            function,
            sequences,
            gauges,
        })
    }
}
