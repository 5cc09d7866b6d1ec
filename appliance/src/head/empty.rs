//! The station without a part: the heights of what is seen then, by which teaching tells the part from the rest.

use crate::head::calibrated::{CalibratedHead, MeasureError, straight_fringes};
use crate::head::calibration::Calibration;
use crate::storage::folder::{read_whole, write_whole};
use algo::pipeline::Progress;
use hal::head::Head;
use hal::npy;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Longest wait for a frame.
const TIMEOUT: Duration = Duration::from_secs(5);
/// Begin and end of the name of its file beside the calibration; between them are the first digits of the
/// calibration's fingerprint: heights of another calibration are of no use.
const NAME: [&str; 2] = ["empty-", ".npy"];
const DIGITS: usize = 16;
/// Largest file, bytes.
const MAX_BYTES: u64 = 256 << 20;

/// The heights that are seen without a part.
#[derive(Clone, Debug, PartialEq)]
pub struct EmptyStation {
    /// z of each pixel in mm, row by row; not a number where nothing is seen.
    pub heights: Vec<f32>,
}

impl EmptyStation {
    /// Measures it with straight fringes.
    ///
    /// # Errors
    /// As [`CalibratedHead::measure`].
    pub fn measure(
        head: &mut Head,
        calibration: &Calibration,
        progress: Progress<'_>,
    ) -> Result<Self, MeasureError> {
        let calibration = &calibration.clone().with_rays();
        let (columns, rows) = (
            calibration.projector.width(),
            calibration.projector.height(),
        );
        let (function, shots) = straight_fringes((columns, rows))?;
        let mut head = CalibratedHead {
            head,
            calibration,
            timeout: TIMEOUT,
        };
        let measured = head.measure(&function, &shots, None, progress)?;
        let heights = measured.heights.height.iter();
        let mm = heights.map(|height| match height.is_known() {
            true => height.mm() as f32,
            false => f32::NAN,
        });
        Ok(Self {
            heights: mm.collect(),
        })
    }

    /// The share of the picture where something is seen.
    pub fn seen(&self) -> f64 {
        let seen = self.heights.iter().filter(|height| height.is_finite());
        seen.count() as f64 / self.heights.len().max(1) as f64
    }

    /// Stores it beside the calibration's file, in place of another one.
    ///
    /// # Errors
    /// In words, if it cannot be stored.
    pub fn store(&self, place: &Path, calibration: &Calibration) -> Result<(), String> {
        let file = file(place, calibration);
        let bytes = npy::write(calibration.camera.width(), &self.heights);
        let folder = file.parent().unwrap_or(Path::new("."));
        let written = fs::create_dir_all(folder).and_then(|()| write_whole(&file, &bytes));
        written.map_err(|error| format!("store {}: {error}", file.display()))?;
        let others = fs::read_dir(folder).into_iter().flatten().flatten();
        for other in others
            .map(|entry| entry.path())
            .filter(|other| *other != file)
        {
            let name = other.file_name().and_then(|name| name.to_str());
            if name.is_some_and(|name| name.starts_with(NAME[0]) && name.ends_with(NAME[1])) {
                // One that stays is of another calibration, and of no use.
                let _ = fs::remove_file(other);
            }
        }
        Ok(())
    }

    /// What was recorded with this calibration, if it was.
    ///
    /// # Errors
    /// In words, if there is a file that cannot be used.
    pub fn load(place: &Path, calibration: &Calibration) -> Result<Option<Self>, String> {
        let file = file(place, calibration);
        let wrong = |words: String| {
            let file = file.display();
            format!("read {file}: {words}: record the empty station again")
        };
        let bytes = match read_whole(&file, MAX_BYTES) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            read => read.map_err(|error| wrong(error.to_string()))?,
        };
        let heights = npy::read::<f32>(&bytes).map_err(|error| wrong(error.to_string()))?;
        let (width, rows, _) = calibration.frames();
        match (heights.columns, heights.rows) == (width as usize, rows as usize) {
            true => Ok(Some(Self {
                heights: heights.elements,
            })),
            false => Err(wrong("it is of another camera".into())),
        }
    }
}

fn file(place: &Path, calibration: &Calibration) -> PathBuf {
    let fingerprint = calibration.fingerprint();
    let digits: String = fingerprint.chars().take(DIGITS).collect();
    place.with_file_name(format!("{}{digits}{}", NAME[0], NAME[1]))
}
