//! `commissioning.json`: what the steps have found, and each pose of the board, so that they survive a
//! restart.

use super::{Step, StepOutcome};
use crate::error::{Exit, Result};
use crate::head::board::Scale;
use crate::head::calibration::geometry::GeometryFile;
use crate::head::commission::Characteristics;
use crate::head::exposing::{Exposing, LEAST_GAIN};
use crate::head::geometry::{SeenPose, covered};
use crate::storage::folder::{read_whole, write_whole};
use algo::calibration::{BoardNode, BoardView, Corner, FoundBoard};
use hal::bounds::{MAX_SIDE, clipped, length, shortened, text, within};
use hal::model::DeviceModel;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::{fs, io};

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
/// Most nodes of a pose: four in each square.
const MAX_NODES: usize = 1 << 16;

/// PoseModels of camera and projector that were made from the poses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PoseModels {
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
    pub steps: BTreeMap<String, StepOutcome>,
    /// What the step `timing` has measured.
    pub measured: Option<Characteristics>,
    /// The board's name.
    pub board: Option<String>,
    /// Its poses by their numbers.
    pub poses: BTreeMap<u32, KeptPose>,
    /// The models made from them.
    pub models: Option<PoseModels>,
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
    /// The file cannot be read or is damaged.
    pub fn load(state: &Path) -> Result<Self> {
        let path = state.join(FILE);
        let what = format!("read {}", path.display());
        let bytes = match read_whole(&path, MAX_BYTES) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Self::default()),
            Err(error) => return Err(Exit::Content.advising(what, "make it readable")(error)),
            Ok(bytes) => bytes,
        };
        let remedy = "it is put aside, and the steps begin anew";
        Self::read(&bytes).map_err(Exit::Content.advising(what, remedy))
    }

    /// Reads and checks the content of a file.
    ///
    /// # Errors
    /// In words.
    fn read(bytes: &[u8]) -> Result<Self, String> {
        let file: Self =
            serde_json::from_slice(bytes).map_err(|error| shortened(&error.to_string()))?;
        if (file.format.as_str(), file.version) != (FORMAT, VERSION) {
            return Err(format!(
                "it is not a {FORMAT:?} of version {VERSION}, which this program reads"
            ));
        }
        if let Some(exposing) = &file.exposing {
            exposing.check(LEAST_GAIN)?;
        }
        if let Some(name) = file.steps.keys().find(|name| Step::of(name).is_none()) {
            return Err(format!("there is no step {:?}", clipped(name)));
        }
        text("board", file.board.as_deref().unwrap_or(""), MAX_BOARD)?;
        length("poses", file.poses.len(), 0, MAX_POSES)?;
        for (number, pose) in &file.poses {
            within("poses", *number, 1, MAX_POSES as u32)?;
            pose.check()?;
        }
        if let Some(models) = &file.models {
            models.geometry.check_bounds()?;
        }
        Ok(file)
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
    /// It cannot be written (73); then what was kept before still is.
    pub fn save(&mut self, state: &Path) -> Result<()> {
        (self.format, self.version) = (FORMAT.into(), VERSION);
        let path = state.join(FILE);
        let bytes = serde_json::to_vec(self).map_err(io::Error::from);
        let written = bytes.and_then(|bytes| write_whole(&path, &bytes));
        let what = format!("write {}", path.display());
        written.map_err(Exit::CannotCreate.advising(what, "free space"))
    }

    /// Puts a file that cannot be used beside the new one.
    pub fn put_aside(state: &Path) {
        let path = state.join(FILE);
        // It may be that it cannot be renamed either; then it is replaced.
        let _ = fs::rename(&path, path.with_extension("json.damaged"));
    }
}

/// One pose, as it is kept: what its frames have shown.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeptPose {
    /// Column, row and blur of each corner, px; none for one that was not located.
    pub corners: Vec<Option<[f64; 3]>>,
    /// Length of a square's side in the picture, px.
    pub step: f64,
    /// The projector's points on the board: u, v, ξ, η, px, and column and row of their square.
    pub nodes: Vec<[f64; 6]>,
    /// Why it cannot be used; none if it can.
    pub problem: Option<String>,
}

impl KeptPose {
    pub(super) fn of(
        found: Option<&FoundBoard>,
        nodes: &[BoardNode],
        problem: Option<String>,
    ) -> Self {
        let corner = |corner: &Corner| [corner.u, corner.v, corner.blur];
        let node = |node: &BoardNode| {
            let (column, row) = node.square;
            let ((u, v), (xi, eta)) = (node.at, node.lit_by);
            [u, v, xi, eta, column as f64, row as f64]
        };
        let corners = found.map_or(&[][..], |found| &found.corners);
        Self {
            corners: corners
                .iter()
                .map(|found| found.as_ref().map(corner))
                .collect(),
            step: found.map_or(0.0, |found| found.step),
            nodes: nodes.iter().map(node).collect(),
            problem,
        }
    }

    /// Corners that were located.
    pub fn located(&self) -> usize {
        self.corners.iter().flatten().count()
    }

    pub(super) fn check(&self) -> Result<(), String> {
        let side = f64::from(MAX_SIDE);
        length("poses.nodes", self.nodes.len(), 0, MAX_NODES)?;
        within("poses.step", self.step, 0.0, side)?;
        for number in self.corners.iter().flatten().flatten() {
            within("poses.corners", *number, -side, 2.0 * side)?;
        }
        for number in self.nodes.iter().flatten() {
            within("poses.nodes", *number, -side, 2.0 * side)?;
        }
        Ok(())
    }

    pub(super) fn seen(&self, number: u32, head: [u32; 5]) -> SeenPose {
        let corner = |[u, v, blur]: [f64; 3]| Corner { u, v, blur };
        let node = |[u, v, xi, eta, column, row]: &[f64; 6]| BoardNode {
            at: (*u, *v),
            lit_by: (*xi, *eta),
            square: (*column as usize, *row as usize),
        };
        SeenPose {
            recording: pose_name(number),
            head,
            view: BoardView {
                found: FoundBoard {
                    corners: self.corners.iter().map(|found| found.map(corner)).collect(),
                    step: self.step,
                },
                nodes: self.nodes.iter().map(node).collect(),
            },
        }
    }
}

/// The name of a pose where recordings have theirs.
pub fn pose_name(number: u32) -> String {
    format!("pose {number}")
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
        let outcome = StepOutcome::failed("measure", "too dark: expose more");
        kept.steps.insert("exposure".into(), outcome);
        let pose = KeptPose {
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
            let words = Commissioning::load(state).unwrap_err().to_string();
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
