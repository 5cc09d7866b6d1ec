//! The page's API on the real program: the PLC sees what a technician changes there.

use super::written::program;
use crate::station_plc::{Daemon, Place, Plc, long};
use appliance::recipe::Store;
use appliance::recipe::file::archive;
use serde_json::{Value, json};
use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use tests::files;
use tests::until::{PATIENCE, until};

const PASS: u16 = 1;
const FAIL: u16 = 2;

/// A client like a browser: one request per connection, and a cookie.
pub struct Browser {
    address: SocketAddr,
    pub cookie: String,
}

impl Browser {
    pub fn new(daemon: &Daemon) -> Self {
        Self {
            address: daemon.http,
            cookie: String::new(),
        }
    }

    /// Sends the head of a request; the caller sends the body.
    pub fn begin(&self, method: &str, path: &str, length: usize) -> TcpStream {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let head = format!(
            "{method} {path} HTTP/1.1\r\nHost: {0}\r\nOrigin: http://{0}\r\nCookie: {1}\r\nContent-Length: {length}\r\n\
             Connection: close\r\n\r\n",
            self.address, self.cookie,
        );
        stream.write_all(head.as_bytes()).unwrap();
        stream
    }

    /// Status and body.
    pub fn ask(&mut self, method: &str, path: &str, body: &[u8]) -> (u16, Vec<u8>) {
        let mut stream = self.begin(method, path, body.len());
        // A refused request may be answered before its body is read.
        let _ = stream.write_all(body);
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let end = answer
            .windows(4)
            .position(|four| four == b"\r\n\r\n")
            .unwrap();
        let head = String::from_utf8_lossy(&answer[..end]).into_owned();
        for line in head.lines() {
            if let Some(cookie) = line.strip_prefix("set-cookie: ") {
                self.cookie = cookie.split(';').next().unwrap().to_owned();
            }
        }
        let status = head[9..12].parse().unwrap();
        let body = &answer[end + 4..];
        match head.contains("transfer-encoding: chunked") {
            true => (status, unchunked(body)),
            false => (status, body.to_vec()),
        }
    }

    pub fn json(&mut self, method: &str, path: &str, body: &Value) -> (u16, Value) {
        let (status, answer) = self.ask(method, path, body.to_string().as_bytes());
        (status, serde_json::from_slice(&answer).unwrap())
    }

    pub fn get(&mut self, path: &str) -> Value {
        let (status, answer) = self.ask("GET", path, &[]);
        assert_eq!(status, 200, "{path}: {}", String::from_utf8_lossy(&answer));
        serde_json::from_slice(&answer).unwrap()
    }

    pub fn sign_in(&mut self, daemon: &Daemon) {
        self.sign_in_at(daemon, 0);
    }

    /// Signs in with the browser's clock at so many ms since 1970; returns the answer.
    pub fn sign_in_at(&mut self, daemon: &Daemon, time_ms: u64) -> String {
        let (_, rest) = daemon.log.split_once("shown this once: ").unwrap();
        let secret = rest.split(' ').next().unwrap();
        let body = json!({ "secret": secret, "time_ms": time_ms });
        let (status, answer) = self.json("POST", "/api/session", &body);
        assert_eq!(status, 200, "{answer}");
        answer["time"].as_str().unwrap().to_owned()
    }

    /// Waits until the station is ready with a recipe whose fingerprint differs from `before`.
    pub fn wait_for_another(&mut self, before: &str) -> String {
        until("other recipe", PATIENCE, || {
            let snapshot = self.get("/api/snapshot");
            let now = snapshot["recipe"]["fingerprint"].as_str().unwrap_or(before);
            match snapshot["ready"] == true && !before.starts_with(now) {
                true => Ok(now.to_owned()),
                false => Err(snapshot),
            }
        })
    }

    /// Waits until the station is ready.
    pub fn ready(&mut self) {
        until("ready station", 2 * PATIENCE, || {
            let snapshot = self.get("/api/snapshot");
            let working = ["boot", "ready", "loading", "teaching"].map(Value::from);
            assert!(working.contains(&snapshot["state"]), "{snapshot}");
            match snapshot["ready"] == true {
                true => Ok(()),
                false => Err(snapshot),
            }
        });
    }

    /// The result of a trigger.
    pub fn measure(&mut self) -> Value {
        let before = self.get("/api/snapshot")["counters"]["sequence"].clone();
        let (status, answer) = self.json("POST", "/api/trigger", &json!({}));
        assert_eq!(status, 202, "{answer}");
        until("result", PATIENCE, || {
            let snapshot = self.get("/api/snapshot");
            match snapshot["counters"]["sequence"] != before && snapshot["ready"] == true {
                true => Ok(snapshot["result"].clone()),
                false => Err(snapshot),
            }
        })
    }

    /// The step of commissioning of this name, once none is being carried out.
    pub fn ended(&mut self, name: &str) -> Value {
        until(&format!("end of {name}"), 8 * PATIENCE, || {
            let head = self.get("/api/head");
            match head["running"].is_null() {
                true => Ok(step_of(&head, name)),
                false => Err(head),
            }
        })
    }
}

/// The step of commissioning of this name.
pub fn step_of(head: &Value, name: &str) -> Value {
    let steps = head["steps"].as_array().unwrap();
    let found = steps.iter().find(|step| step["name"] == name);
    found.unwrap_or_else(|| panic!("{name}: {head}")).clone()
}

/// A station that was taught before, and a browser that is signed in.
pub fn signed_in() -> (Place, Daemon, Browser) {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    browser.sign_in(&daemon);
    (place, daemon, browser)
}

/// The body of a chunked answer, which must be complete.
fn unchunked(mut body: &[u8]) -> Vec<u8> {
    let mut whole = Vec::new();
    loop {
        let end = body.windows(2).position(|two| two == b"\r\n").unwrap();
        let length = usize::from_str_radix(std::str::from_utf8(&body[..end]).unwrap(), 16).unwrap();
        if length == 0 {
            return whole;
        }
        let from = end + 2;
        whole.extend_from_slice(&body[from..from + length]);
        body = &body[from + length + 2..];
    }
}

#[test]
fn limits_that_are_edited_on_the_page_change_the_verdict_and_the_fingerprint() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    let mut plc = Plc::connect(&daemon);
    assert_eq!(plc.measure(1)[8], PASS);
    let recipe = browser.get("/api/recipes/1");
    let mut gauges = recipe["gauges"].clone();
    gauges[0]["low"] = json!(0.2);
    gauges[0]["high"] = json!(0.3);
    let mut edit =
        json!({ "fingerprint": recipe["fingerprint"], "gauges": gauges, "name": "bracket" });
    let (status, answer) = browser.json("PUT", "/api/recipes/1", &edit);
    assert_eq!(status, 401, "without a login: {answer}");
    browser.sign_in(&daemon);
    let (status, answer) = browser.json("PUT", "/api/recipes/1", &edit);
    assert_eq!(status, 200, "{answer}");
    let before = recipe["fingerprint"].as_str().unwrap();
    let fingerprint = browser.wait_for_another(before);
    assert!(
        answer["fingerprint"]
            .as_str()
            .unwrap()
            .starts_with(&fingerprint)
    );
    assert_eq!(plc.measure(2)[8], FAIL);
    // A change that is based on an older version of the recipe does not undo somebody else's
    // change.
    edit["name"] = json!("other");
    let (status, answer) = browser.json("PUT", "/api/recipes/1", &edit);
    assert_eq!(status, 409, "{answer}");
    assert_eq!(browser.get("/api/recipes/1")["name"], "bracket");
}

#[test]
fn an_edit_that_makes_no_recipe_is_refused_in_words_and_changes_nothing() {
    let (_place, _daemon, mut browser) = signed_in();
    let recipe = browser.get("/api/recipes/1");
    let region = json!({ "name": "line", "kind": "surface", "region": [[1.0, 1.0], [2.0, 2.0]] });
    for (key, value) in [
        ("name", json!("")),
        ("name", json!("x".repeat(100))),
        ("part_number", json!("ä")),
        ("min_coverage", json!(1.5)),
        ("gauges", json!([])),
        ("features", json!([])),
        ("features", json!([region])),
        (
            "features",
            json!([recipe["features"][0], recipe["features"][0]]),
        ),
    ] {
        let edit = json!({ "fingerprint": recipe["fingerprint"], key: value });
        let (status, answer) = browser.json("PUT", "/api/recipes/1", &edit);
        assert_eq!(status, 422, "{key}: {answer}");
        assert!(
            answer["error"].as_str().unwrap().len() > 10,
            "{key}: {answer}"
        );
    }
    for (low, high) in [(0.5, -0.5), (-1e6, 0.15), (-0.15, 1e6)] {
        let mut gauges = recipe["gauges"].clone();
        (gauges[0]["low"], gauges[0]["high"]) = (json!(low), json!(high));
        let edit = json!({ "fingerprint": recipe["fingerprint"], "gauges": gauges });
        let (status, answer) = browser.json("PUT", "/api/recipes/1", &edit);
        assert_eq!(status, 422, "{low} {high}: {answer}");
        let words = answer["error"].as_str().unwrap();
        assert!(words.contains("gauge \"deviation\""), "{words}");
    }
    let unknown = json!({ "fingerprint": recipe["fingerprint"], "threads": 4 });
    assert_eq!(browser.json("PUT", "/api/recipes/1", &unknown).0, 400);
    assert_eq!(browser.get("/api/recipes/1"), recipe);
}

#[test]
fn a_recipe_with_inverted_limits_is_refused_by_the_gauges_name_wherever_it_comes_from_and_can_be_mended()
 {
    let (place, _daemon, mut browser) = signed_in();
    let taught = std::fs::read(place.recipe()).unwrap();
    let (mut file, arrays) = files::recipe(&taught);
    let limits = file.gauges.clone();
    (file.gauges[0].low, file.gauges[0].high) = (Some(0.5), Some(-0.5));
    let (inverted, fingerprint) = archive::pack(&file, &arrays).unwrap();
    let names = |words: &str| {
        let named = words.contains("deviation") && words.contains("passes no part");
        assert!(named, "{words}");
    };
    // With the page's editor, and as a file.
    let (status, answer) = browser.ask("POST", "/api/recipes", &inverted);
    assert_eq!(status, 422);
    names(&String::from_utf8(answer).unwrap());
    let path = place.path("inverted.recipe");
    std::fs::write(&path, &inverted).unwrap();
    let (path, config) = (path.to_str().unwrap(), place.path("fringed.toml"));
    let config = config.to_str().unwrap();
    let run = program().run(&["recipe", "import", path, "--config", config]);
    assert_eq!(run.code, 65, "{}", run.stderr);
    names(&run.stderr);
    assert_eq!(std::fs::read(place.recipe()).unwrap(), taught);
    // Stored by a program that did not check limits: the previous generation is not used instead,
    // and the recipe can be repaired.
    let store = Store::at(&place.path("state/recipes"));
    store.save(1, &inverted).unwrap();
    names(&store.load(1).unwrap_err().to_string());
    names(
        &store
            .load_fingerprint(1, &fingerprint)
            .unwrap_err()
            .to_string(),
    );
    assert_eq!(browser.get("/api/recipes/1")["gauges"][0]["low"], 0.5);
    let (status, _) = browser.ask("GET", "/api/recipes/1/picture/height", &[]);
    assert_eq!(status, 200);
    let edit = json!({ "fingerprint": fingerprint, "gauges": limits });
    let (status, answer) = browser.json("PUT", "/api/recipes/1", &edit);
    assert_eq!(status, 200, "{answer}");
    assert!(store.load(1).is_ok());
}

#[test]
fn an_exported_recipe_comes_back_by_import_and_a_damaged_one_does_not() {
    let (_place, _daemon, mut browser) = signed_in();
    let (status, mut file) = browser.ask("GET", "/api/recipes/1/file", &[]);
    assert_eq!((status, &file[..2]), (200, &b"PK"[..]));
    let (status, _) = browser.ask("POST", "/api/recipes", &file);
    assert_eq!(status, 201);
    let middle = file.len() / 2;
    file[middle] ^= 0x10;
    let (status, answer) = browser.ask("POST", "/api/recipes", &file);
    let words = String::from_utf8(answer).unwrap();
    assert!(
        status == 422 && words.contains("export the recipe again"),
        "{status} {words}"
    );
    let recipes = browser.get("/api/recipes");
    assert_eq!(recipes["recipes"].as_array().unwrap().len(), 1);
    assert!(recipes["recipes"][0]["error"].is_null(), "{recipes}");
}

#[test]
fn pictures_and_files_of_the_last_part_belong_to_its_result() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    assert_eq!(browser.ask("GET", "/api/picture/height", &[]).0, 204);
    assert_eq!(browser.ask("GET", "/api/picture/colour", &[]).0, 404);
    Plc::connect(&daemon).measure(1);
    for layer in ["height", "deviation", "modulation"] {
        let (status, words) = browser.ask("GET", &format!("/api/picture/{layer}"), &[]);
        assert_eq!((status, words.len()), (200, 2 * 160 * 160), "{layer}");
        let known = words
            .chunks(2)
            .filter(|word| **word != [0xFF, 0xFF])
            .count();
        assert!(known > 1000, "{layer}: {known}");
    }
    let (status, cloud) = browser.ask("GET", "/api/last/cloud.ply", &[]);
    assert!(status == 200 && cloud.starts_with(b"ply\n"));
    let (status, recording) = browser.ask("GET", "/api/last/recording.zip", &[]);
    assert!(status == 200 && recording.starts_with(b"PK"));
    let names = String::from_utf8_lossy(&recording);
    assert!(names.contains("recording.json") && names.contains("frames/000.png"));
    // The history is written in parallel to the cycle.
    until("result in the history", PATIENCE, || {
        let counts = browser.get("/api/history")["counts"].clone();
        match counts["pass"] == 1 {
            true => Ok(()),
            false => Err(counts),
        }
    });
    assert_eq!(
        browser.get("/api/trends")["gauges"][0]["points"][0]["seq"],
        1
    );
}

#[test]
fn the_stages_of_a_cycle_add_up_to_its_time_and_its_processing_is_that_of_the_register() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    let words = plc.measure(1);
    let result = Browser::new(&daemon).get("/api/snapshot")["result"].clone();
    let stages: Vec<(&str, u64)> = result["stages"]
        .as_array()
        .unwrap()
        .iter()
        .map(|stage| {
            (
                stage["name"].as_str().unwrap(),
                stage["us"].as_u64().unwrap(),
            )
        })
        .collect();
    let names: Vec<&str> = stages.iter().map(|stage| stage.0).collect();
    let expected = [
        "waiting",
        "exposure",
        "alignment",
        "strips",
        "judgement",
        "hand-over",
    ];
    assert_eq!(names, expected);
    let all: u64 = stages.iter().map(|stage| stage.1).sum();
    assert_eq!(all, u64::from(long(&words, 20)), "{stages:?}");
    let processing: u64 = stages[2..].iter().map(|stage| stage.1).sum();
    let register = long(&plc.read(610, 2).unwrap(), 0);
    assert_eq!(processing, u64::from(register), "{stages:?}");
    assert!(stages[2].1 > 0 && stages[3].1 > 0, "{stages:?}");
    assert!(result["cpu_us"].as_u64().unwrap() > 0, "{result}");
}
