//! Edits that are tried before they are stored, on the shipped program: a plate with its holes as it
//! was taught, the last part and a kept one. And what can be drawn of parts.

mod beside;

use crate::kept::kept_failure;
use crate::page::Browser;
use crate::station_plc::{Daemon, Place, Plc, long};
use crate::written::program;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

const TRY: &str = "/api/recipes/1/try";
/// Where the part lies that is measured, mm along x.
const SHIFT: f64 = 0.8;

/// A place whose recipe is of a plate with holes.
fn place_with_a_plate() -> Place {
    Place::taught_before("[part]\nkind = \"plate\"\n")
}

/// The list of a recipe with a diameter, a distance and a feature that no gauge is of.
fn list(recipe: &Value) -> Value {
    let mut edit = json!({ "datums": recipe["datums"] });
    for key in ["fingerprint", "features", "gauges"] {
        edit[key] = recipe[key].clone();
    }
    let circles = edit["features"].as_array().unwrap().iter();
    let circles = circles.filter(|of| of["kind"] == "circle");
    let circles: Vec<Value> = circles.map(|of| of["name"].clone()).collect();
    let spare = json!({
        "name": "spare", "kind": "circle", "region": edit["features"].as_array().unwrap().iter()
            .find(|of| of["name"] == circles[0]).unwrap()["region"],
    });
    edit["features"].as_array_mut().unwrap().push(spare);
    edit["gauges"].as_array_mut().unwrap().extend([
        json!({
            "slot": 40, "name": "diameter", "kind": "diameter", "of": [circles[0]],
            "golden": true, "plus": 0.05, "minus": 0.05,
        }),
        json!({
            "slot": 41, "name": "apart", "kind": "distance", "of": [circles[0], circles[1]],
            "golden": true, "plus": 0.2, "minus": 0.2,
        }),
    ]);
    edit
}

/// Every file below a folder, with its bytes.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => all.extend(files(&path)),
            false => {
                all.insert(path.display().to_string(), fs::read(&path).unwrap());
            }
        }
    }
    all
}

fn named<'a>(all: &'a Value, name: &str) -> &'a Value {
    let mut all = all.as_array().unwrap().iter();
    all.find(|of| of["name"] == name).unwrap()
}

/// What `recipe gauges --set` prints for a list.
fn set(place: &Place, file: &[u8], edit: &Value) -> Value {
    let [recipe, text] = ["copy.recipe", "gauges.toml"].map(|name| place.path(name));
    fs::write(&recipe, file).unwrap();
    let mut toml = String::new();
    for (table, list) in [
        ("feature", "features"),
        ("datum", "datums"),
        ("gauge", "gauges"),
    ] {
        for element in edit[list].as_array().unwrap() {
            toml += &format!("[[{table}]]\n");
            for (key, value) in element.as_object().unwrap() {
                toml += &format!("{key} = {value}\n");
            }
        }
    }
    fs::write(&text, toml).unwrap();
    let [recipe, text] = [recipe, text].map(|path| path.to_str().unwrap().to_owned());
    let run = program().run(&["recipe", "gauges", &recipe, "--set", &text, "--json"]);
    serde_json::from_str(&run.succeeded().stdout).unwrap()
}

#[test]
fn a_try_reads_what_the_stored_list_reads_bit_by_bit_and_changes_nothing() {
    let place = place_with_a_plate();
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    browser.sign_in(&daemon);
    let recipe = browser.get("/api/recipes/1");
    let (_, file) = browser.ask("GET", "/api/recipes/1/file", &[]);
    let edit = list(&recipe);
    let state = ["state/recipes", "state/access"].map(|name| place.path(name));
    let before = state.each_ref().map(|folder| files(folder));
    let (status, tried) = browser.json("POST", TRY, &edit);
    assert_eq!(status, 200, "{tried}");
    assert_eq!(tried["problems"], json!([]));
    assert!(before == state.each_ref().map(|folder| files(folder)));
    assert_eq!(browser.get("/api/history")["results"], json!([]));

    let stored = set(&place, &file, &edit);
    let gauges = tried["gauges"].as_array().unwrap();
    assert_eq!(gauges.len(), edit["gauges"].as_array().unwrap().len());
    for (tried, stored) in gauges.iter().zip(stored["gauges"].as_array().unwrap()) {
        for key in [
            "slot", "name", "unit", "value", "sigma", "low", "high", "reason",
        ] {
            assert_eq!(tried[key], stored[key], "{key}");
        }
        assert_eq!(tried["u"], stored["uncertainty"]);
        assert!(tried["value"].is_f64(), "{tried}");
    }
    let own = tried["features"].as_array().unwrap().iter();
    let own: Vec<&Value> = own.filter(|of| of["name"] != "spare").collect();
    let set = stored["features"].as_array().unwrap();
    assert_eq!(own, set.iter().collect::<Vec<_>>());

    // The feature that no gauge is of is found where the other one is.
    let [spare, circle] = [
        named(&tried["features"], "spare"),
        own.iter().find(|of| of["kind"] == "circle").unwrap(),
    ];
    assert_eq!(
        (&spare["state"], &spare["fit"]["radius_mm"]),
        (&"found".into(), &circle["fit"]["radius_mm"])
    );
    let pieces = circle["pieces"].as_array().unwrap();
    let accepted = pieces.iter().filter(|of| of["accepted"] == true);
    let share = accepted.clone().count() as f64 / pieces.len() as f64;
    assert_eq!(circle["found"].as_f64().unwrap(), share);
    let number = |of: &Value| of.as_f64().unwrap();
    let [u, v] = [0, 1].map(|at| number(&circle["fit"]["centre"][at]));
    let outline = circle["fit"]["outline"].as_array().unwrap();
    let away = |of: &Value| (number(&of[0]) - u).hypot(number(&of[1]) - v);
    let (least, most) = outline
        .iter()
        .fold((f64::MAX, 0.0_f64), |(least, most), at| {
            (least.min(away(at)), most.max(away(at)))
        });
    for piece in accepted {
        let away = away(&piece["at"]);
        assert!(
            least - 0.5 < away && away < most + 0.5,
            "{least} {away} {most}"
        );
    }
}

#[test]
fn a_list_is_tried_on_the_last_part_and_on_a_kept_one_as_replay_judges_them() {
    let place = place_with_a_plate();
    let defect = "[part]\nkind = \"plate\"\ndefects = [{ kind = \"dent\", x = 0.0, y = -8.0, depth_mm = 0.9, diameter_mm = 14.0 }]\n";
    let lies = format!("[placement]\nshift_mm = [{SHIFT}, 0.0, 0.0]\n");
    fs::write(place.path("small.toml"), format!("{defect}{lies}")).unwrap();
    let (daemon, seq, folder) = kept_failure(&place);
    let mut browser = Browser::new(&daemon);
    browser.sign_in(&daemon);

    let recipe = browser.get("/api/recipes/1");
    let (_, file) = browser.ask("GET", "/api/recipes/1/file", &[]);
    let mut edit = list(&recipe);
    edit["on"] = "last".into();
    let (status, last) = browser.json("POST", TRY, &edit);
    assert_eq!(status, 200, "{last}");
    edit["on"] = json!([seq, seq + 1]);
    let (_, kept) = browser.json("POST", TRY, &edit);
    let part = &kept["parts"][0];
    assert_eq!(
        (&part["seq"], &part["before"]),
        (&seq.into(), &"FAIL".into())
    );
    assert_eq!(part["error"], Value::Null);
    assert_eq!(*part, last["parts"][0], "both are of the same frames");
    assert!(kept["parts"][1]["error"].is_string());

    // The stored list, and the command.
    edit.as_object_mut().unwrap().remove("on");
    set(&place, &file, &edit);
    let [folder, copy] =
        [folder, place.path("copy.recipe")].map(|path| path.to_str().unwrap().to_owned());
    let run = program().run(&["replay", &folder, "--recipe", &copy, "--json"]);
    let replayed: Value = serde_json::from_str(&run.succeeded().stdout).unwrap();
    let replayed = &replayed["replayed"];
    assert_eq!(part["verdict"], replayed["verdict"]);
    for (tried, stored) in part["gauges"]
        .as_array()
        .unwrap()
        .iter()
        .zip(replayed["gauges"].as_array().unwrap())
    {
        for key in ["slot", "value", "sigma", "decision"] {
            assert_eq!(tried[key], stored[key], "{key} of {tried}");
        }
    }
    assert_eq!(part["features"], replayed["features"]);

    // What was found is drawn where the part lies.
    let [of_last, of_kept] = [
        "/api/last/features",
        &format!("/api/history/{seq}/features"),
    ]
    .map(|path| browser.get(path));
    assert_eq!(of_last, of_kept);
    assert_eq!(
        (&of_last["seq"], &of_last["verdict"]),
        (&seq.into(), &"FAIL".into())
    );
    let (_, golden) = browser.json("POST", TRY, &edit);
    let column = |all: &Value| {
        let mut all = all["features"].as_array().unwrap().iter();
        let circle = all.find(|of| of["kind"] == "circle").unwrap();
        circle["fit"]["centre"][0].as_f64().unwrap()
    };
    let surface = header(&browser, "/api/recipes/1/picture/surface?level=1");
    let moved = (column(&of_last) - column(&golden)) * surface["pixel_mm"].as_f64().unwrap();
    assert!((moved.abs() - SHIFT).abs() < 0.05, "{moved} mm");
}

/// The description of a picture.
fn header(browser: &Browser, path: &str) -> Value {
    described(browser, path).0
}

/// A picture with its description.
fn described(browser: &Browser, path: &str) -> (Value, Vec<u8>) {
    use std::io::Read as _;
    let mut answer = Vec::new();
    browser
        .begin("GET", path, 0)
        .read_to_end(&mut answer)
        .unwrap();
    let end = answer
        .windows(4)
        .position(|four| four == b"\r\n\r\n")
        .unwrap();
    let head = String::from_utf8_lossy(&answer[..end]).into_owned();
    let map = head.lines().find_map(|line| line.strip_prefix("x-map: "));
    let map = map.unwrap_or_else(|| panic!("{path}: {head}"));
    (
        serde_json::from_str(map).unwrap(),
        answer[end + 4..].to_vec(),
    )
}

/// The values of a plane of a surface; none where there is no value.
fn plane(map: &Value, words: &[u8], name: &str) -> Vec<Option<f64>> {
    let planes = map["planes"].as_array().unwrap();
    let at = planes.iter().position(|of| of["name"] == name).unwrap();
    let [width, height] = ["width", "height"].map(|key| map[key].as_u64().unwrap() as usize);
    assert_eq!(words.len(), 2 * planes.len() * width * height);
    let [low, step] = ["low", "step"].map(|key| planes[at][key].as_f64().unwrap());
    let words = words.chunks(2 * width * height).nth(at).unwrap();
    let value = |pair: &[u8]| match u16::from_le_bytes([pair[0], pair[1]]) {
        u16::MAX => None,
        word => Some(low + step * f64::from(word)),
    };
    words.chunks(2).map(value).collect()
}

#[test]
fn a_surface_has_the_points_of_golden_and_of_parts_at_any_level() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    let (status, _) = browser.ask("GET", "/api/picture/surface", &[]);
    assert_eq!(status, 204);
    let seq = long(&Plc::connect(&daemon).measure(9), 0);
    for path in ["/api/picture/surface", "/api/recipes/1/picture/surface"] {
        let (fine, all) = described(&browser, path);
        let (coarse, some) = described(&browser, &format!("{path}?level=2"));
        assert_eq!((&fine["stride"], &coarse["stride"]), (&1.into(), &4.into()));
        let width = fine["width"].as_u64().unwrap() as usize;
        let columns = coarse["width"].as_u64().unwrap() as usize;
        for name in ["x", "y", "z"] {
            let (fine, coarse) = (plane(&fine, &all, name), plane(&coarse, &some, name));
            for (at, value) in coarse.iter().enumerate() {
                let place = at / columns * 4 * width + at % columns * 4;
                match (value, fine[place]) {
                    (None, None) => {}
                    // 65534 steps over some 100 mm.
                    (Some(one), Some(other)) => assert!((one - other).abs() < 0.01, "{name} {at}"),
                    other => panic!("{name} {at}: {other:?}"),
                }
            }
        }
        // Neighbours in a row are a pixel apart.
        let golden = header(&browser, "/api/recipes/1/picture/height");
        let pixel = golden["pixel_mm"].as_f64().unwrap();
        let x = plane(&fine, &all, "x");
        let middle = x.len() / 2 + width / 2;
        let apart = (x[middle].unwrap() - x[middle + 4].unwrap()).abs() / 4.0;
        assert!((apart / pixel - 1.0).abs() < 0.1, "{apart} of {pixel}");
        let names = fine["planes"].as_array().unwrap();
        let of_part = names.iter().any(|of| of["name"] == "deviation");
        assert_eq!(of_part, fine["seq"] == seq);
    }
    let (status, _) = browser.ask("GET", "/api/picture/surface?level=6", &[]);
    assert_eq!(status, 422);
}

#[test]
fn an_editor_is_told_that_another_one_has_stored_and_its_older_try_gives_way_to_a_newer() {
    let place = place_with_a_plate();
    let daemon = Daemon::start(&place);
    let mut editors = [(); 2].map(|()| {
        let mut browser = Browser::new(&daemon);
        browser.sign_in(&daemon);
        browser
    });
    let edit = list(&editors[0].get("/api/recipes/1"));
    // Each session has its own: neither ends the other's.
    let [first, second] = &mut editors;
    std::thread::scope(|scope| {
        let other = scope.spawn(|| second.json("POST", TRY, &edit).0);
        assert_eq!(first.json("POST", TRY, &edit).0, 200);
        assert_eq!(other.join().unwrap(), 200);
    });
    // Requests of one session, faster than they can be answered: the last is.
    let body = edit.to_string();
    let sent: Vec<_> = (0..4)
        .map(|_| {
            use std::io::Write as _;
            let mut stream = first.begin("POST", TRY, body.len());
            stream.write_all(body.as_bytes()).unwrap();
            stream
        })
        .collect();
    let answers = sent.into_iter().map(|mut stream| {
        use std::io::Read as _;
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    });
    let answers: Vec<String> = answers.collect();
    let done = answers.iter().filter(|of| of.starts_with("HTTP/1.1 200"));
    let superseded = answers
        .iter()
        .filter(|of| of.contains("\"why\":\"superseded\""));
    assert_eq!(done.clone().count() + superseded.clone().count(), 4);
    assert!(done.count() >= 1 && superseded.count() >= 1, "{answers:?}");

    let stored = json!({ "fingerprint": edit["fingerprint"], "name": "another" });
    assert_eq!(second.json("PUT", "/api/recipes/1", &stored).0, 200);
    let (status, outdated) = first.json("POST", TRY, &edit);
    assert_eq!((status, &outdated["why"]), (409, &"outdated".into()));
    let now = first.get("/api/recipes/1");
    assert_eq!(outdated["fingerprint"], now["fingerprint"]);
    let mut edit = edit;
    edit["fingerprint"] = now["fingerprint"].clone();
    assert_eq!(first.json("POST", TRY, &edit).0, 200);
}

#[test]
fn a_hole_that_golden_does_not_have_is_named_and_the_rest_is_measured() {
    let place = place_with_a_plate();
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    browser.sign_in(&daemon);
    let mut edit = list(&browser.get("/api/recipes/1"));
    // About a middle between two holes, where there is none.
    let (_, tried) = browser.json("POST", TRY, &edit);
    let circles = tried["features"].as_array().unwrap().iter();
    let centres = circles.filter(|of| of["kind"] == "circle").take(2);
    let centres: Vec<[f64; 2]> = centres
        .map(|of| serde_json::from_value(of["fit"]["centre"].clone()).unwrap())
        .collect();
    let [u, v] = [0, 1].map(|at| (centres[0][at] + centres[1][at]) / 2.0);
    let region = json!([
        [u - 8.0, v - 8.0],
        [u + 8.0, v - 8.0],
        [u + 8.0, v + 8.0],
        [u - 8.0, v + 8.0]
    ]);
    let closed = json!({ "name": "closed", "kind": "circle", "region": region });
    edit["features"].as_array_mut().unwrap().push(closed);
    // Without a gauge it may be stored, and is a warning; with one it may not.
    for refused in [false, true] {
        if refused {
            let gauge = json!({ "slot": 50, "name": "none", "kind": "diameter", "of": ["closed"], "low": 1.0, "high": 9.0 });
            edit["gauges"].as_array_mut().unwrap().push(gauge);
        }
        let (_, now) = browser.json("POST", TRY, &edit);
        let problems = now["problems"].as_array().unwrap();
        assert_eq!(problems.len(), 1, "{problems:?}");
        assert_eq!(
            (&problems[0]["feature"], &problems[0]["refused"]),
            (&"closed".into(), &refused.into())
        );
        assert_eq!(now["gauges"], tried["gauges"]);
    }
    let (status, error) = browser.json("PUT", "/api/recipes/1", &edit);
    assert_eq!(status, 422);
    let words = error["error"].as_str().unwrap().to_owned();
    let (_, now) = browser.json("POST", TRY, &edit);
    assert!(
        words.contains(now["problems"][0]["words"].as_str().unwrap()),
        "{words}"
    );
}
