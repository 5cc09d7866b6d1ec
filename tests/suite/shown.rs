//! The picture of the deviation shows what the gauge has judged, live and from the history: its
//! largest square is the gauge's value, and lies where the defect is.

use crate::gauges::frames;
use crate::history::recording;
use crate::page::Browser;
use crate::placement::{bed, scenario, taught, with_two_frames};
use crate::station_plc::{Daemon, Place, Plc, long};
use appliance::recipe::Recipe;
use appliance::recipe::plan::Plan;
use serde_json::{Value, json};
use sim::parts::{Defect, Flowerpot, SheetMetal};
use sim::{Part, Placement, Stage};
use std::io::Read as _;
use std::time::Instant;
use tests::random::Random;

const PASS: u16 = 1;
const FAIL: u16 = 2;
/// A head of a quarter of the study's pixels in each direction.
const HEAD: &str = "sub_rays = 2\n\n[rig.camera]\nwidth = 256\nheight = 256\n";
/// Largest difference of the picture's largest square from the gauge's value, mm.
const SAME_MM: f64 = 0.001;
/// Largest distance of the square's middle from the middle of the dent, pixels. The top of the mean
/// over 9 pixels is flat, and noise decides where on it the largest is.
const NEAR_PX: f64 = 4.0;
/// How far the part is moved, mm, and turned, degrees: at its corners it then moves by less than
/// the tolerance of 1 mm.
const SHIFT_MM: f64 = 0.6;
const TURN_DEG: f64 = 0.1;
const DEPTH_MM: f64 = 0.5;
const DIAMETER_MM: f64 = 14.0;

/// A picture: its description, and its values, NaN where there is none.
fn picture(browser: &Browser, path: &str) -> (Value, Vec<f64>) {
    let mut answer = Vec::new();
    let mut stream = browser.begin("GET", path, 0);
    stream.read_to_end(&mut answer).unwrap();
    let end = answer.windows(4).position(|four| four == b"\r\n\r\n");
    let (head, body) = answer.split_at(end.unwrap() + 4);
    let head = str::from_utf8(head).unwrap();
    assert!(head.starts_with("HTTP/1.1 200"), "{path}: {head}");
    let about = head.lines().find_map(|line| line.strip_prefix("x-map: "));
    let about: Value = serde_json::from_str(about.unwrap()).unwrap();
    let number = |key: &str| about[key].as_f64().unwrap();
    let (low, step) = (number("low"), number("step"));
    let words = body.chunks_exact(2);
    let values = words.map(|word| match u16::from_le_bytes([word[0], word[1]]) {
        u16::MAX => f64::NAN,
        word => low + step * f64::from(word),
    });
    let values = values.collect();
    (about, values)
}

/// Column, row and value of the largest deviation of a picture.
fn largest(about: &Value, values: &[f64]) -> (f64, f64, f64) {
    let known = values.iter().enumerate().filter(|(_, mm)| mm.is_finite());
    let (at, mm) = known
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
        .unwrap();
    let number = |key: &str| about[key].as_u64().unwrap() as usize;
    let (width, stride) = (number("width"), number("stride"));
    let [column, row] = [at % width, at / width].map(|at| (at * stride) as f64);
    (column, row, *mm)
}

/// Teaches a part that lies in front of a small head as it should.
struct Line {
    place: Place,
    daemon: Daemon,
    browser: Browser,
    plc: Plc,
    token: u16,
    /// The same part, to know where its dent is.
    stage: Stage,
    pot: bool,
}

impl Line {
    fn of(kind: &str) -> Self {
        let pot = kind == "flowerpot";
        let place = Place::taught_before(&format!("{HEAD}\n[part]\nkind = \"{kind}\"\n"));
        let daemon = Daemon::start(&place);
        let mut browser = Browser::new(&daemon);
        browser.sign_in(&daemon);
        Self {
            plc: Plc::connect(&daemon),
            token: 0,
            stage: bed(&scenario(part(pot, Vec::new()))).stage,
            place,
            daemon,
            browser,
            pot,
        }
    }

    /// Puts a part in front of the head and triggers; returns VERDICT and SEQ.
    fn measure(&mut self, part: &Part, placement: &Placement) -> (u16, u32) {
        let placed = json!({ "part": part, "placement": placement });
        let (status, answer) = self.browser.json("PUT", "/api/simulation/part", &placed);
        assert_eq!(status, 200, "{answer}");
        self.token += 1;
        let words = self.plc.measure(self.token);
        (words[8], long(&words, 0))
    }

    /// Where the middle of a dent is seen, by the heights that the simulator knows.
    fn seen(&self, dented: &Part, placement: &Placement) -> (f64, f64) {
        let heights = |part: &Part| {
            self.stage.place(part, placement).unwrap();
            self.stage.truth().height
        };
        let (with, without) = (heights(dented), heights(&part(self.pot, Vec::new())));
        let (mut sums, mut weight) = ((0.0, 0.0), 0.0);
        for (at, (with, without)) in with.iter().zip(&without).enumerate() {
            let drop = f64::from((with - without).abs());
            if drop > 0.02 {
                sums.0 += drop * (at % 256) as f64;
                sums.1 += drop * (at / 256) as f64;
                weight += drop;
            }
        }
        (sums.0 / weight, sums.1 / weight)
    }

    /// A dented part that lies so: the picture's largest square is the gauge's, live and from the
    /// history, and lies in the dent.
    fn shows_the_dent(&mut self, (x, y): (f64, f64), placement: &Placement) -> f64 {
        let dented = part(self.pot, vec![dent(x, y, DEPTH_MM)]);
        let (verdict, seq) = self.measure(&dented, placement);
        let result = self.browser.get("/api/snapshot")["result"].clone();
        let gauge = result["gauges"][0].clone();
        assert_eq!(verdict, FAIL, "{result}");
        assert_eq!(gauge["name"], "deviation");
        let (about, values) = picture(&self.browser, "/api/picture/deviation");
        let (column, row, mm) = largest(&about, &values);
        let value = gauge["value"].as_f64().unwrap();
        assert!((mm - value).abs() < SAME_MM, "{mm} in the picture, {gauge}");
        let square = &gauge["square"];
        let place = |key: &str| square[key].as_f64().unwrap();
        assert_eq!((place("column"), place("row")), (column, row), "{gauge}");
        // Everything that the page needs comes with the picture.
        let shown = &about["shown"];
        assert_eq!(shown["gauge"]["square"], *square);
        assert_eq!(shown["gauge"]["value"], gauge["value"]);
        assert_eq!(shown["side"], square["side"]);
        assert_eq!(shown["motion_taken_back"], true);
        let high = gauge["highest"].as_f64().unwrap();
        assert_eq!(about["scale"], json!([-2.0 * high, 2.0 * high]));
        let words = about["words"].as_str().unwrap();
        assert!(words.contains("motion taken back, mean over"), "{words}");

        recording(&self.place, seq);
        let kept = format!("/api/history/{seq}/picture/deviation");
        let (kept, again) = picture(&self.browser, &kept);
        assert_eq!(kept, about);
        let bits = |values: &[f64]| values.iter().map(|mm| mm.to_bits()).collect::<Vec<_>>();
        assert!(bits(&again) == bits(&values), "another picture");
        let stored = self.browser.get(&format!("/api/history/{seq}"));
        assert_eq!(stored["result"]["gauges"][0]["square"], *square);

        let (u, v) = self.seen(&dented, placement);
        (column - u).hypot(row - v)
    }

    /// So many dented parts, displaced in all six components.
    fn shows_dents(&mut self, places: &[(f64, f64)], parts: usize, seed: u64) {
        let mut random = Random::new(seed);
        let mut farthest = 0.0_f64;
        for at in 0..parts {
            let mut between = |reach: f64| reach * (2.0 * random.share() - 1.0);
            let placement = Placement {
                shift_mm: [(); 3].map(|()| between(SHIFT_MM / 3.0_f64.sqrt())),
                tilt_deg: [(); 2].map(|()| between(TURN_DEG)),
                rotation_deg: between(TURN_DEG),
            };
            let away = self.shows_the_dent(places[at % places.len()], &placement);
            assert!(away < NEAR_PX, "{away} px off the dent: {placement:?}");
            farthest = farthest.max(away);
        }
        println!("{parts} parts: at most {farthest:.2} px off the dent");
    }
}

fn dent(x: f64, y: f64, depth_mm: f64) -> Defect {
    Defect::Dent {
        x,
        y,
        depth_mm,
        diameter_mm: DIAMETER_MM,
    }
}

fn part(pot: bool, defects: Vec<Defect>) -> Part {
    match pot {
        true => Part::Flowerpot(Flowerpot {
            defects,
            ..Flowerpot::default()
        }),
        false => Part::SheetMetal(SheetMetal {
            defects,
            ..Default::default()
        }),
    }
}

/// Places of dents that both devices see.
const ON_SHEET_METAL: [(f64, f64); 3] = [(0.0, -8.0), (-30.0, 8.0), (10.0, 20.0)];
const ON_THE_POT: [(f64, f64); 2] = [(0.0, 80.0), (0.0, -80.0)];

#[test]
fn the_picture_of_a_displaced_part_has_its_largest_square_where_and_as_large_as_the_gauge() {
    Line::of("sheet_metal").shows_dents(&ON_SHEET_METAL, 2, 1);
}

#[test]
#[ignore = "takes two minutes: `.ci/run full`"]
fn the_pictures_of_fifty_displaced_parts_have_their_largest_squares_where_and_as_large_as_the_gauge()
 {
    Line::of("sheet_metal").shows_dents(&ON_SHEET_METAL, 25, 3);
    Line::of("flowerpot").shows_dents(&ON_THE_POT, 25, 4);
}

#[test]
fn the_map_of_square_means_has_the_reading_of_the_gauge_at_its_place() {
    let mut bed = bed(&scenario(part(false, Vec::new())));
    let taught = with_two_frames(taught(&mut bed).unwrap());
    let recipe = Recipe::from_bytes(&taught.bytes).unwrap();
    let plan = Plan::new(recipe, &bed.calibration, true).unwrap();
    bed.head
        .load(plan.rasters(&bed.calibration).unwrap())
        .unwrap();
    let moved = Placement {
        shift_mm: [0.4, -0.3, 0.3],
        tilt_deg: [0.1, 0.0],
        rotation_deg: 0.1,
    };
    for (defects, placement) in [
        (vec![dent(0.0, -8.0, DEPTH_MM)], &moved),
        (Vec::new(), &moved),
        (Vec::new(), &Placement::default()),
    ] {
        bed.stage.place(&part(false, defects), placement).unwrap();
        for sequence in 0..plan.sequence_count() {
            let frames = frames(&mut bed, &plan, sequence);
            let inspection = plan.inspect(sequence, &frames, Instant::now());
            let gauge = &inspection.gauges[0];
            let (value, square) = (gauge.value.unwrap(), gauge.square.unwrap());
            let layers = plan.layers(sequence, &frames).unwrap();
            let shown = layers.shown.gauge.as_ref().unwrap();
            assert_eq!((shown.value, shown.square), (gauge.value, gauge.square));
            let map = &layers.deviation_mm;
            let here = map[square.row as usize * layers.width + square.column as usize];
            let largest = map.iter().filter(|mm| mm.is_finite());
            let largest = largest.map(|mm| mm.abs()).fold(0.0, f32::max);
            // Single precision.
            assert!(
                (f64::from(here) - value).abs() < 1e-6,
                "sequence {sequence}: {here}, {gauge:?}"
            );
            assert!(
                (f64::from(largest) - value.abs()).abs() < 1e-6,
                "sequence {sequence}: {largest}, {gauge:?}"
            );
        }
    }
}

#[test]
fn the_motion_of_a_good_part_is_not_in_its_picture_and_heights_stay_as_measured() {
    let mut line = Line::of("sheet_metal");
    let lifted = Placement {
        shift_mm: [0.0, 0.0, 0.9],
        ..Placement::default()
    };
    let good = part(false, Vec::new());
    assert_eq!(line.measure(&good, &Placement::default()).0, PASS);
    let (_, before) = picture(&line.browser, "/api/picture/height");
    assert_eq!(line.measure(&good, &lifted).0, PASS);
    let (about, values) = picture(&line.browser, "/api/picture/deviation");
    let (.., mm) = largest(&about, &values);
    assert!(mm.abs() < 0.1, "{mm}");
    let (about, heights) = picture(&line.browser, "/api/picture/height");
    assert!(about["shown"].is_null(), "{about}");
    let mut lifts: Vec<f64> = heights.iter().zip(&before).map(|(a, b)| a - b).collect();
    lifts.retain(|mm| mm.is_finite());
    lifts.sort_by(f64::total_cmp);
    let median = lifts[lifts.len() / 2];
    assert!((median - 0.9).abs() < 0.05, "{median}");
    // Fewer pixels are compared than have a height: edges are left open.
    let count = |values: &[f64]| values.iter().filter(|mm| mm.is_finite()).count();
    assert!((1000..count(&heights)).contains(&count(&values)));
}

#[test]
fn a_recipe_without_a_gauge_of_the_deviation_still_has_a_picture_that_says_what_it_shows() {
    let mut line = Line::of("sheet_metal");
    let recipe = line.browser.get("/api/recipes/1");
    let mut gauges = recipe["gauges"].clone();
    let is_deviation = |gauge: &Value| gauge["kind"] == "deviation";
    gauges
        .as_array_mut()
        .unwrap()
        .retain(|gauge| !is_deviation(gauge));
    let edit = json!({ "fingerprint": recipe["fingerprint"], "gauges": gauges });
    let (status, answer) = line.browser.json("PUT", "/api/recipes/1", &edit);
    assert_eq!(status, 200, "{answer}");
    let before = recipe["fingerprint"].as_str().unwrap().to_owned();
    line.browser.wait_for_another(&before);
    let dented = part(false, vec![dent(0.0, -8.0, DEPTH_MM)]);
    line.measure(&dented, &Placement::default());
    let (about, values) = picture(&line.browser, "/api/picture/deviation");
    assert!(about["shown"]["gauge"].is_null(), "{about}");
    assert_eq!(about["shown"]["side"], 1);
    let words = about["words"].as_str().unwrap();
    assert!(
        words.contains("pixel by pixel; no gauge of this recipe measures it"),
        "{words}"
    );
    let (.., mm) = largest(&about, &values);
    assert!((-0.8..-0.4).contains(&mm), "{mm}");
    assert!(line.daemon.terminate().success());
}
