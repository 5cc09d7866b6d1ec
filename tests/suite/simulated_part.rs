//! The part of a simulated head, set on the command line and over the page's API of the real
//! program.

use crate::page::Browser;
use crate::station_plc::{Daemon, Place, Plc, command};
use crate::written::program;
use serde_json::{Value, json};

const PASS: u16 = 1;
const FAIL: u16 = 2;
/// A dent that the small head sees well.
const DENT: &str = "dent:0,-8,1,18";

fn bracket(defects: Value, shift: [f64; 3]) -> Value {
    json!({
        "part": { "kind": "sheet_metal", "defects": defects },
        "placement": { "shift_mm": shift },
    })
}

#[test]
fn a_trigger_after_the_answer_sees_the_part_that_was_put_there_over_the_page() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    let mut plc = Plc::connect(&daemon);
    assert_eq!(plc.measure(1)[8], PASS);
    let shown = browser.get("/api/simulation/part");
    assert_eq!(shown["simulated"], true);
    assert_eq!(shown["part"]["kind"], "sheet_metal");
    let dent = json!([{ "kind": "dent", "x": 0, "y": -8, "depth_mm": 1, "diameter_mm": 18 }]);
    let dented = bracket(dent, [0.0; 3]);
    let put = "/api/simulation/part";
    assert_eq!(browser.json("PUT", put, &dented).0, 401, "without a login");
    browser.sign_in(&daemon);
    let good = |shift| bracket(json!([]), shift);
    for (token, (body, verdict)) in [
        (&dented, FAIL),
        (&good([0.0; 3]), PASS),
        (&good([0.5, 0.0, 0.0]), PASS),
        (&dented, FAIL),
    ]
    .into_iter()
    .enumerate()
    {
        let (status, answer) = browser.json("PUT", put, body);
        assert_eq!(status, 200, "{answer}");
        assert_eq!(
            answer["placement"]["shift_mm"],
            json!(body["placement"]["shift_mm"])
        );
        assert_eq!(plc.measure(token as u16 + 2)[8], verdict, "{body}");
        let result = &browser.get("/api/snapshot")["result"];
        assert_eq!(result["simulated"], true, "{result}");
    }
    let before = browser.get(put);
    for (wrong, status, words) in [
        (
            bracket(json!([{ "kind": "missing_hole", "index": 3 }]), [0.0; 3]),
            422,
            "index",
        ),
        (
            bracket(
                json!([{ "kind": "dent", "x": 1e9, "y": 0, "depth_mm": 1, "diameter_mm": 18 }]),
                [0.0; 3],
            ),
            422,
            "part.defects.x",
        ),
        (good([0.0, 0.0, 1e12]), 422, "shift_mm"),
        (json!({ "part": { "kind": "teapot" } }), 400, "teapot"),
        (
            json!({ "part": { "kind": "empty", "defects": [] } }),
            400,
            "defects",
        ),
        (
            json!({ "part": { "kind": "tube", "defects": [{ "kind": "missing_hole", "index": 1 }] } }),
            422,
            "dents only",
        ),
        (json!({ "placement": {} }), 400, "part"),
        (
            json!({ "part": "plane", "material": "wood" }),
            400,
            "rolled_steel",
        ),
    ] {
        let (got, answer) = browser.json("PUT", put, &wrong);
        assert_eq!(got, status, "{wrong}: {answer}");
        assert!(
            answer["error"].as_str().unwrap().contains(words),
            "{answer}"
        );
    }
    assert_eq!(browser.get(put), before);
    assert_eq!(plc.measure(9)[8], FAIL);
    // Another material in the same place is another part.
    assert_eq!(before["material"], Value::Null);
    assert_eq!(
        before["materials"],
        json!(["matte", "rolled_steel", "oiled", "black_plastic"])
    );
    for material in ["oiled", "matte"] {
        let mut body = good([0.0; 3]);
        body["material"] = json!(material);
        let (status, answer) = browser.json("PUT", put, &body);
        assert_eq!(
            (status, &answer["material"]),
            (200, &json!(material)),
            "{answer}"
        );
        let verdict = plc.measure(if material == "oiled" { 10 } else { 11 })[8];
        assert_eq!(
            verdict == PASS,
            material == "matte",
            "{material}: {verdict}"
        );
    }
}

#[test]
fn a_start_with_a_defective_part_teaches_a_good_one_and_then_shows_the_defective_one() {
    let place = Place::new();
    // The first start teaches, the second one loads.
    for _ in 0..2 {
        let mut command = command(&place);
        command.args([
            "--part",
            "sheet_metal",
            "--defect",
            DENT,
            "--shift",
            "-0.2,0,0",
            "--material",
            "matte",
        ]);
        let daemon = Daemon::of(command);
        let mut plc = Plc::connect(&daemon);
        assert_eq!(plc.measure(1)[8], FAIL);
        let shown = Browser::new(&daemon).get("/api/simulation/part");
        assert_eq!(shown["part"]["defects"][0]["kind"], "dent");
        assert_eq!(shown["placement"]["shift_mm"], json!([-0.2, 0.0, 0.0]));
        assert_eq!(shown["material"], "matte");
        assert_eq!(daemon.terminate().code(), Some(0));
    }
    let daemon = Daemon::start(&place);
    assert_eq!(Plc::connect(&daemon).measure(1)[8], PASS);
}

#[test]
fn a_part_that_cannot_be_simulated_is_a_usage_error_with_the_remedy() {
    let place = Place::new();
    let config = place.path("fringed.toml").display().to_string();
    let refused = |arguments: &[&str], word: &str| {
        let all = [&["serve", "--config", &config], arguments].concat();
        let run = program().run(&all);
        assert_eq!(run.code, 64, "{arguments:?}: {}", run.stderr);
        assert!(run.stderr.contains(word), "{}", run.stderr);
    };
    refused(&["--part", "teapot"], "flowerpot");
    refused(&["--defect", "scratch:1"], "dent:x,y,depth_mm,diameter_mm");
    refused(
        &["--part", "plane", "--defect", "bent_flange:3"],
        "plane has no bent_flange",
    );
    refused(&["--defect", "missing_hole:7"], "index");
    refused(&["--part", "tube", "--material", "wood"], "rolled_steel");
    refused(&["--shift", "1,2"], "3 numbers");
    refused(&["--tilt", "90,0"], "from -80 to 80");
    refused(&["--rotate", "nan"], "from -360 to 360");
    let replay = "[head]\nbackend = \"replay\"\nrecordings = [\"none\"]\n";
    std::fs::write(&config, replay).unwrap();
    refused(&["--part", "plane"], "not simulated");
    refused(&["--material", "oiled"], "not simulated");
}
