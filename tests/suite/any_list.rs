//! Lists of features and gauges at random, up to every bound and beyond: what is answered done is
//! what judges, by the page, by import and by the command, also over kills at any moment.

use crate::page::Browser;
use crate::station_plc::{Daemon, Place};
use crate::written::program;
use serde_json::{Value, json};
use std::fs;
use std::time::{Duration, Instant};
use tests::random::Random;
use tests::until::{PATIENCE, until};

/// A place, its daemon, and a browser that is signed in.
struct Bench {
    place: Place,
    /// None while it is killed.
    daemon: Option<Daemon>,
    browser: Browser,
    secret: String,
}

impl Bench {
    fn new() -> Self {
        let place = Place::taught();
        let daemon = Daemon::start(&place);
        let (_, rest) = daemon.log.split_once("shown this once: ").unwrap();
        let secret = rest.split(' ').next().unwrap().to_owned();
        let browser = Browser::new(&daemon);
        let mut bench = Self {
            place,
            daemon: Some(daemon),
            browser,
            secret,
        };
        bench.sign_in();
        bench
    }

    fn sign_in(&mut self) {
        self.browser = Browser::new(self.daemon.as_ref().unwrap());
        let body = json!({ "secret": self.secret });
        let (status, answer) = self.browser.json("POST", "/api/session", &body);
        assert_eq!(status, 200, "{answer}");
    }

    fn fingerprint(&mut self) -> String {
        let recipe = self.browser.get("/api/recipes/1");
        recipe["fingerprint"].as_str().unwrap().to_owned()
    }

    /// Waits until this version of recipe 1 judges.
    fn judges(&mut self, fingerprint: &str, how: &str) {
        until(how, 2 * PATIENCE, || {
            let snapshot = self.browser.get("/api/snapshot");
            let now = snapshot["recipe"]["fingerprint"]
                .as_str()
                .unwrap_or_default();
            let same = !now.is_empty() && fingerprint.starts_with(now);
            match snapshot["ready"] == true && same {
                true => Ok(()),
                false => Err(snapshot),
            }
        });
    }

    fn recipe(&self, arguments: &[&str]) -> tests::program::Run {
        let config = self.place.path("fringed.toml");
        let tail = ["--config", config.to_str().unwrap()];
        program().run(&[&["recipe"], arguments, &tail].concat())
    }
}

/// A name: usually plain, sometimes as long as it may be, longer, or of many bytes.
fn name(random: &mut Random, plain: &str) -> String {
    match random.below(400) {
        0 => "n".repeat(64),
        1 => "n".repeat(65),
        2 => "\u{1F600}".repeat(15 + random.below(3)),
        3 => "ä\"\\ö".repeat(8),
        4 => String::new(),
        5 => format!("{plain}\u{202e}"),
        _ => plain.to_owned(),
    }
}

/// How many of something that may be `most`: usually few, sometimes all, or one too many.
fn count(random: &mut Random, most: usize) -> usize {
    match random.below(16) {
        0 => most,
        1 => most + 1,
        2 => most / 2,
        _ => 1 + random.below(5),
    }
}

/// Features and gauges, few of which are impossible.
fn list(random: &mut Random, recipe: &Value) -> Value {
    let size = ["width", "height"].map(|side| recipe["camera"][side].as_f64().unwrap());
    let mut features = Vec::new();
    for at in 0..count(random, 96) {
        // An ellipse, so that no edge crosses another.
        let most = if random.below(12) == 0 { 255 } else { 10 };
        let corners = 3 + random.below(most);
        let reach = 4.0 + random.share() * size[0] / 4.0;
        let middle = size.map(|size| size * (0.3 + 0.4 * random.share()));
        let corner = |at: usize| {
            let (sin, cos) = (std::f64::consts::TAU * at as f64 / corners as f64).sin_cos();
            json!([middle[0] + reach * cos, middle[1] + 0.7 * reach * sin])
        };
        let region: Vec<Value> = (0..corners).map(corner).collect();
        let kind = ["surface", "surface", "surface", "plane"][random.below(4)];
        let name = name(random, &format!("feature {at}"));
        features.push(json!({ "name": name, "kind": kind, "region": region }));
    }
    let mut gauges = Vec::new();
    for at in 0..count(random, 64) {
        let feature = &features[random.below(features.len())];
        let of = json!([feature["name"]]);
        let is_surface = feature["kind"] == "surface";
        let smoothing_px = [1, 3, 9, 9, 41][random.below(5)];
        let mut gauge = match (random.below(5), is_surface) {
            (0, true) => json!({ "kind": "mean_height", "of": of }),
            (1, true) => json!({ "kind": "deviation", "of": of, "smoothing_px": smoothing_px }),
            (2, true) => json!({ "kind": "flatness", "of": of, "smoothing_px": smoothing_px }),
            (_, true) => {
                json!({ "kind": "peak_to_valley", "of": of, "smoothing_px": smoothing_px })
            }
            _ => json!({ "kind": "tilt", "of": of, "about": "x" }),
        };
        gauge["slot"] = json!(at + 1);
        gauge["name"] = json!(name(random, &format!("gauge {at}")));
        let most = if random.below(200) == 0 { 4 } else { 3 };
        gauge["high"] = json!([0.1, 1.0, 50.0, 1e6][random.below(most)]);
        gauges.push(gauge);
    }
    json!({ "name": name(random, "any"), "features": features, "gauges": gauges, "datums": [] })
}

/// Sends so many lists.
fn what_is_done_judges(rounds: usize) {
    let mut bench = Bench::new();
    let mut random = Random::new(17);
    let [mut done, mut refused, mut killed] = [0; 3];
    for round in 0..rounds {
        let before = bench.browser.get("/api/recipes/1");
        let fingerprint = before["fingerprint"].as_str().unwrap().to_owned();
        let mut edit = list(&mut random, &before);
        match random.below(10) {
            0 => {
                // Killed at any moment of an edit.
                edit["fingerprint"] = json!(fingerprint);
                let body = edit.to_string();
                let mut stream = bench.browser.begin("PUT", "/api/recipes/1", body.len());
                let _ = std::io::Write::write_all(&mut stream, body.as_bytes());
                std::thread::sleep(Duration::from_millis(random.below(400) as u64));
                bench.daemon.take().unwrap().kill();
                bench.daemon = Some(Daemon::start(&bench.place));
                bench.sign_in();
                let stored = bench.fingerprint();
                bench.judges(&stored, &format!("round {round}, after a kill"));
                killed += 1;
            }
            1 | 2 => {
                // By the command on a file, then imported.
                let file = bench.place.path("list.recipe");
                let file = file.to_str().unwrap();
                let _ = fs::remove_file(file);
                bench.recipe(&["export", "1", file]).succeeded();
                let whole = fs::read(file).unwrap();
                let text = bench.place.path("list.toml");
                fs::write(&text, toml_of(&edit)).unwrap();
                let set =
                    program().run(&["recipe", "gauges", file, "--set", text.to_str().unwrap()]);
                let is_set = set.code == 0;
                let bytes = fs::read(file).unwrap();
                assert!(is_set || bytes == whole, "round {round}: {}", set.stderr);
                let path = "/api/recipes?replace=true";
                let (status, answer) = bench.browser.ask("POST", path, &bytes);
                let answer: Value = serde_json::from_slice(&answer).unwrap();
                assert_eq!(status, 201, "round {round}, set {is_set}: {answer}");
                let stored = answer["fingerprint"].as_str().unwrap().to_owned();
                assert_eq!(bench.fingerprint(), stored);
                if answer["loading"] != true {
                    let (status, answer) =
                        bench
                            .browser
                            .json("POST", "/api/recipes/1/load", &json!({}));
                    assert!((200..300).contains(&status), "round {round}: {answer}");
                }
                bench.judges(&stored, &format!("round {round}, imported"));
                *if is_set { &mut done } else { &mut refused } += 1;
            }
            _ => {
                edit["fingerprint"] = json!(fingerprint);
                let begun = Instant::now();
                let (status, answer) = bench.browser.json("PUT", "/api/recipes/1", &edit);
                match status {
                    200 => {
                        let stored = answer["fingerprint"].as_str().unwrap().to_owned();
                        assert_eq!(bench.fingerprint(), stored);
                        bench.judges(&stored, &format!("round {round}: {answer}"));
                        done += 1;
                    }
                    400..=499 => {
                        assert!(answer["error"].is_string(), "round {round}: {answer}");
                        assert_eq!(bench.fingerprint(), fingerprint, "round {round}: {answer}");
                        refused += 1;
                    }
                    _ => panic!("round {round}: {status} {answer}"),
                }
                assert!(
                    begun.elapsed() < 2 * PATIENCE,
                    "round {round}: {:?}",
                    begun.elapsed()
                );
            }
        }
        if round % 8 == 0 {
            assert!(
                bench.browser.measure()["verdict"].is_string(),
                "round {round}"
            );
        }
    }
    println!("of {rounds} lists {done} judge, {refused} are refused, {killed} met a kill");
    assert!(done > rounds / 4 && refused > 0, "{done} {refused}");
}

/// The list as `recipe gauges --set` reads it.
fn toml_of(edit: &Value) -> String {
    let mut text = String::new();
    for (table, key) in [("feature", "features"), ("gauge", "gauges")] {
        for one in edit[key].as_array().unwrap() {
            text += &format!("\n[[{table}]]\n");
            for (key, value) in one.as_object().unwrap() {
                text += &format!("{key} = {value}\n");
            }
        }
    }
    text
}

#[test]
fn a_list_that_is_answered_done_is_what_judges() {
    what_is_done_judges(24);
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn a_thousand_lists_that_are_answered_done_are_what_judges() {
    what_is_done_judges(1000);
}
