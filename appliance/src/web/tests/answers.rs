//! What the API answers.

use super::*;
use crate::access::Role;
use crate::station::Event;
use crate::web::gate::Least;
use std::collections::BTreeSet;

#[tokio::test]
async fn the_description_names_exactly_the_paths_that_are_answered() {
    let description: Value = serde_json::from_str(look::OPENAPI).unwrap();
    assert!(description["openapi"].as_str().unwrap().starts_with("3."));
    let mut described = BTreeSet::new();
    for (path, methods) in description["paths"].as_object().unwrap() {
        for (method, operation) in methods.as_object().unwrap() {
            if method == "parameters" {
                continue;
            }
            described.insert((path.clone(), method.to_uppercase()));
            assert!(operation["summary"].is_string(), "{method} {path}");
            assert!(operation["responses"].is_object(), "{method} {path}");
        }
    }
    let mut answered = BTreeSet::new();
    for route in server::routes() {
        answered.insert((route.path.to_owned(), route.method.to_string()));
        let operation = &description["paths"][route.path][route.method.as_str().to_lowercase()];
        // Whatever needs a session says so.
        let needs = matches!(route.least, Least::User(role) if role > Role::Viewer);
        assert_eq!(operation["security"].is_array(), needs, "{}", route.path);
    }
    assert_eq!(described, answered);
    assert_eq!(
        served().await.get("/api/openapi.json").await.json(),
        description
    );
}

#[tokio::test]
async fn the_table_of_kinds_is_the_one_that_the_command_prints() {
    let served = served().await;
    let table = crate::recipe::file::kinds::json();
    assert_eq!(served.get("/api/kinds").await.json(), table);
}

#[tokio::test]
async fn every_answer_has_a_status_that_the_description_names() {
    let served = served().await;
    let cookie = served.sign_in().await;
    let description: Value = serde_json::from_str(look::OPENAPI).unwrap();
    for route in server::routes()
        .iter()
        .filter(|route| route.path != "/events")
    {
        let path = route
            .path
            .replace("{number}", "1")
            .replace("{seq}", "1")
            .replace("{layer}", "height");
        let method = route.method.as_str();
        let answer = served.change(method, &path, &cookie, "{}").await;
        let operation = &description["paths"][route.path][method.to_lowercase()];
        let named = &operation["responses"][answer.status.to_string()];
        assert!(
            named.is_object(),
            "{method} {path} answers {}: {}",
            answer.status,
            answer.body
        );
        if answer.status >= 400 && path != "/readyz" && path != "/healthz" {
            assert!(
                answer.json()["error"].is_string(),
                "{method} {path}: {answer:?}"
            );
        }
    }
}

#[tokio::test]
async fn the_snapshot_is_json_with_the_state_in_words() {
    let served = served().await;
    assert_eq!(served.get("/readyz").await.status, 503);
    served.handle.event(Event::Started);
    let json = served.get("/api/snapshot").await.json();
    assert_eq!(json["state"], "ready");
    assert_eq!(json["result"], Value::Null);
    assert_eq!(json["counters"]["sequence"], 4);
    assert_eq!(served.get("/healthz").await.body, "ok\n");
    // Ready, but without a recipe.
    assert_eq!(served.get("/readyz").await.status, 503);
}

#[tokio::test]
async fn metrics_are_whole_and_end_as_openmetrics_must() {
    let served = served().await;
    let answer = served.get("/metrics").await;
    let kind = answer.header("content-type").unwrap();
    assert!(kind.starts_with("application/openmetrics-text"), "{kind}");
    assert!(answer.body.ends_with("# EOF\n"), "{}", answer.body);
    let mut family = "";
    for line in answer.body.lines().filter(|line| *line != "# EOF") {
        if let Some(rest) = line.strip_prefix("# ") {
            family = rest.split(' ').nth(1).unwrap();
        } else {
            assert!(line.starts_with(family), "{line} stands under {family}");
            let value = line.rsplit(' ').next().unwrap();
            assert!(value.parse::<f64>().is_ok(), "{line}");
        }
    }
    assert!(
        answer
            .body
            .contains("fringed_results_total{verdict=\"PASS\"} 0\n")
    );
}

#[tokio::test]
async fn power_and_projector_are_shown_where_they_are_known_and_left_out_of_metrics_elsewhere() {
    let served = served().await;
    let health = || async {
        let snapshot = served.get("/api/snapshot").await.body;
        serde_json::from_str::<Value>(&snapshot).unwrap()["health"].clone()
    };
    let shown = health().await;
    for unknown in ["power", "kernel", "projector_faults", "led_current_steps"] {
        assert_eq!(shown[unknown], Value::Null, "{unknown}");
    }
    let metrics = served.get("/metrics").await.body;
    assert!(!metrics.contains("fringed_power") && !metrics.contains("{part="));

    served.handle.event(Event::Surveyed(System {
        power: Some(Power::of(0x1_0000, None)),
        kernel: Some([6, 12]),
        free_storage_mib: Some(3000),
        boots: 7,
        unclean_boots: 2,
        ..System::default()
    }));
    served.handle.event(Event::Paced(Pace {
        dropped: 3,
        ..Pace::default()
    }));
    served.handle.event(Event::Projector(ProjectorHealth {
        temperature_c: Some(41.2),
        led_current: Some(600),
        faults: Some(2),
        fault_words: Some(vec!["LED"]),
    }));
    let shown = health().await;
    assert_eq!(shown["power"]["now"], serde_json::json!([]));
    assert_eq!(shown["power"]["since_start"][0], "under-voltage");
    assert_eq!(
        (&shown["kernel"], &shown["libcamera"]),
        (&"6.12".into(), &Value::Null)
    );
    assert_eq!(shown["projector_faults"][0], "LED");
    let metrics = served.get("/metrics").await.body;
    for sample in [
        "fringed_temperature_celsius{part=\"projector\"} 41.2\n",
        "fringed_power 16\n",
        "fringed_projector_fault 2\n",
        "fringed_led_current_steps 600\n",
        "fringed_warning{warning=\"clock_unsynced\"} 1\n",
        "fringed_warning{warning=\"storage\"} 0\n",
        "fringed_free_storage_bytes 3145728000\n",
        "fringed_starts_total 7\n",
        "fringed_unclean_starts_total 2\n",
        "fringed_dropped_frames_total 3\n",
        "fringed_results_unasked_seconds ",
    ] {
        assert!(metrics.contains(sample), "{metrics}");
    }
}

#[tokio::test]
async fn a_marking_that_is_no_outline_or_too_long_is_refused_by_its_key() {
    let served = served().await;
    let cookie = served.sign_in().await;
    let place = serde_json::json!([1, 2]);
    for (key, count) in [
        ("outline", 2),
        ("outline", 257),
        ("part", 65),
        ("others", 65),
    ] {
        let body = serde_json::json!({ "marking": { key: vec![&place; count] } });
        let path = "/api/recipes/1/teach";
        let answer = served
            .change("POST", path, &cookie, &body.to_string())
            .await;
        assert_eq!(answer.status, 422, "{answer:?}");
        let words = format!("marking.{key} has {count} members");
        assert!(answer.body.contains(&words), "{answer:?}");
    }
}

#[tokio::test]
async fn queries_and_paths_that_cannot_be_read_are_problems_in_json() {
    let served = served().await;
    for path in [
        "/api/picture/height?level=x",
        "/api/recipes/seven",
        "/api/history?recipe=70000",
        "/api/results?after=-1",
    ] {
        let answer = served.get(path).await;
        assert_eq!(answer.status, 400, "{path}: {answer:?}");
        assert!(answer.json()["error"].is_string(), "{path}: {answer:?}");
    }
}

#[tokio::test]
async fn what_is_not_there_yet_says_what_to_do() {
    let served = served().await;
    for path in [
        "/api/last/gauges.csv",
        "/api/recipes/3",
        "/api/recipes/3/file",
    ] {
        let answer = served.get(path).await;
        assert_eq!(answer.status, 404, "{path}");
        assert!(
            answer.json()["error"].as_str().unwrap().len() > 10,
            "{path}"
        );
    }
    assert_eq!(served.get("/nowhere").await.status, 404);
    assert_eq!(served.ask("DELETE", "/metrics", &[], "").await.status, 405);
}

#[tokio::test]
async fn a_recipe_that_is_none_is_refused_and_not_stored() {
    let served = served().await;
    let cookie = served.sign_in().await;
    let answer = served
        .change("POST", "/api/recipes", &cookie, "no recipe")
        .await;
    assert_eq!(answer.status, 422);
    assert!(served.site.recipes.numbers().is_empty());
    let answer = served
        .change("PUT", "/api/recipes/1", &cookie, "{\"fingerprint\": 5}")
        .await;
    assert_eq!(answer.status, 400);
}

#[tokio::test]
async fn the_diagnostic_bundle_holds_no_secret() {
    let served = served().await;
    let cookie = served.sign_in().await;
    std::fs::write(served._folder.path().join("calibration.json"), "{}").unwrap();
    let bundle = served.get("/api/diagnostics.zip").await;
    assert_eq!(bundle.status, 200);
    for name in [
        "snapshot.json",
        "log.json",
        "recipes.json",
        "fringed.toml",
        "calibration.json",
        "metrics.txt",
    ] {
        assert!(bundle.body.contains(name), "{name}");
    }
    let token = cookie.split('=').next_back().unwrap();
    for secret in [&*served.secret, token, "$argon2"] {
        assert!(!bundle.body.contains(secret));
    }
}

#[tokio::test]
async fn where_the_clock_shows_no_date_of_http_an_answer_says_so() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let mut client = TcpStream::connect(address).await.unwrap();
    client.write_all(b"GET / HTTP/1.1\r\n\r\n").await.unwrap();
    let (stream, _) = listener.accept().await.unwrap();
    server::refuse(&stream).await;
    drop(stream);
    let mut answer = String::new();
    client.read_to_string(&mut answer).await.unwrap();
    let (head, body) = answer.split_once("\r\n\r\n").unwrap();
    assert!(head.starts_with("HTTP/1.1 503 "), "{answer}");
    assert!(
        head.contains(&format!("Content-Length: {}\r\n", body.len())),
        "{answer}"
    );
    let json: Value = serde_json::from_str(body).unwrap();
    assert!(
        json["error"].as_str().unwrap().ends_with(": set it"),
        "{body}"
    );
}
