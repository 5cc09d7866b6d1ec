//! A technician who commissions a head over the page's API.

use crate::page::Browser;
use crate::station_plc::{Daemon, pause};
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// The board, as the API takes it.
pub const BOARD: &str = "checker:9x13:10";
/// Longest time of a step.
pub const STEP: Duration = Duration::from_secs(240);

/// A technician: signed in, one request after the other.
pub struct Technician {
    pub browser: Browser,
}

impl Technician {
    pub fn sign_in(daemon: &Daemon, secret: &str) -> Self {
        let mut browser = Browser::new(daemon);
        let (status, answer) = browser.json(
            "POST",
            "/api/session",
            &json!({ "secret": secret, "time_ms": 0 }),
        );
        assert_eq!(status, 200, "{answer}");
        Self { browser }
    }

    pub fn head(&mut self) -> Value {
        self.browser.get("/api/head")
    }

    pub fn step_of(head: &Value, name: &str) -> Value {
        let steps = head["steps"].as_array().unwrap();
        let found = steps.iter().find(|step| step["name"] == name);
        found.unwrap_or_else(|| panic!("{name}: {head}")).clone()
    }

    /// Carries a step out to its end.
    pub fn step(&mut self, name: &str, body: &Value) -> Value {
        let path = format!("/api/head/steps/{name}");
        let (status, answer) = self.browser.json("POST", &path, body);
        assert_eq!(status, 202, "{name} {body}: {answer}");
        let began = Instant::now();
        loop {
            let head = self.head();
            if head["running"].is_null() {
                return Self::step_of(&head, name);
            }
            assert!(began.elapsed() < STEP, "{name}: {head}");
            pause();
        }
    }

    pub fn passes(&mut self, name: &str, body: &Value) -> Value {
        let step = self.step(name, body);
        assert_eq!(step["state"], "done", "{step}");
        step
    }

    pub fn lay(&mut self, placed: &Value) {
        let (status, answer) = self.browser.json("PUT", "/api/simulation/part", placed);
        assert_eq!(status, 200, "{placed}: {answer}");
    }

    pub fn pose(&mut self, number: u32) -> Value {
        self.lay(&json!({ "part": "board", "pose": number }));
        let body = json!({ "action": "pose", "board": BOARD, "pose": number });
        self.step("geometry", &body);
        let poses = self.head()["geometry"]["poses"].clone();
        let mut poses = poses.as_array().unwrap().iter();
        poses.find(|pose| pose["number"] == number).unwrap().clone()
    }

    pub fn looks(&mut self, show: &str) -> Value {
        let path = format!("/api/head/live?show={show}");
        let (status, png) = self.browser.ask("GET", &path, &[]);
        assert_eq!(status, 200, "{show}: {}", String::from_utf8_lossy(&png));
        let picture = png::Decoder::new(std::io::Cursor::new(png))
            .read_info()
            .unwrap();
        assert_eq!(picture.info().width, 512);
        self.browser.get("/api/head/live/figures")
    }

    /// Waits until the station is ready.
    pub fn ready(&mut self) {
        let began = Instant::now();
        loop {
            let snapshot = self.browser.get("/api/snapshot");
            if snapshot["ready"] == true {
                return;
            }
            let working = ["boot", "ready", "loading", "teaching"].map(Value::from);
            assert!(
                working.contains(&snapshot["state"]) && began.elapsed() < STEP,
                "{snapshot}"
            );
            pause();
        }
    }

    /// The result of a trigger.
    pub fn measure(&mut self) -> Value {
        let before = self.browser.get("/api/snapshot")["counters"]["sequence"].clone();
        let (status, answer) = self.browser.json("POST", "/api/trigger", &json!({}));
        assert_eq!(status, 202, "{answer}");
        let began = Instant::now();
        loop {
            let snapshot = self.browser.get("/api/snapshot");
            if snapshot["counters"]["sequence"] != before && snapshot["ready"] == true {
                return snapshot["result"].clone();
            }
            assert!(began.elapsed() < STEP, "{snapshot}");
            pause();
        }
    }
}
