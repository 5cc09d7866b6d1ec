//! Boundary values in every request: each is refused by its key and changes nothing, or what it
//! makes can be used.

use super::*;
use crate::history::{Bounds, Numbering};
use crate::storage::state::StateFolder;
use crate::tests::{Bed, Tally, cases, places, values};

/// What stands in for a number or a word of an address.
const WORDS: [&str; 14] = [
    "0",
    "1",
    "-1",
    "9999",
    "10000",
    "65535",
    "65536",
    "4294967296",
    "9223372036854775808",
    "18446744073709551616",
    "1e300",
    "nan",
    "%00",
    "",
];

fn words_of(answer: &Answer) -> String {
    let parsed: Option<Value> = serde_json::from_str(&answer.body).ok();
    let words = parsed.and_then(|body| Some(body["error"].as_str()?.to_owned()));
    words.unwrap_or_else(|| answer.body.clone())
}

#[tokio::test]
async fn a_boundary_value_in_an_edit_is_refused_by_its_key_or_the_recipe_judges_a_part() {
    let (served, bed) = (served().await, Bed::new());
    let cookie = served.sign_in().await;
    served.site.calibration.set(Some(&bed.calibration));
    let store = &served.site.recipes;
    store.save(1, &bed.bytes).unwrap();
    let file = serde_json::to_value(&bed.file).unwrap();
    let mut edit = Value::default();
    for key in [
        "fingerprint",
        "name",
        "part_number",
        "min_coverage",
        "guard_k",
        "features",
        "datums",
        "gauges",
    ] {
        edit[key] = file[key].clone();
    }
    let mut tally = Tally::default();
    let mut values = values();
    // What is longer than a request may be is not read at all.
    let long = values.pop().unwrap();
    values.push(format!("{}\"", &long[..60_000]));
    for (place, value) in cases(places(&edit), |_| values.clone()) {
        let body = place.replaced(&edit, &value, Value::to_string);
        let answer = served.change("PUT", "/api/recipes/1", &cookie, &body).await;
        let stored = std::fs::read(&store.generations(1)[0]).unwrap();
        let used = match answer.status {
            200 => {
                let used = bed.use_recipe(store.load(1).unwrap().recipe);
                store.save(1, &bed.bytes).unwrap();
                assert_eq!(used, Ok(()), "{place} = {value}");
                used
            }
            400 | 409 | 413 | 422 => {
                assert!(stored == bed.bytes, "{place} = {value} was stored");
                // A recipe that was changed meanwhile is refused for its fingerprint.
                let about = if answer.status == 409 {
                    " (fingerprint)"
                } else {
                    ""
                };
                Err(words_of(&answer) + about)
            }
            status => panic!("{place} = {value}: {status} {}", words_of(&answer)),
        };
        tally.take(&place, &value, used);
    }
    tally.end("edit", 1000);
}

#[tokio::test]
async fn a_boundary_value_in_any_address_or_body_is_answered_and_never_breaks_the_page() {
    let (served, bed) = (served().await, Bed::new());
    let cookie = served.sign_in().await;
    served.site.calibration.set(Some(&bed.calibration));
    served.site.recipes.save(1, &bed.bytes).unwrap();
    let state = StateFolder::open(served._folder.path()).unwrap();
    let numbering = Numbering {
        counted: state.counted(),
        counter: state.counter(),
        serial: "S".into(),
        run: 1,
        utc_s: None,
    };
    let bounds = Bounds {
        results: 10,
        recordings: 0,
        good_every: 0,
    };
    let _history = crate::history::open(state.path(), numbering, bounds).unwrap();
    let description: Value = serde_json::from_str(look::OPENAPI).unwrap();
    let bodies = [
        "",
        "{}",
        "[]",
        "null",
        "0",
        "\"\"",
        "{\"fingerprint\": 0}",
        "{\"secret\": \"\"}",
        "\u{0}",
    ];
    let long = format!("{{\"fingerprint\": \"{}\"}}", "x".repeat(60_000));
    let mut cases = 0;
    let mut asked = Vec::new();
    for route in server::routes()
        .iter()
        .filter(|route| route.path != "/events" && route.method != "DELETE")
    {
        let method = route.method.as_str();
        for name in ["{number}", "{seq}", "{layer}"] {
            for word in WORDS.iter().filter(|_| route.path.contains(name)) {
                asked.push((
                    method.to_owned(),
                    route.path.replace(name, word),
                    String::new(),
                ));
            }
        }
        let plain = route
            .path
            .replace("{number}", "1")
            .replace("{seq}", "1")
            .replace("{layer}", "height");
        let parameters = &description["paths"][route.path][method.to_lowercase()]["parameters"];
        for parameter in parameters.as_array().into_iter().flatten() {
            let key = parameter["name"]
                .as_str()
                .filter(|_| parameter["in"] == "query");
            for (key, word) in key.iter().flat_map(|key| WORDS.map(|word| (*key, word))) {
                asked.push((
                    method.to_owned(),
                    format!("{plain}?{key}={word}"),
                    String::new(),
                ));
            }
        }
        // Signing in comes last: wrong secrets have to wait.
        if method != "GET" && plain != "/api/session" {
            for body in bodies.into_iter().chain([&*long]) {
                asked.push((method.to_owned(), plain.clone(), body.to_owned()));
            }
        }
    }
    for body in bodies {
        asked.push(("POST".into(), "/api/session".into(), body.into()));
    }
    for (method, address, body) in asked {
        // The path parameter of another name stays as it is described: no such page.
        let began = Instant::now();
        let answer = served.change(&method, &address, &cookie, &body).await;
        let known = (200..500).contains(&answer.status) || answer.status == 503;
        assert!(known, "{method} {address}: {answer:?}");
        assert!(began.elapsed().as_secs() < 5, "{method} {address}");
        cases += 1;
    }
    println!("{cases} boundary values in addresses and bodies");
    assert!(cases >= 380, "{cases}");
    let stored = served.site.recipes.load(1).unwrap();
    assert_eq!(bed.use_recipe(stored.recipe), Ok(()));
}
