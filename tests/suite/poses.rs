//! Poses of the board over the page's API: what is none, what the last one means, and what becomes
//! of the models when poses change.

use crate::station_plc::{Daemon, Place};
use crate::technician::{BOARD, Technician};
use serde_json::{Value, json};
use tests::until::{PATIENCE, until};

/// A head that is not calibrated yet.
const HEAD: &str = "calibrated = false
sub_rays = 2
part = { kind = \"plane\" }
[rig.camera]
width = 384
height = 384
angle_deg = 20.7
[rig.projector]
angle_deg = -7.6
";
/// Largest difference of a stated tilt from the board's, degrees.
const TILT_DEGREES: f64 = 1.0;

fn started() -> (Place, Daemon, String) {
    let place = Place::before(HEAD);
    let daemon = Daemon::start(&place);
    let (_, rest) = daemon.log.split_once("shown this once: ").unwrap();
    let secret = rest.split(' ').next().unwrap().to_owned();
    (place, daemon, secret)
}

impl Technician {
    fn takes(&mut self) -> Value {
        self.step("geometry", &json!({ "action": "pose", "board": BOARD }))
    }

    /// Numbers of the poses, and whether each can be used.
    fn poses(&mut self) -> Vec<(u64, bool)> {
        let head = self.head();
        let poses = head["geometry"]["poses"].as_array().unwrap().iter();
        poses
            .map(|pose| (pose["number"].as_u64().unwrap(), pose["usable"] == true))
            .collect()
    }
}

#[test]
fn a_board_that_did_not_move_is_not_there_yet_or_has_another_size_is_no_pose() {
    let (_place, daemon, secret) = started();
    let mut technician = Technician::sign_in(&daemon, &secret);
    technician.passes("timing", &json!({}));
    assert_eq!(technician.takes()["state"], "failed", "a plate");
    assert_eq!(technician.poses(), [(1, false)]);

    // The board is on its way: a pose would show the plate again.
    let mut other = Technician::sign_in(&daemon, &secret);
    let putting = std::thread::spawn(move || other.lay(&json!({ "part": "board", "pose": 1 })));
    until("part on its way", PATIENCE, || {
        assert!(!putting.is_finished());
        (technician.head()["placing"] == true)
            .then_some(())
            .ok_or(())
    });
    let body = json!({ "action": "pose", "board": BOARD });
    let path = "/api/head/steps/geometry";
    let (status, answer) = technician.browser.json("POST", path, &body);
    let words = answer["error"].as_str().unwrap();
    assert!(status == 409 && words.contains("another part"), "{answer}");
    putting.join().unwrap();

    // What was no pose has no number.
    technician.takes();
    assert_eq!(technician.poses(), [(1, true)]);
    for _ in 0..2 {
        let again = technician.takes();
        let said = again["said"][0].as_str().unwrap();
        assert!(
            again["state"] == "failed" && said.contains("lies where it lies in pose 1"),
            "{again}"
        );
        assert_eq!(technician.poses(), [(1, true), (2, false)]);
    }

    // A size in metres is asked about, and costs no pose.
    let body = json!({ "action": "pose", "board": "checker:9x13:0.01" });
    let metres = technician.step("geometry", &body);
    assert_eq!(metres["state"], "failed", "{metres}");
    let remedy = metres["remedy"].as_str().unwrap();
    assert!(remedy.contains("10 if 0.01 is in metres"), "{metres}");
    assert_eq!(technician.head()["geometry"]["board"], BOARD);
    assert_eq!(technician.poses(), [(1, true), (2, false)]);

    technician.lay(&json!({ "part": "board", "pose": 3 }));
    technician.takes();
    assert_eq!(technician.poses(), [(1, true), (2, true)]);
    for number in 1..=2 {
        let path = format!("/api/head/poses/{number}/picture");
        assert_eq!(technician.browser.ask("GET", &path, &[]).0, 200);
    }
}

#[test]
fn a_tilted_last_pose_is_named_at_the_pose_by_the_models_and_by_the_plate_and_changed_poses_are_solved_anew()
 {
    let (_place, daemon, secret) = started();
    let mut technician = Technician::sign_in(&daemon, &secret);
    technician.passes("timing", &json!({}));
    for number in [1, 3, 5, 10] {
        technician.lay(&json!({ "part": "board", "pose": number }));
        technician.takes();
    }
    let geometry = |technician: &mut Technician| technician.head()["geometry"].clone();
    let plane = geometry(&mut technician)["plane"].clone();
    assert_eq!(
        (&plane["pose"], &plane["remedy"]),
        (&json!("pose 4"), &Value::Null)
    );
    let solved = technician.passes("geometry", &json!({ "action": "solve" }));
    assert_eq!(solved["remedy"], Value::Null);
    assert_eq!(solved["figures"]["poses"], 4);

    // The models are those of all poses.
    let forgotten = technician.step("geometry", &json!({ "action": "forget", "pose": 4 }));
    assert_eq!(forgotten["state"], "open", "{forgotten}");
    assert_eq!(geometry(&mut technician)["result"], Value::Null);

    // Simulated pose 2 is tilted by 28.6°.
    technician.lay(&json!({ "part": "board", "pose": 2 }));
    let taken = technician.takes();
    let plane = geometry(&mut technician)["plane"].clone();
    for said in [&taken["said"][0], &plane["said"]] {
        let said = said.as_str().unwrap();
        assert!(
            said.contains("pose 4") && said.contains("tilted by"),
            "{said}"
        );
    }
    for remedy in [&taken["remedy"], &plane["remedy"]] {
        assert!(remedy.as_str().unwrap().contains("flat"), "{remedy}");
    }
    let solved = technician.passes("geometry", &json!({ "action": "solve" }));
    assert!(
        solved["remedy"].as_str().unwrap().contains("pose 4"),
        "{solved}"
    );
    technician.lay(&json!({ "part": "plane" }));
    let refused = technician.step("plane", &json!({}));
    assert_eq!(refused["state"], "failed", "{refused}");
    let remedy = refused["remedy"].as_str().unwrap();
    assert!(remedy.contains("pose 4"), "{refused}");
    let said = refused["said"][0].as_str().unwrap();
    let (_, tilt) = said.split_once("tilted by ").unwrap();
    let tilt: f64 = tilt.split('°').next().unwrap().parse().unwrap();
    assert!((tilt - 28.6).abs() < TILT_DEGREES, "{said}");

    // A pose that is refused afterwards leaves the models.
    technician.step("geometry", &json!({ "action": "forget", "pose": 4 }));
    technician.lay(&json!({ "part": "board", "pose": 10 }));
    technician.takes();
    technician.passes("geometry", &json!({ "action": "solve" }));
    assert_eq!(technician.takes()["state"], "failed");
    assert_ne!(geometry(&mut technician)["result"], Value::Null);
    let forgotten = technician.step("geometry", &json!({ "action": "forget", "pose": 5 }));
    assert_eq!(forgotten["state"], "done", "{forgotten}");
    technician.lay(&json!({ "part": "plane" }));
    technician.passes("plane", &json!({}));
}
