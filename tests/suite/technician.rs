//! A technician who commissions a head over the page's API.

use crate::page::Browser;
use crate::station_plc::Daemon;
use serde_json::{Value, json};

/// The board, as the API takes it.
pub const BOARD: &str = "checker:9x13:10";

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

    /// Carries a step out to its end.
    pub fn step(&mut self, name: &str, body: &Value) -> Value {
        let path = format!("/api/head/steps/{name}");
        let (status, answer) = self.browser.json("POST", &path, body);
        assert_eq!(status, 202, "{name} {body}: {answer}");
        self.browser.ended(name)
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
}
