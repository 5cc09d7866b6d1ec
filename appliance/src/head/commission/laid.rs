//! How the board lies in the poses: its tilts, and whether the last one can be z = 0. It is known
//! about before the models are made, and well by them.

use super::file::{Commissioning, Models};
use super::outcome::Outcome;
use super::pose::pose_name;
use crate::head::board;
use crate::head::seam;
use crate::head::standing::Ground;
use algo::calibration::{BoardView, estimate};
use serde_json::json;
use std::collections::BTreeMap;

/// How the board lies.
#[derive(Clone, Debug, Default)]
pub struct Laid {
    /// Angle between the board's normal and the camera's axis by the name of the pose, degrees.
    pub tilts: BTreeMap<String, f64>,
    /// The pose that z = 0 goes by, if it is known how the board stands in it.
    pub ground: Option<Ground>,
}

impl Commissioning {
    /// How the board lies in the poses that can be used.
    pub fn laid(&self) -> Laid {
        match &self.models {
            Some(models) => {
                let poses = models.geometry.poses.iter();
                Laid {
                    tilts: poses
                        .map(|pose| (pose.recording.clone(), pose.tilt_degrees))
                        .collect(),
                    ground: models.ground(self.head),
                }
            }
            None => self.estimated().unwrap_or_default(),
        }
    }

    fn estimated(&self) -> Option<Laid> {
        let board = board::parse(self.board.as_deref()?).ok()?;
        let [columns, rows, ..] = self.head.map(|size| size as usize);
        let (names, views): (Vec<String>, Vec<BoardView>) = self
            .usable(None)
            .map(|pose| (pose.recording, pose.view))
            .unzip();
        let rig = estimate(&board, (columns, rows), &views)?;
        let last = names.len() - 1;
        Some(Laid {
            ground: Some(Ground {
                pose: names[last].clone(),
                standing: rig.standing(last),
            }),
            tilts: names
                .into_iter()
                .enumerate()
                .map(|(at, name)| (name, rig.tilt(at).to_degrees()))
                .collect(),
        })
    }
}

impl Laid {
    /// The tilt in a pose, degrees.
    pub fn tilt(&self, number: u32) -> Option<f64> {
        self.tilts.get(&pose_name(number)).copied()
    }
}

impl Models {
    /// The pose that z = 0 goes by.
    pub fn ground(&self, [columns, rows, _, across, down]: [u32; 5]) -> Option<Ground> {
        let camera = seam::pinhole("camera", &self.camera, (columns, rows)).ok()?;
        let projector = seam::pinhole("projector", &self.projector, (across, down)).ok()?;
        let last = self.geometry.poses.last()?;
        Some(Ground::of(&last.recording, &camera, &projector))
    }

    /// What the step that made them has found.
    pub(super) fn found(&self, head: [u32; 5]) -> Outcome {
        let file = &self.geometry;
        let residuals = format!(
            "residuals camera {:.3} px, projector {:.3} px RMS over {} poses; σ of heights {:.4} mm, of a length of 100 mm {:.4} mm",
            file.camera_px,
            file.projector_px,
            file.poses.len(),
            file.height_sigma_mm,
            file.length_sigma_mm
        );
        let ground = self.ground(head);
        let said = [residuals]
            .into_iter()
            .chain(ground.as_ref().map(Ground::words));
        let figures = json!({
            "camera_px": file.camera_px, "projector_px": file.projector_px, "height_sigma_mm": file.height_sigma_mm,
            "length_sigma_mm": file.length_sigma_mm, "poses": file.poses.len(),
        });
        Outcome {
            remedy: ground.as_ref().and_then(Ground::remedy),
            ..Outcome::passed(said, figures)
        }
    }
}
