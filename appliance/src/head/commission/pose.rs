//! A pose of the board, as it is kept.

use crate::head::geometry::SeenPose;
use algo::calibration::{BoardNode, BoardView, Corner, FoundBoard};
use hal::bounds::{MAX_SIDE, length, within};
use serde::{Deserialize, Serialize};

/// Most nodes of a pose: four in each square.
const MAX_NODES: usize = 1 << 16;

/// One pose, as it is kept: what its frames have shown.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PoseFile {
    /// Column, row and blur of each corner, px; none for one that was not located.
    pub corners: Vec<Option<[f64; 3]>>,
    /// Length of a square's side in the picture, px.
    pub step: f64,
    /// The projector's points on the board: u, v, ξ, η, px, and column and row of their square.
    pub nodes: Vec<[f64; 6]>,
    /// Why it cannot be used; none if it can.
    pub problem: Option<String>,
}

impl PoseFile {
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
