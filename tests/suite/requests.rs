//! What programs ask by the API: triggers by a token, and maps as arrays.

use crate::history::place_with_a_dent;
use crate::page::{Browser, signed_in};
use crate::station_plc::Daemon;
use appliance::storage::archive::Members;
use hal::npy::{self, Array};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::Cursor;
use tests::files;
use tests::until::{PATIENCE, until};

/// Triggers with this order; the result.
#[track_caller]
fn triggered(browser: &mut Browser, order: &Value) -> Value {
    let (status, answer) = browser.json("POST", "/api/trigger", order);
    assert_eq!(status, 200, "{answer}");
    answer["result"].clone()
}

#[test]
fn a_token_has_one_result_however_often_it_comes_and_after_a_kill() {
    let (place, daemon, mut browser) = signed_in();
    browser.ready();
    let order = json!({ "token": "a-1", "part_id": 4711, "press_stroke": 9, "recipe": 1 });
    let first = triggered(&mut browser, &order);
    assert_eq!(
        (&first["part_id"], &first["press_stroke"], &first["request"]),
        (&json!(4711), &json!(9), &json!("a-1"))
    );
    // Other keys of a repeated request change nothing.
    let again = json!({ "token": "a-1", "part_id": 5 });
    assert_eq!(triggered(&mut browser, &again), first);
    let other = triggered(&mut browser, &json!({ "token": "a-2" }));
    assert_eq!((&other["seq"], &other["part_id"]), (&json!(2), &json!(0)));
    daemon.kill();
    // The next start shows another one.
    std::fs::remove_file(place.path("state/access/secret")).unwrap();
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    browser.sign_in(&daemon);
    // At once: what the spool has is stored before a token is looked up.
    assert_eq!(triggered(&mut browser, &order), first);
    assert_eq!(triggered(&mut browser, &json!({ "token": "a-2" })), other);
    browser.ready();
    let third = triggered(&mut browser, &json!({ "token": "a-3" }));
    assert_eq!(third["seq"], 3);
    let stored = browser.get("/api/history/3");
    assert_eq!(stored["result"]["request"], "a-3");
}

#[test]
fn two_clients_with_the_same_token_get_the_same_result() {
    let (_place, daemon, mut browser) = signed_in();
    browser.ready();
    let answers: Vec<Value> = std::thread::scope(|scope| {
        let clients: Vec<_> = (0..4)
            .map(|client| {
                let daemon = &daemon;
                scope.spawn(move || {
                    let mut browser = Browser::new(daemon);
                    browser.sign_in(daemon);
                    let order = json!({ "token": format!("shared-{}", client / 2) });
                    triggered(&mut browser, &order)["seq"].clone()
                })
            })
            .collect();
        clients
            .into_iter()
            .map(|client| client.join().unwrap())
            .collect()
    });
    assert_eq!(answers[0], answers[1]);
    assert_eq!(answers[2], answers[3]);
    assert_ne!(answers[0], answers[2]);
    assert_eq!(browser.get("/api/snapshot")["counters"]["sequence"], 2);
}

#[test]
fn a_trigger_that_cannot_be_is_refused_in_words_and_measures_nothing() {
    let (_place, _daemon, mut browser) = signed_in();
    browser.ready();
    for (order, status, words) in [
        (json!({ "token": "" }), 400, "token: write 1 to 64"),
        (json!({ "token": "a b" }), 400, "token: write 1 to 64"),
        (
            json!({ "token": "x".repeat(65) }),
            400,
            "token: write 1 to 64",
        ),
        (json!({ "part_id": -1 }), 400, "part_id"),
        (json!({ "part": 1 }), 400, "unknown field `part`"),
        (
            json!({ "token": "y", "recipe": 7 }),
            409,
            "recipe 7 is not the active one: load it",
        ),
        (
            json!({ "recipe": 7 }),
            409,
            "recipe 7 is not the active one: load it",
        ),
    ] {
        let (found, answer) = browser.json("POST", "/api/trigger", &order);
        let said = answer["error"].as_str().unwrap_or_default().to_owned();
        // serde_json names the type, not the key, of a number out of range.
        let said = if words == "part_id" && said.contains("u32") {
            "part_id".into()
        } else {
            said
        };
        assert!(
            found == status && said.contains(words),
            "{order}: {found} {answer}"
        );
    }
    assert_eq!(browser.get("/api/snapshot")["counters"]["sequence"], 0);
}

/// The arrays and the meta of an NPZ.
fn maps(bytes: &[u8]) -> (BTreeMap<String, Array<f32>>, Value) {
    let mut zip = Members::open(Cursor::new(bytes), 7).unwrap();
    let (mut arrays, mut meta) = (BTreeMap::new(), Value::Null);
    let names: Vec<_> = zip.names().map(str::to_owned).collect();
    for name in names {
        let bytes = zip.content(&name, 1 << 30).unwrap();
        if name == "meta.npy" {
            // UTF-32 behind a header of 64 bytes or a multiple of it.
            let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
            let letters = bytes[header..].as_chunks::<4>().0;
            let text: String = letters
                .iter()
                .filter_map(|letter| char::from_u32(u32::from_le_bytes(*letter)))
                .collect();
            meta = serde_json::from_str(&text).unwrap();
        } else {
            arrays.insert(name.replace(".npy", ""), npy::read(&bytes).unwrap());
        }
    }
    (arrays, meta)
}

#[test]
fn maps_are_the_cloud_bit_by_bit_and_those_of_the_kept_frames() {
    let place = place_with_a_dent();
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    browser.sign_in(&daemon);
    browser.ready();
    let result = triggered(&mut browser, &json!({ "token": "dented" }));
    assert_eq!(result["verdict"], "FAIL");
    let (status, npz) = browser.ask("GET", "/api/last/maps.npz", &[]);
    assert_eq!(status, 200);
    let (last, meta) = maps(&npz);
    let names: Vec<_> = last.keys().map(String::as_str).collect();
    assert_eq!(names, ["deviation", "modulation", "sigma", "x", "y", "z"]);
    assert_eq!(
        (&meta["seq"], &meta["recipe"], &meta["units"]["z"]),
        (&json!(1), &json!(1), &json!("mm"))
    );
    assert_eq!(meta["gauges"][0]["value"], result["gauges"][0]["value"]);

    for (query, all) in [("", false), ("?pixels=all", true)] {
        let (_, ply) = browser.ask("GET", &format!("/api/last/cloud.ply{query}"), &[]);
        let path = place.path("cloud.ply");
        let end = ply
            .windows(10)
            .position(|ten| ten == b"end_header")
            .unwrap();
        let header = std::str::from_utf8(&ply[..end]).unwrap();
        let grid = header.lines().filter(|line| line.starts_with("obj_info"));
        assert_eq!(grid.count(), if all { 2 } else { 0 });
        let plain = header.lines().filter(|line| !line.starts_with("obj_info"));
        let plain: String = plain.map(|line| format!("{line}\n")).collect();
        std::fs::write(&path, [plain.as_bytes(), &ply[end..]].concat()).unwrap();
        let points = files::cloud(&path);
        let mut points = points.iter();
        for at in 0..last["z"].elements.len() {
            let [x, y, z, sigma] = ["x", "y", "z", "sigma"].map(|name| last[name].elements[at]);
            assert_eq!(sigma.is_nan(), z.is_nan());
            if z.is_nan() && !all {
                continue;
            }
            let vertex = points.next().unwrap();
            let bits = |values: [f32; 4]| values.map(f32::to_bits);
            let [a, b, c] = vertex.point;
            let found = [a, b, c, vertex.sigma];
            assert!(
                bits(found) == bits([x, y, z, sigma]) || (z.is_nan() && found[2].is_nan()),
                "{found:?}"
            );
        }
        assert!(points.next().is_none());
    }

    // The same from the frames on the card, once they are there.
    let kept = until("kept frames", PATIENCE, || {
        let (status, bytes) = browser.ask("GET", "/api/history/1/maps.npz", &[]);
        if status == 200 {
            Ok(bytes)
        } else {
            Err(status)
        }
    });
    let (kept, of_kept) = maps(&kept);
    for (name, array) in &last {
        let bits = |array: &Array<f32>| -> Vec<u32> {
            array.elements.iter().map(|value| value.to_bits()).collect()
        };
        assert_eq!(bits(array), bits(&kept[name]), "{name}");
    }
    assert_eq!(of_kept["gauges"], meta["gauges"]);
    let (golden, _) = maps(&browser.ask("GET", "/api/recipes/1/maps.npz", &[]).1);
    assert_eq!(golden["z"].rows, last["z"].rows);
    let (status, answer) = browser.json("GET", "/api/history/9/maps.npz", &Value::Null);
    assert_eq!(status, 404, "{answer}");
}
