//! The head and its commissioning as `GET /api/head` answers.

use super::{Commission, Inside, OpenHead};
use crate::head::commission::{GEOMETRY, Outcome, STEPS, pose_name};
use crate::station::Snapshot;
use serde_json::{Value, json};

impl Commission {
    /// The state of head and steps; whether a recipe is active comes from the snapshot.
    pub fn view(&self, snapshot: &Snapshot) -> Value {
        let inside = self.inside();
        let Some(head) = &inside.head else {
            let words = match &snapshot.fault {
                Some(fault) => format!("{}; {}", fault.cause, fault.remedy),
                None => "the head is being opened".into(),
            };
            return json!({ "open": false, "problem": words, "running": null, "steps": [] });
        };
        let running = inside.running.as_ref().map(|running| {
            json!({
                "step": running.name, "said": running.said, "share": running.share,
                "since_ms": running.since.elapsed().as_millis() as u64,
            })
        });
        let (width, height, bits) = head.calibration.frames();
        let (columns, rows) = head.calibration.raster();
        json!({
            "open": true,
            "simulated": head.simulated,
            "calibrated": head.problem.is_none(),
            "problem": head.problem,
            "camera": {
                "columns": width, "rows": height, "bits": bits, "exposure_us": head.exposing.exposure_us, "gain": head.exposing.gain, "least_gain": head.least_gain,
                "refresh_us": head.refresh.as_micros() as u64, "adjustable": head.adjustable,
            },
            "projector": { "columns": columns, "rows": rows },
            "volume": head.volume,
            "running": running,
            "steps": steps(&inside, snapshot),
            "geometry": geometry(&inside, head),
            "drift": self.drift.view(&head.calibration.fingerprint()),
        })
    }
}

fn steps(inside: &Inside, snapshot: &Snapshot) -> Vec<Value> {
    let running = inside.running.as_ref().map(|running| running.name);
    let mut steps: Vec<Value> = STEPS
        .iter()
        .map(|step| {
            let outcome = inside.kept.steps.get(step.name);
            let state = match outcome {
                _ if running == Some(step.name) => "running",
                None => "open",
                Some(outcome) if outcome.passed => "done",
                Some(_) => "failed",
            };
            let mut shown = shown(step.name, state, outcome);
            let ground = inside.laid.ground.as_ref();
            if let (GEOMETRY, None, Some(ground)) = (step.name, outcome, ground) {
                (shown["said"], shown["remedy"]) =
                    (json!([ground.words()]), json!(ground.remedy()));
            }
            shown
        })
        .collect();
    let state = match (&snapshot.teach, &snapshot.recipe) {
        (Some(_), _) => "running",
        (None, Some(_)) => "done",
        (None, None) => "open",
    };
    let mut teach = shown("teach", state, None);
    if let Some(recipe) = &snapshot.recipe {
        let words = format!("recipe {} ({}) is active", recipe.number, recipe.name);
        teach["said"] = json!([words]);
    }
    steps.push(teach);
    steps
}

fn shown(name: &str, state: &str, outcome: Option<&Outcome>) -> Value {
    json!({
        "name": name, "state": state, "at_unix_s": outcome.map(|outcome| outcome.at_unix_s),
        "said": outcome.map_or(&[][..], |outcome| &outcome.said),
        "remedy": outcome.and_then(|outcome| outcome.remedy.as_ref()),
        "figures": outcome.map_or(json!({}), |outcome| outcome.figures.clone()),
    })
}

/// The poses, and the models if there are any. What a pose has left in the models is known by its
/// name there.
fn geometry(inside: &Inside, head: &OpenHead) -> Value {
    let (kept, laid) = (&inside.kept, &inside.laid);
    let models = kept.models.as_ref();
    let of = kept.board.as_deref().and_then(corners_of).unwrap_or(0);
    let poses: Vec<Value> = kept
        .poses
        .iter()
        .map(|(number, pose)| {
            let name = pose_name(*number);
            let fitted = models.and_then(|models| {
                let mut poses = models.geometry.poses.iter();
                poses.find(|fitted| fitted.recording == name)
            });
            json!({
                "number": number, "corners": pose.located(), "of": of, "usable": pose.problem.is_none(), "problem": pose.problem,
                "tilt_degrees": laid.tilt(*number), "camera_px": fitted.map(|pose| pose.camera_px),
                "projector_px": fitted.map(|pose| pose.projector_px),
            })
        })
        .collect();
    let result = models.map(|models| {
        let file = &models.geometry;
        json!({
            "camera_px": file.camera_px, "projector_px": file.projector_px, "height_sigma_mm": file.height_sigma_mm,
            "length_sigma_mm": file.length_sigma_mm, "baseline_mm": file.baseline_mm, "scale": models.scale,
        })
    });
    let plane = laid.ground.as_ref().map(
        |ground| json!({ "pose": ground.pose, "said": ground.words(), "remedy": ground.remedy() }),
    );
    json!({
        "board": kept.board, "poses": poses, "plane": plane, "frame_covered": kept.covered(head.calibration.frames()),
        "tilt_degrees": models.map(|models| models.tilt_degrees), "result": result,
    })
}

fn corners_of(board: &str) -> Option<usize> {
    let board = crate::head::board::parse(board).ok()?;
    Some(board.columns * board.rows)
}
