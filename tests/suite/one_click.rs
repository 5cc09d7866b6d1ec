//! A stranger's way: the shipped program with default settings, each stock part put in front of the
//! simulated head over the API, taught with one click, and triggered by a PLC.

use crate::contours::plates;
use crate::every_part::stock;
use crate::page::Browser;
use crate::station_plc::{Daemon, Place, Plc, SMALL_HEAD};
use serde_json::{Value, json};
use sim::parts::Plate;
use sim::{Part, Placement};
use tests::random::Random;

const PASS: u16 = 1;

/// No corner of any stock part moves by more than the tolerance of 1 mm.
const ELSEWHERE: Placement = Placement {
    shift_mm: [0.4, -0.3, 0.3],
    tilt_deg: [0.06, -0.05],
    rotation_deg: 0.08,
};

/// A station with nothing but a scenario of its own.
struct Station {
    daemon: Daemon,
    browser: Browser,
    plc: Plc,
    triggers: u16,
    _place: Place,
}

impl Station {
    fn new(scenario: &str) -> Self {
        let place = Place::before(scenario);
        let daemon = Daemon::start(&place);
        let mut browser = Browser::new(&daemon);
        browser.sign_in(&daemon);
        Self {
            plc: Plc::connect(&daemon),
            daemon,
            browser,
            triggers: 0,
            _place: place,
        }
    }

    fn put(&mut self, part: &Part, placement: &Placement) {
        let placed = json!({ "part": part, "placement": placement });
        let (status, answer) = self.browser.json("PUT", "/api/simulation/part", &placed);
        assert_eq!(status, 200, "{answer}");
    }

    fn teach(&mut self, number: usize) {
        self.teach_asking(number, &json!({}));
    }

    fn teach_asking(&mut self, number: usize, wanted: &Value) {
        let before = self.browser.get("/api/snapshot")["recipe"]["fingerprint"].clone();
        let path = format!("/api/recipes/{number}/teach");
        let (status, answer) = self.browser.json("POST", &path, wanted);
        assert_eq!(status, 202, "{answer}");
        self.browser.wait_for_another(before.as_str().unwrap());
    }

    /// Triggers, and says what is wrong if the part does not pass.
    fn passes(&mut self) -> Result<(), String> {
        self.triggers += 1;
        match self.plc.measure(self.triggers)[8] {
            PASS => Ok(()),
            _ => Err(self.browser.get("/api/snapshot")["result"].to_string()),
        }
    }
}

/// Teaches each stock part and triggers it so many times as it lies, and once elsewhere.
fn good_parts_pass(still: usize, scenario: &str) {
    let mut station = Station::new(scenario);
    let mut refused = Vec::new();
    for (number, (kind, part)) in (2..).zip(stock()) {
        station.put(&part, &Placement::default());
        station.teach(number);
        let mut verdicts: Vec<_> = (0..still).map(|_| station.passes()).collect();
        station.put(&part, &ELSEWHERE);
        verdicts.push(station.passes());
        let wrong: Vec<String> = verdicts.into_iter().filter_map(Result::err).collect();
        println!(
            "{kind:12} taught with one click: {} of {} PASS",
            still + 1 - wrong.len(),
            still + 1
        );
        refused.extend(wrong.into_iter().map(|words| format!("{kind}: {words}")));
    }
    assert!(refused.is_empty(), "{}", refused.join("\n"));
    drop(station.daemon);
}

#[test]
fn every_stock_part_that_is_taught_with_one_click_passes() {
    good_parts_pass(1, "sub_rays = 2\n[rig.camera]\nwidth = 256\nheight = 256\n");
}

#[test]
fn the_limit_that_is_asked_for_is_the_recipe_s_and_stays_with_the_number() {
    let mut station = Station::new(SMALL_HEAD);
    let limit =
        |station: &mut Station| station.browser.get("/api/recipes/2")["gauges"][0]["high"].clone();
    station.teach_asking(2, &json!({ "limit_mm": 0.3 }));
    assert_eq!(limit(&mut station), 0.3);
    station.teach_asking(2, &json!({ "replace": true }));
    assert_eq!(limit(&mut station), 0.3);
    for refused in [0.0, -1.0, 1e9] {
        let wanted = json!({ "replace": true, "limit_mm": refused });
        let (status, answer) = station
            .browser
            .json("POST", "/api/recipes/2/teach", &wanted);
        assert_eq!(status, 422, "{answer}");
        assert!(answer.to_string().contains("limit_mm"), "{answer}");
    }
    assert!(station.passes().is_ok());
}

/// Plates with rims that nobody states, taught with one click and triggered in so many places.
fn plates_with_rims_pass(rims_mm: &[f64], placements: usize, scenario: &str) {
    let mut station = Station::new(scenario);
    let mut random = Random::new(3);
    let (mut count, mut refused) = (0, Vec::new());
    for (number, &rim_mm) in (2..).zip(rims_mm) {
        let part = Part::Plate(Plate {
            rim_mm,
            thickness_mm: 1.5,
            ..plates::plate()
        });
        station.put(&part, &Placement::default());
        station.teach(number);
        for _ in 0..placements {
            let mut share = || 2.0 * random.share() - 1.0;
            // No corner moves by more than the tolerance of 1 mm.
            let lies = Placement {
                shift_mm: [share(), share(), share()].map(|share| 0.4 * share),
                tilt_deg: [share(), share()].map(|share| 0.12 * share),
                rotation_deg: 0.12 * share(),
            };
            station.put(&part, &lies);
            count += 1;
            if let Err(words) = station.passes() {
                refused.push(format!("rims of {rim_mm} mm: {words}"));
            }
        }
    }
    println!(
        "{} of {count} good plates with rims PASS",
        count - refused.len()
    );
    assert!(refused.is_empty(), "{}", refused.join("\n"));
    drop(station.daemon);
}

#[test]
fn plates_with_rims_pass_that_are_taught_with_one_click() {
    let small = "sub_rays = 2\n[rig.camera]\nwidth = 256\nheight = 256\n";
    plates_with_rims_pass(&[0.2], 3, small);
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn fifty_plates_of_every_rim_pass_that_are_taught_with_one_click() {
    plates_with_rims_pass(&[0.0, 0.1, 0.2, 0.3], 50, "");
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn every_stock_part_that_is_taught_with_one_click_passes_twenty_times() {
    good_parts_pass(20, "");
}
