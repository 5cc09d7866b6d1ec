//! A recipe that cannot refuse a bad part is refused itself, unless it says that it judges nothing.

use crate::page::{Browser, signed_in};
use crate::station_plc::{Daemon, Place, Plc};
use crate::written::program;
use algo::inspect::Basis;
use algo::inspect::kinds::Step;
use appliance::recipe::file::archive;
use appliance::recipe::{GaugeFile, RecipeFile, Store};
use serde_json::{Value, json};
use std::fs;
use tests::files;

/// [`Plc::measure`] returns the registers from 200 on: VERDICT is 208, FLAGS is 231.
const VERDICT: usize = 8;
const FLAGS: usize = 31;
const PASS: u16 = 1;
/// FLAGS: the recipe judges nothing.
const JUDGES_NOTHING: u16 = 1 << 8;
/// RECIPE_RESULT: the recipe is whole and cannot be used as it is stored.
const UNFIT: u16 = 5;

/// The stored recipe 1 with a change.
fn changed(place: &Place, change: impl Fn(&mut RecipeFile)) -> Vec<u8> {
    let (mut file, arrays) = files::recipe(&fs::read(place.recipe()).unwrap());
    change(&mut file);
    archive::pack(&file, &arrays).unwrap().0
}

fn without_limits(file: &mut RecipeFile) {
    for gauge in &mut file.gauges {
        (gauge.low, gauge.high) = (None, None);
    }
}

type Change = fn(&mut RecipeFile);

/// What recipes look like whose parts all pass, and what a refusal of each says.
fn toothless() -> [(Change, &'static str); 6] {
    [
        (without_limits, "judges_nothing"),
        // Limits that every part keeps are none.
        (
            |file| {
                without_limits(file);
                let coverage =
                    |gauge: &&mut GaugeFile| gauge.measures.facts().basis == Basis::Pixels;
                let coverage = file.gauges.iter_mut().find(coverage).unwrap();
                (coverage.low, coverage.high) = (Some(0.0), Some(1.0));
            },
            "judges_nothing",
        ),
        (
            |file| {
                let gauge = &mut file.gauges[0];
                gauge.of = vec![gauge.of[0].clone(); 2];
                gauge.measures = Step {}.into();
            },
            "from itself",
        ),
        // The same region under another name.
        (
            |file| {
                let mut twin = file.features[0].clone();
                twin.name = "twin".into();
                file.gauges[0].of = vec![file.features[0].name.clone(), twin.name.clone()];
                file.gauges[0].measures = Step {}.into();
                file.features.push(twin);
            },
            "from itself",
        ),
        (
            |file| file.features.push(file.features[0].clone()),
            "each feature its own name",
        ),
        (
            |file| {
                let mut twin = file.gauges[0].clone();
                twin.slot = 64;
                file.gauges.push(twin);
            },
            "each gauge its own name",
        ),
    ]
}

#[test]
fn a_recipe_whose_parts_would_all_pass_is_refused_by_page_and_command_with_the_remedy() {
    let (place, _daemon, mut browser) = signed_in();
    let taught = fs::read(place.recipe()).unwrap();
    let (path, config) = (place.path("toothless.recipe"), place.path("fringed.toml"));
    for (change, words) in toothless() {
        let bytes = changed(&place, change);
        let (status, answer) = browser.ask("POST", "/api/recipes?replace=true", &bytes);
        let answer = String::from_utf8(answer).unwrap();
        assert!(
            status == 422 && answer.contains(&words.replace('"', "\\\"")),
            "{status} {answer}"
        );
        fs::write(&path, &bytes).unwrap();
        let run = program().run(&[
            "recipe",
            "import",
            path.to_str().unwrap(),
            "--replace",
            "--config",
            config.to_str().unwrap(),
        ]);
        assert_eq!(run.code, 65, "{}", run.stderr);
        assert!(run.stderr.contains(words), "{}", run.stderr);
        let (file, _) = files::recipe(&bytes);
        let edit = json!({
            "fingerprint": browser.get("/api/recipes/1")["fingerprint"],
            "gauges": file.gauges, "features": file.features,
        });
        let (status, answer) = browser.json("PUT", "/api/recipes/1", &edit);
        let answer = answer["error"].as_str().unwrap_or_default();
        assert!(status == 422 && answer.contains(words), "{status} {answer}");
        assert_eq!(fs::read(place.recipe()).unwrap(), taught);
    }
}

#[test]
fn a_recipe_without_limits_is_stored_if_that_is_asked_for_and_each_result_says_that_it_was_not_judged()
 {
    let (place, daemon, mut browser) = signed_in();
    let before = browser.get("/api/recipes/1");
    let limits = before["gauges"].clone();
    let mut gauges = limits.clone();
    for gauge in gauges.as_array_mut().unwrap() {
        let gauge = gauge.as_object_mut().unwrap();
        gauge.retain(|key, _| key != "low" && key != "high");
    }
    let mut fingerprint = before["fingerprint"].as_str().unwrap().to_owned();
    let mut edit = |browser: &mut Browser, more: Value| {
        let mut body = json!({ "fingerprint": fingerprint });
        for (key, value) in more.as_object().unwrap() {
            body[key] = value.clone();
        }
        let (status, answer) = browser.json("PUT", "/api/recipes/1", &body);
        if status == 200 {
            browser.wait_for_another(&fingerprint);
            answer["fingerprint"]
                .as_str()
                .unwrap()
                .clone_into(&mut fingerprint);
        }
        status
    };
    assert_eq!(edit(&mut browser, json!({ "gauges": gauges })), 422);
    let asked = json!({ "gauges": gauges, "judges_nothing": true });
    assert_eq!(edit(&mut browser, asked), 200);
    let mut plc = Plc::connect(&daemon);
    let words = plc.measure(1);
    assert_eq!(
        (words[VERDICT], words[FLAGS] & JUDGES_NOTHING),
        (PASS, JUDGES_NOTHING)
    );
    let result = browser.get("/api/snapshot")["result"].clone();
    assert_eq!(result["judges_nothing"], true, "{result}");
    let listed = browser.get("/api/recipes")["recipes"][0].clone();
    assert_eq!(listed["judges_nothing"], true, "{listed}");
    // Its file is a recipe, and limits that are added end it.
    let (file, _) = files::recipe(&fs::read(place.recipe()).unwrap());
    assert!(file.judges_nothing);
    assert_eq!(edit(&mut browser, json!({ "gauges": limits })), 200);
    assert_eq!(plc.measure(2)[FLAGS] & JUDGES_NOTHING, 0);
    assert_eq!(browser.get("/api/recipes/1")["judges_nothing"], false);
}

#[test]
fn a_stored_recipe_that_judges_nothing_without_saying_so_is_not_loaded_and_can_be_mended() {
    let place = Place::taught();
    let bytes = changed(&place, without_limits);
    let store = Store::open(&place.path("state/recipes")).unwrap();
    store.save(1, &bytes).unwrap();
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    plc.wait("RECIPE_RESULT 5", |status| status.recipe_result() == UNFIT);
    assert_eq!(plc.status().active_recipe(), 0);
    let mut browser = Browser::new(&daemon);
    browser.sign_in(&daemon);
    let words = browser.get("/api/snapshot")["error"]["words"].clone();
    assert!(words.as_str().unwrap().contains("Recipes, Edit"), "{words}");
    let mut stored = browser.get("/api/recipes/1");
    stored["gauges"][0]["high"] = json!(0.5);
    let edit = json!({ "fingerprint": stored["fingerprint"], "gauges": stored["gauges"] });
    assert_eq!(browser.json("PUT", "/api/recipes/1", &edit).0, 200);
    assert_eq!(browser.ask("POST", "/api/recipes/1/load", &[]).0, 202);
    assert_eq!(plc.measure(1)[VERDICT], PASS);
}
