//! `drift.json`: what the checks of the geometry have found, so that the trend survives a restart.

use crate::head::examine::{DRIFT_REMEDY, MOST_DRIFT_PX};
use crate::station::Drift;
use crate::storage::folder::{read_whole, write_whole};
use crate::system::clock;
use algo::pipeline::Epipolar;
use hal::bounded;
use hal::bounds::{
    Bound as _, FINGERPRINT_DIGITS, Fields, Longest, OutOfBounds, length, shortened,
};
use serde_json::{Value, json};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Its name in the state folder.
pub const FILE: &str = "drift.json";
const FORMAT: &str = "fringed drift";
const VERSION: u32 = 1;
/// Longest file, bytes.
const MAX_BYTES: u64 = 4 << 20;
/// Most checks that are kept; the oldest are forgotten first.
const MOST_KEPT: usize = 256;
/// Most checks that the page shows.
const MOST_SHOWN: usize = 100;
/// Checks in a row beyond the limit that make a drift: while one is made somebody may take the part
/// away, or the press may shake.
const CONFIRMED: usize = 2;

bounded! {
    /// One check. Distances in projector pixels.
    struct DriftCheck {
        /// When it was, s since 1970 UTC; 0 if the clock was not synchronised.
        at_unix_s: u64,
        /// Fingerprint of the calibration that it was compared with.
        calibration: String = Longest(FINGERPRINT_DIGITS),
        /// RMS distance from the epipolar lines, by a fit over the frame.
        epipolar_px: f64,
        /// The distance in the middle of the frame.
        offset_px: f64,
        /// From there to the edges, along columns and rows.
        gradient_px: [f64; 2],
        /// Noise of a point.
        noise_px: f64,
        /// Points that were compared.
        pixels: usize,
    }
}

impl DriftCheck {
    fn is_beyond(&self) -> bool {
        !(self.epipolar_px <= MOST_DRIFT_PX)
    }
}

bounded! {
    /// The checks, the oldest first.
    #[derive(Default)]
    struct Checks {
        format: String,
        version: u32,
        checks: Vec<DriftCheck>,
    }
}

/// Why the trend could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum DriftError {
    /// The file cannot be read.
    #[error("{0}")]
    Read(io::Error),
    /// It is no JSON of a trend.
    #[error("{}", shortened(&.0.to_string()))]
    Json(#[from] serde_json::Error),
    /// It is of another format or version.
    #[error("it is not a {FORMAT:?} of version {VERSION}, which this program reads")]
    Format,
    /// A value in it is out of its bounds.
    #[error(transparent)]
    Bounds(#[from] OutOfBounds),
    /// A check cannot be stored.
    #[error("write {}: {source}: free space", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the file system answers.
        source: io::Error,
    },
}

impl Checks {
    /// Reads and checks the content of a file.
    fn read(bytes: &[u8]) -> Result<Self, DriftError> {
        let file: Self = serde_json::from_slice(bytes)?;
        if (file.format.as_str(), file.version) != (FORMAT, VERSION) {
            return Err(DriftError::Format);
        }
        length("checks", file.checks.len(), 0, MOST_KEPT)?;
        for check in &file.checks {
            Fields.check("", check)?;
        }
        Ok(file)
    }

    /// The checks that were compared with this calibration, the newest first.
    fn newest<'a>(&'a self, calibration: &str) -> impl Iterator<Item = &'a DriftCheck> {
        let of = calibration.to_owned();
        let all = self.checks.iter().rev();
        all.filter(move |check| check.calibration == of)
    }

    /// How many of the newest checks in a row, at most as many as make a drift, are beyond the
    /// limit.
    fn beyond(&self, calibration: &str) -> usize {
        let newest = self.newest(calibration).take(CONFIRMED);
        newest.take_while(|check| check.is_beyond()).count()
    }
}

/// The trend, for those who check and those who show it. Cheap to clone.
#[derive(Clone, Debug)]
pub struct DriftTrend {
    path: PathBuf,
    /// Locked only for moments.
    checks: Arc<Mutex<Checks>>,
    /// Locked while the file is written.
    writing: Arc<Mutex<()>>,
}

impl DriftTrend {
    /// What is kept in the state folder, and a complaint if that cannot be used: then the trend
    /// begins anew.
    pub fn open(state: &Path) -> (Self, Option<String>) {
        let path = state.join(FILE);
        let read = match read_whole(&path, MAX_BYTES) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Checks::default()),
            read => read
                .map_err(DriftError::Read)
                .and_then(|bytes| Checks::read(&bytes)),
        };
        let (checks, complaint) = match read {
            Ok(checks) => (checks, None),
            Err(problem) => {
                let path = path.display();
                let words = format!("read {path}: {problem}: the trend of the drift begins anew");
                (Checks::default(), Some(words))
            }
        };
        let opened = Self {
            path,
            checks: Arc::new(Mutex::new(checks)),
            writing: Arc::default(),
        };
        (opened, complaint)
    }

    fn checks(&self) -> MutexGuard<'_, Checks> {
        self.checks.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a check and keeps it, also on the card.
    ///
    /// # Errors
    /// It cannot be stored; it is known until the next start.
    pub fn add(&self, calibration: &str, seen: &Epipolar) -> Result<(), DriftError> {
        let _writing = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        let mut all = self.checks().clone();
        (all.format, all.version) = (FORMAT.into(), VERSION);
        all.checks.push(DriftCheck {
            at_unix_s: clock::utc_us().unwrap_or(0) / 1_000_000,
            calibration: calibration.into(),
            epipolar_px: seen.rms,
            offset_px: seen.offset,
            gradient_px: seen.gradient,
            noise_px: seen.noise,
            pixels: seen.pixels,
        });
        let spare = all.checks.len().saturating_sub(MOST_KEPT);
        all.checks.drain(..spare);
        // Stored before it is shown: what was seen once is known after the next start.
        let stored = serde_json::to_vec(&all).map_err(io::Error::from);
        let stored = stored.and_then(|bytes| write_whole(&self.path, &bytes));
        *self.checks() = all;
        let path = self.path.clone();
        stored.map_err(|source| DriftError::Write { path, source })
    }

    /// The last check of the head with this calibration; none if there was none.
    pub fn last(&self, calibration: &str) -> Option<Drift> {
        let all = self.checks();
        let last = all.newest(calibration).next()?;
        Some(Drift {
            rms_px: last.epipolar_px,
            drifted: all.beyond(calibration) == CONFIRMED,
        })
    }

    /// Whether the last check was beyond the limit, and the one before was not.
    pub fn is_doubtful(&self, calibration: &str) -> bool {
        (1..CONFIRMED).contains(&self.checks().beyond(calibration))
    }

    /// As `GET /api/head` has it; null if there was no check with this calibration.
    pub fn view(&self, calibration: &str) -> Value {
        let all = self.checks();
        let Some(last) = all.newest(calibration).next() else {
            return Value::Null;
        };
        let drifted = all.beyond(calibration) == CONFIRMED;
        let mut trend: Vec<Value> = all
            .newest(calibration)
            .take(MOST_SHOWN)
            .map(|check| json!({ "at_unix_s": check.at_unix_s, "epipolar_px": check.epipolar_px }))
            .collect();
        trend.reverse();
        json!({
            "epipolar_px": last.epipolar_px, "limit_px": MOST_DRIFT_PX, "noise_px": last.noise_px, "at_unix_s": last.at_unix_s,
            "drifted": drifted, "remedy": drifted.then_some(DRIFT_REMEDY), "trend": trend,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    const HEAD: &str = "01234567";

    fn seen(rms: f64) -> Epipolar {
        Epipolar {
            offset: rms,
            gradient: [0.1, -0.2],
            rms,
            noise: 0.05,
            pixels: 40_000,
        }
    }

    #[test]
    fn two_checks_in_a_row_beyond_the_limit_are_a_drift_of_that_calibration_only() {
        let folder = tempfile::tempdir().unwrap();
        let (trend, complaint) = DriftTrend::open(folder.path());
        assert_eq!((trend.last(HEAD), complaint), (None, None));
        assert_eq!(trend.view(HEAD), Value::Null);
        for (rms, doubtful, drifted) in [
            (0.1, false, false),
            (1.0, true, false),
            (0.5, false, false),
            (0.6, true, false),
            (0.51, false, true),
            (0.7, false, true),
            (0.2, false, false),
            (0.8, true, false),
        ] {
            trend.add(HEAD, &seen(rms)).unwrap();
            let last = trend.last(HEAD).unwrap();
            assert_eq!((trend.is_doubtful(HEAD), last.drifted), (doubtful, drifted));
        }
        assert_eq!(trend.last("another"), None);
        assert!(!trend.is_doubtful("another"));
        assert_eq!(trend.view(HEAD)["trend"].as_array().unwrap().len(), 8);
    }

    #[test]
    fn the_trend_survives_a_restart_and_one_that_is_damaged_begins_anew() {
        let folder = tempfile::tempdir().unwrap();
        let (trend, _) = DriftTrend::open(folder.path());
        for at in 0..MOST_KEPT + 3 {
            trend.add(HEAD, &seen(at as f64 * 1e-3)).unwrap();
        }
        let (again, complaint) = DriftTrend::open(folder.path());
        assert_eq!(complaint, None);
        assert_eq!(*again.checks(), *trend.checks());
        assert_eq!(again.checks().checks.len(), MOST_KEPT);
        assert_eq!(again.last(HEAD).unwrap().rms_px, 0.258);
        assert_eq!(
            again.view(HEAD)["trend"][MOST_SHOWN - 1]["epipolar_px"],
            0.258
        );
        let text = fs::read_to_string(folder.path().join(FILE)).unwrap();
        for wrong in [
            "",
            "{}",
            &text[..text.len() / 2],
            &text.replace(":1,", ":9,"),
        ] {
            fs::write(folder.path().join(FILE), wrong).unwrap();
            let (anew, complaint) = DriftTrend::open(folder.path());
            assert!(complaint.unwrap().contains(FILE));
            assert_eq!(anew.last(HEAD), None);
            anew.add(HEAD, &seen(0.1)).unwrap();
            assert_eq!(DriftTrend::open(folder.path()).1, None);
        }
    }
}
