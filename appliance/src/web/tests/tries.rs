//! Edits that are tried before they are stored.

use super::*;
use crate::tests::Bed;
use serde_json::json;

const TRY: &str = "/api/recipes/1/try";

/// A page with a recipe, and a session.
async fn edited() -> (Served, Bed, String) {
    let (served, bed) = (served().await, Bed::new());
    let cookie = served.sign_in().await;
    served.site.calibration.set(Some(&bed.calibration));
    served.site.recipes.save(1, &bed.bytes).unwrap();
    (served, bed, cookie)
}

/// The list of a recipe as an editor sends it, with a plane and a gauge of it.
fn list(bed: &Bed) -> Value {
    let file = serde_json::to_value(&bed.file).unwrap();
    let mut edit = json!({ "datums": [] });
    for key in ["fingerprint", "features", "gauges"] {
        edit[key] = file[key].clone();
    }
    let region = json!([[10.0, 10.0], [50.0, 10.0], [50.0, 40.0], [10.0, 40.0]]);
    let plane = json!({ "name": "sheet", "kind": "plane", "region": region });
    edit["features"].as_array_mut().unwrap().push(plane);
    let gauge = json!({
        "slot": 40, "name": "height", "kind": "z", "of": ["sheet"], "golden": true, "plus": 1.0, "minus": 1.0,
    });
    edit["gauges"].as_array_mut().unwrap().push(gauge);
    edit
}

/// Something wrong that a list can have: made of it, and with what it is wrong.
type Fault = (fn(&mut Value), &'static str, &'static str);

const FAULTS: [Fault; 8] = [
    (
        |list| list["features"][0]["name"] = "".into(),
        "feature",
        "",
    ),
    (
        |list| {
            let twice = list["features"][1].clone();
            list["features"].as_array_mut().unwrap().push(twice);
        },
        "feature",
        "sheet",
    ),
    (
        |list| list["features"][1]["region"] = json!([[900, 1], [910, 1], [910, 9]]),
        "feature",
        "sheet",
    ),
    (
        |list| list["features"][1]["width_mm"] = 3.0.into(),
        "feature",
        "sheet",
    ),
    (
        |list| list["datums"] = json!([{ "name": "A", "of": ["whole frame"] }]),
        "datum",
        "A",
    ),
    (
        |list| list["gauges"].as_array_mut().unwrap().last_mut().unwrap()["slot"] = 1.into(),
        "gauge",
        "height",
    ),
    (
        |list| list["gauges"].as_array_mut().unwrap().last_mut().unwrap()["of"] = json!(["gone"]),
        "gauge",
        "height",
    ),
    (
        |list| {
            let gauge = list["gauges"].as_array_mut().unwrap().last_mut().unwrap();
            *gauge = json!({
                "slot": 41, "name": "crossed", "kind": "z", "of": ["sheet"], "low": 2.0, "high": 1.0,
            });
        },
        "gauge",
        "crossed",
    ),
];

#[tokio::test]
async fn what_storing_a_list_would_refuse_a_try_names_in_the_same_words_and_stores_nothing() {
    let (served, bed, cookie) = edited().await;
    let feature = bed.file.features[0].name.clone();
    let before = || std::fs::read(&served.site.recipes.generations(1)[0]).unwrap();
    for (at, (fault, part, name)) in FAULTS.into_iter().enumerate() {
        let mut edit = list(&bed);
        fault(&mut edit);
        if at == 4 {
            edit["datums"][0]["of"] = json!([feature]);
        }
        let edit = edit.to_string();
        let tried = served.change("POST", TRY, &cookie, &edit).await;
        assert_eq!(tried.status, 200, "{at}: {tried:?}");
        let tried = tried.json();
        let refused = served.change("PUT", "/api/recipes/1", &cookie, &edit).await;
        assert_eq!(refused.status, 422, "{at}: {refused:?}");
        let refused = refused.json()["error"].as_str().unwrap().to_owned();
        let problems = tried["problems"].as_array().unwrap();
        let own = problems.iter().find(|of| of[part] == name);
        let own = own.unwrap_or_else(|| panic!("{at}: {tried}"));
        assert!(
            refused.contains(own["words"].as_str().unwrap()),
            "{at}: {refused} {own}"
        );
        assert_eq!(own["refused"], true);
        assert!(own["at"].is_u64(), "{own}");
        assert!(before() == bed.bytes, "{at}");
    }
}

#[tokio::test]
async fn a_try_names_all_that_is_wrong_and_measures_the_rest() {
    let (served, bed, cookie) = edited().await;
    let mut edit = list(&bed);
    let sound = served.change("POST", TRY, &cookie, &edit.to_string()).await;
    let sound = sound.json();
    assert_eq!(sound["problems"], json!([]), "{sound}");
    let plane = &sound["features"][1];
    assert_eq!(
        (&plane["name"], &plane["state"]),
        (&"sheet".into(), &"found".into())
    );
    assert_eq!(plane["fit"]["outline"].as_array().unwrap().len(), 4);
    // Three things that do not hide each other.
    edit["features"][0]["name"] = "".into();
    edit["gauges"][0]["slot"] = 900.into();
    edit["datums"] = json!([{ "name": "A", "of": ["sheet", "sheet"] }]);
    let tried = served.change("POST", TRY, &cookie, &edit.to_string()).await;
    let tried = tried.json();
    let named = |part: &str| {
        let all = tried["problems"].as_array().unwrap();
        all.iter().filter(|of| !of[part].is_null()).count()
    };
    assert!(
        named("feature") == 1 && named("gauge") >= 1 && named("datum") == 1,
        "{tried}"
    );
    let height = |of: &Value| {
        let gauges = of["gauges"].as_array().unwrap().clone();
        gauges
            .into_iter()
            .find(|of| of["name"] == "height")
            .unwrap()
    };
    let (all, rest) = (height(&sound), height(&tried));
    assert_eq!(all["value"], rest["value"]);
    assert_eq!(all["kind"], "z");
    let [low, value, high] = ["low", "value", "high"].map(|key| all[key].as_f64().unwrap());
    assert!((value - low - 1.0).abs() < 1e-9 && (high - value - 1.0).abs() < 1e-9);
    assert_eq!(all["too_fine"], false);
}

#[tokio::test]
async fn limits_closer_than_four_times_the_uncertainty_are_too_fine() {
    let (served, bed, cookie) = edited().await;
    let mut edit = list(&bed);
    let tried = async |edit: &Value| {
        let tried = served.change("POST", TRY, &cookie, &edit.to_string()).await;
        let gauges = tried.json()["gauges"].as_array().unwrap().clone();
        gauges
            .into_iter()
            .find(|of| of["name"] == "height")
            .unwrap()
    };
    let u = tried(&edit).await["u"].as_f64().unwrap();
    for (share, too_fine) in [(1.9, true), (2.1, false)] {
        let gauge = edit["gauges"].as_array_mut().unwrap().last_mut().unwrap();
        (gauge["plus"], gauge["minus"]) = ((share * u).into(), (share * u).into());
        assert_eq!(tried(&edit).await["too_fine"], too_fine, "{share} · {u}");
    }
}

#[tokio::test]
async fn a_feature_without_a_gauge_is_shown_and_changes_no_value() {
    let (served, bed, cookie) = edited().await;
    let mut edit = list(&bed);
    let with = served.change("POST", TRY, &cookie, &edit.to_string()).await;
    let gauges = edit["gauges"].as_array_mut().unwrap();
    gauges.pop();
    let without = served.change("POST", TRY, &cookie, &edit.to_string()).await;
    let (with, without) = (with.json(), without.json());
    let names = |of: &Value| {
        let features = of["features"].as_array().unwrap().iter();
        features.map(|of| of["name"].clone()).collect::<Vec<_>>()
    };
    assert_eq!(names(&with), names(&without));
    assert_eq!(without["features"][1]["state"], "found");
    let gauges = without["gauges"].as_array().unwrap();
    assert_eq!(
        gauges[..],
        with["gauges"].as_array().unwrap()[..gauges.len()]
    );
}

#[tokio::test]
async fn a_try_is_for_those_who_are_signed_in_and_an_outdated_one_is_told_so() {
    let (served, bed, cookie) = edited().await;
    let mut edit = list(&bed);
    let stranger = served.change("POST", TRY, "", &edit.to_string()).await;
    assert_eq!(stranger.status, 401);
    let missing = served
        .change("POST", "/api/recipes/2/try", &cookie, &edit.to_string())
        .await;
    assert_eq!(missing.status, 404);
    edit["fingerprint"] = "0000".into();
    let outdated = served.change("POST", TRY, &cookie, &edit.to_string()).await;
    assert_eq!(outdated.status, 409);
    let outdated = outdated.json();
    assert_eq!(outdated["why"], "outdated");
    assert_eq!(outdated["fingerprint"], bed.file.fingerprint.as_str());
}

#[tokio::test]
async fn parts_that_are_not_there_have_an_error_each_and_too_many_are_refused() {
    let (served, bed, cookie) = edited().await;
    let mut edit = list(&bed);
    edit["on"] = json!([7, 8]);
    let tried = served.change("POST", TRY, &cookie, &edit.to_string()).await;
    let tried = tried.json();
    assert_eq!(tried["on"], json!([7, 8]));
    for (at, seq) in [7, 8].into_iter().enumerate() {
        let part = &tried["parts"][at];
        assert_eq!(part["seq"], seq);
        let error = part["error"].as_str().unwrap();
        assert!(error.contains("history"), "{part}");
    }
    for (on, status) in [
        (json!(vec![1; 21]), 422),
        (json!("first"), 400),
        (json!(5), 400),
    ] {
        edit["on"] = on;
        let refused = served.change("POST", TRY, &cookie, &edit.to_string()).await;
        assert_eq!(refused.status, status, "{refused:?}");
    }
}
