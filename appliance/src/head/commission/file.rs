//! `commissioning.json`: what the steps have found, so that each survives a restart.

use super::Step;
use super::outcome::Outcome;
use super::pose::PoseFile;
use crate::head::calibrate::Characteristics;
use crate::head::calibration::geometry::GeometryFile;
use crate::head::exposing::{Exposing, LEAST_GAIN};
use crate::head::geometry::covered;
use crate::head::scale::Scale;
use crate::storage::folder::{read_whole, write_whole};
use hal::bounds::{clipped, length, shortened, text, within};
use hal::model::DeviceModel;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::Path;

/// Its name in the state folder.
pub const FILE: &str = "commissioning.json";
const FORMAT: &str = "fringed commissioning";
const VERSION: u32 = 1;
/// Longest file, bytes: as many poses and nodes as there may be take less.
const MAX_BYTES: u64 = 512 << 20;
/// Longest name of a board, bytes.
const MAX_BOARD: usize = 64;
/// Most poses that are kept.
pub const MAX_POSES: usize = crate::head::calibration::geometry::MAX_POSES;

/// Models of camera and projector that were made from the poses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Models {
    /// The camera, with the board's last pose as z = 0.
    pub camera: DeviceModel,
    /// The projector.
    pub projector: DeviceModel,
    /// How they were made.
    pub geometry: GeometryFile,
    /// Share of the camera's frame in which there were corners.
    pub frame_covered: f64,
    /// Largest angle between the board in two poses, degrees.
    pub tilt_degrees: f64,
    /// How the scale was checked.
    pub scale: Scale,
}

/// Everything that the steps have found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Commissioning {
    format: String,
    version: u32,
    /// Columns, rows and bits of the camera's frames, columns and rows of the projector: of the
    /// head that the rest belongs to.
    pub head: [u32; 5],
    /// Exposure and gain that are kept; none = as configured.
    pub exposing: Option<Exposing>,
    /// How each step ended, by its name; one that is not here is still to be done.
    pub steps: BTreeMap<String, Outcome>,
    /// What the step `timing` has measured.
    pub measured: Option<Characteristics>,
    /// The board's name.
    pub board: Option<String>,
    /// Its poses by their numbers.
    pub poses: BTreeMap<u32, PoseFile>,
    /// The models made from them.
    pub models: Option<Models>,
}

impl Commissioning {
    /// Nothing yet, of the head of these sizes.
    pub fn of(head: [u32; 5], exposing: Option<Exposing>) -> Self {
        Self {
            head,
            exposing,
            ..Self::default()
        }
    }

    /// Reads what is kept in a state folder; nothing if there is nothing.
    ///
    /// # Errors
    /// In words: the file cannot be read or is damaged.
    pub fn load(state: &Path) -> Result<Self, String> {
        let path = state.join(FILE);
        let wrong = |problem: String| format!("read {}: {problem}", path.display());
        let bytes = match read_whole(&path, MAX_BYTES) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Self::default()),
            Err(error) => return Err(wrong(format!("{error}: make it readable"))),
            Ok(bytes) => bytes,
        };
        Self::read(&bytes).map_err(|error| {
            wrong(format!(
                "{error}: it is put aside, and the steps begin anew"
            ))
        })
    }

    /// Reads and checks the content of a file.
    ///
    /// # Errors
    /// In words.
    pub fn read(bytes: &[u8]) -> Result<Self, String> {
        let file: Self =
            serde_json::from_slice(bytes).map_err(|error| shortened(&error.to_string()))?;
        if (file.format.as_str(), file.version) != (FORMAT, VERSION) {
            return Err(format!(
                "it is not a {FORMAT:?} of version {VERSION}, which this program reads"
            ));
        }
        file.check()?;
        Ok(file)
    }

    fn check(&self) -> Result<(), String> {
        if let Some(exposing) = &self.exposing {
            exposing.check(LEAST_GAIN)?;
        }
        if let Some(name) = self.steps.keys().find(|name| Step::of(name).is_none()) {
            return Err(format!("there is no step {:?}", clipped(name)));
        }
        text("board", self.board.as_deref().unwrap_or(""), MAX_BOARD)?;
        length("poses", self.poses.len(), 0, MAX_POSES)?;
        for (number, pose) in &self.poses {
            within("poses", *number, 1, MAX_POSES as u32)?;
            pose.check()?;
        }
        if let Some(models) = &self.models {
            models.geometry.check_bounds()?;
        }
        Ok(())
    }

    /// Share of the cells of the frame in which a pose that can be used has a corner.
    pub fn covered(&self, (width, height, _): (u32, u32, u8)) -> f64 {
        let usable = self.poses.values().filter(|pose| pose.problem.is_none());
        let corners = usable.flat_map(|pose| pose.corners.iter().flatten());
        covered(
            (width as usize, height as usize),
            corners.map(|[u, v, _]| (*u, *v)),
        )
    }

    /// Exposure and gain that are kept in a state folder, if any are.
    pub fn kept_exposing(state: &Path) -> Option<Exposing> {
        Self::load(state).ok()?.exposing
    }

    /// Writes it whole.
    ///
    /// # Errors
    /// In words, with the remedy; then what was kept before still is.
    pub fn save(&mut self, state: &Path) -> Result<(), String> {
        (self.format, self.version) = (FORMAT.into(), VERSION);
        let path = state.join(FILE);
        let wrong = |problem: String| format!("write {}: {problem}: free space", path.display());
        let bytes = serde_json::to_vec(self).map_err(|error| wrong(error.to_string()))?;
        write_whole(&path, &bytes).map_err(|error| wrong(error.to_string()))
    }

    /// Puts a file that cannot be used beside the new one.
    pub fn put_aside(state: &Path) {
        let path = state.join(FILE);
        // It may be that it cannot be renamed either; then it is replaced.
        let _ = fs::rename(&path, path.with_extension("json.damaged"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_kept_is_read_again_and_what_is_damaged_is_put_aside() {
        let folder = tempfile::tempdir().unwrap();
        let state = folder.path();
        assert_eq!(Commissioning::load(state), Ok(Commissioning::default()));
        let exposing = Exposing {
            exposure_us: 33_333,
            gain: 2.5,
        };
        let mut kept = Commissioning::of([4, 3, 8, 8, 6], Some(exposing));
        let outcome = Outcome::failed("measure", "too dark: expose more");
        kept.steps.insert("exposure".into(), outcome);
        let pose = PoseFile {
            corners: vec![Some([0.1, 1.0 / 3.0, 0.5]), None],
            step: 14.5,
            nodes: vec![[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]],
            problem: None,
        };
        kept.poses.insert(7, pose);
        kept.save(state).unwrap();
        assert_eq!(Commissioning::load(state), Ok(kept));
        assert_eq!(Commissioning::kept_exposing(state), Some(exposing));
        let text = fs::read_to_string(state.join(FILE)).unwrap();
        for (now, wrong) in [
            ("33333", "0"),
            ("2.5", "1e9"),
            ("14.5", "-1"),
            ("\"7\"", "\"65\""),
            ("\"version\":1", "\"version\":2"),
            ("}", ""),
        ] {
            fs::write(state.join(FILE), text.replacen(now, wrong, 1)).unwrap();
            let words = Commissioning::load(state).unwrap_err();
            assert!(
                words.contains(FILE) && words.contains("put aside"),
                "{words}"
            );
            assert_eq!(Commissioning::kept_exposing(state), None);
        }
        Commissioning::put_aside(state);
        assert_eq!(Commissioning::load(state), Ok(Commissioning::default()));
        assert!(state.join("commissioning.json.damaged").exists());
    }
}
