//! Who may change what.

use super::*;

const CHANGES: [(&str, &str); 14] = [
    ("POST", "/api/trigger"),
    ("POST", "/api/reset"),
    ("POST", "/api/recipes"),
    ("PUT", "/api/recipes/1"),
    ("DELETE", "/api/recipes/1"),
    ("POST", "/api/recipes/1/undo"),
    ("POST", "/api/recipes/1/load"),
    ("POST", "/api/recipes/1/teach"),
    ("POST", "/api/head/steps/plane"),
    ("DELETE", "/api/head/steps/plane"),
    ("PUT", "/api/simulation/part"),
    ("POST", "/api/studies"),
    ("POST", "/api/studies/1/run"),
    ("DELETE", "/api/studies/1"),
];

#[tokio::test]
async fn looking_needs_no_login_and_every_change_needs_one() {
    let served = served().await;
    let mut guarded = 0;
    for route in server::routes() {
        let path = route
            .path
            .replace("{number}", "1")
            .replace("{layer}", "height")
            .replace("{seq}", "1")
            .replace("{name}", "plane");
        let method = route.method.as_str();
        if route.path == "/events" || route.path == "/api/session" {
            continue;
        }
        let answer = served
            .change(method, &path, "fringed-session=0", "{}")
            .await;
        if route.changes.is_some() {
            guarded += 1;
            assert_eq!(answer.status, 401, "{method} {path}: {answer:?}");
            assert!(answer.body.contains("sign in"), "{answer:?}");
        } else {
            let tries = path.ends_with("/try");
            assert!(
                method == "GET" || tries,
                "{path} changes something without being recorded"
            );
            // Only a live picture makes the head expose, and only a try takes a core for long.
            let needs = path.starts_with("/api/head/live") || tries;
            assert_eq!(answer.status == 401, needs, "{path}: {answer:?}");
        }
    }
    assert_eq!(guarded, CHANGES.len());
    assert_eq!(served.handle.snapshot().triggers, 0);
}

#[tokio::test]
async fn a_change_from_another_site_s_page_is_refused_even_with_the_cookie() {
    let served = served().await;
    let cookie = served.sign_in().await;
    for origin in ["http://evil.example", "null", "", "http://127.0.0.1:1"] {
        let tries = [("POST", "/api/recipes/1/try")];
        for (method, path) in CHANGES.into_iter().chain(tries) {
            let headers = [("Origin", origin), ("Cookie", &*cookie)];
            let answer = served.ask(method, path, &headers, "{}").await;
            assert_eq!(answer.status, 403, "{method} {path} from {origin:?}");
        }
    }
    let answer = served
        .ask("POST", "/api/trigger", &[("Cookie", &cookie)], "")
        .await;
    assert_eq!(answer.status, 403, "without an Origin");
    let body = format!("{{\"secret\": \"{}\"}}", served.secret);
    let elsewhere = [("Origin", "http://evil.example")];
    assert_eq!(
        served
            .ask("POST", "/api/session", &elsewhere, &body)
            .await
            .status,
        403
    );
}

#[tokio::test]
async fn the_cookie_is_kept_from_scripts_and_other_sites_and_ends_with_the_session() {
    let served = served().await;
    let body = format!("{{\"secret\": \"{}\"}}", served.secret.to_lowercase());
    let answer = served.change("POST", "/api/session", "", &body).await;
    let cookie = answer.header("set-cookie").unwrap().to_owned();
    assert!(
        cookie.contains("HttpOnly") && cookie.contains("SameSite=Strict"),
        "{cookie}"
    );
    let cookie = cookie.split(';').next().unwrap();
    let state = served
        .ask("GET", "/api/session", &[("Cookie", cookie)], "")
        .await;
    assert_eq!(state.json()["signed_in"], true);
    assert_eq!(
        served.change("POST", "/api/reset", cookie, "").await.status,
        202
    );
    assert_eq!(
        served
            .change("DELETE", "/api/session", cookie, "")
            .await
            .status,
        200
    );
    assert_eq!(
        served.change("POST", "/api/reset", cookie, "").await.status,
        401
    );
}

#[tokio::test]
async fn a_reset_that_a_fault_outlasts_says_so_with_the_remedy() {
    let served = served().await;
    let cookie = served.sign_in().await;
    let reset = || served.change("POST", "/api/reset", &cookie, "");
    served.handle.event(Event::Started {});
    served.handle.event(Event::Faulted {
        error_code: 101,
        cause: "the camera is gone".into(),
        remedy: "check its cable".into(),
    });
    let refused = reset().await;
    assert_eq!(refused.status, 409, "{refused:?}");
    let words = "the fault stays: the camera is gone; check its cable";
    assert!(refused.body.contains(words), "{refused:?}");
    served.handle.event(Event::Recovered { recipe: None });
    assert_eq!(reset().await.status, 202);
}

#[tokio::test]
async fn wrong_secrets_are_refused_and_then_have_to_wait() {
    let served = served().await;
    for _ in 0..3 {
        let answer = served
            .change("POST", "/api/session", "", "{\"secret\": \"guess\"}")
            .await;
        assert_eq!(answer.status, 403);
        assert!(answer.header("set-cookie").is_none());
    }
    let body = format!("{{\"secret\": \"{}\"}}", served.secret);
    let answer = served.change("POST", "/api/session", "", &body).await;
    assert_eq!(answer.status, 429);
    assert!(
        answer
            .header("retry-after")
            .unwrap()
            .parse::<u64>()
            .unwrap()
            >= 1
    );
    assert!(answer.body.contains("wait"), "{answer:?}");
}

#[tokio::test]
async fn every_change_and_every_refusal_is_recorded_without_secrets() {
    let served = served().await;
    served
        .change("POST", "/api/session", "", "{\"secret\": \"guess\"}")
        .await;
    let cookie = served.sign_in().await;
    served.change("POST", "/api/reset", &cookie, "").await;
    served.change("POST", "/api/trigger", &cookie, "").await;
    served.change("POST", "/api/recipes/7/load", "", "").await;
    let answer = served.get("/api/changes").await;
    let changes = answer.json();
    let line = |at: usize, key: &str| changes["changes"][at][key].as_str().unwrap().to_owned();
    assert_eq!(changes["changes"].as_array().unwrap().len(), 5);
    assert_eq!(
        (line(0, "action"), line(0, "subject")),
        ("load recipe".into(), "recipes/7/load".into())
    );
    assert!(line(0, "outcome").contains("sign in first"));
    assert_eq!(
        (line(1, "action"), line(2, "action")),
        ("trigger".into(), "reset errors".into())
    );
    assert!(
        line(1, "outcome").contains("state boot"),
        "{}",
        line(1, "outcome")
    );
    assert_eq!(line(2, "outcome"), "done");
    assert_eq!(
        (line(3, "action"), line(3, "outcome")),
        ("sign in".into(), "done".into())
    );
    assert!(line(4, "outcome").contains("not the secret"));
    assert_eq!(line(2, "from"), "127.0.0.1");
    assert!(!answer.body.contains(&served.secret) && !answer.body.contains("guess"));
}

#[tokio::test]
async fn a_foreign_host_name_is_turned_away_with_the_remedy() {
    let served = served().await;
    let evil = served
        .ask("GET", "/api/snapshot", &[("Host", "evil.example")], "")
        .await;
    assert!(
        evil.status == 421 && evil.body.contains("IP address"),
        "{evil:?}"
    );
    let configured = served
        .ask("GET", "/api/snapshot", &[("Host", "sensor.local")], "")
        .await;
    assert_eq!(configured.status, 200);
}

#[tokio::test]
async fn a_request_that_names_two_hosts_is_refused() {
    let served = served().await;
    for hosts in [
        ["localhost", "evil.example"],
        ["evil.example", "localhost"],
        ["localhost", "localhost"],
    ] {
        let headers = hosts.map(|host| ("Host", host));
        let answer = served.ask("GET", "/api/snapshot", &headers, "").await;
        assert_eq!(answer.status, 400, "{hosts:?}: {answer:?}");
        assert!(answer.body.contains("one Host header"), "{answer:?}");
    }
    for (target, status) in [
        ("http://evil.example/api/snapshot", 400),
        ("http://localhost:80/api/snapshot", 400),
        ("http://localhost/api/snapshot", 200),
    ] {
        let answer = served
            .ask("GET", target, &[("Host", "localhost")], "")
            .await;
        assert_eq!(answer.status, status, "{target}: {answer:?}");
    }
    // Two Origin headers are refused as two Host headers are.
    let origin = served.origin();
    let two = [("Origin", &*origin), ("Origin", "http://evil.example")];
    let answer = served.ask("POST", "/api/session", &two, "{}").await;
    assert_eq!(answer.status, 403, "{answer:?}");
}

#[tokio::test]
async fn the_browsers_time_is_taken_at_sign_in_only_where_the_clock_is_not_synchronised_and_believable()
 {
    let served = served().await;
    let sign_in = async |secret: &str, time: &str| {
        let body = format!("{{\"secret\": \"{secret}\", \"time_ms\": {time}}}");
        served.change("POST", "/api/session", "", &body).await
    };
    let said = async |time: &str| {
        let answer = sign_in(&served.secret, time).await;
        assert_eq!(answer.status, 200, "{answer:?}");
        answer.json()["time"].clone()
    };
    const NOW_MS: u64 = 1_790_000_000_000;
    assert_eq!(said(&NOW_MS.to_string()).await, "taken");
    let start = served.dated.try_recv().unwrap();
    let uptime = served.handle.now().0;
    assert!(
        start <= NOW_MS * 1000 && start + uptime >= NOW_MS * 1000,
        "{start}"
    );
    for wrong in [
        "0",
        "1767225599999",
        "4102444800000",
        "18446744073709551615",
    ] {
        assert_eq!(said(wrong).await, "refused", "{wrong}");
    }
    assert_eq!(said("null").await, Value::Null);
    for unclear in ["-1", "1.5", "\"now\"", "1e30"] {
        assert_eq!(
            sign_in(&served.secret, unclear).await.status,
            400,
            "{unclear}"
        );
    }
    assert_eq!(
        sign_in("AAAAA-AAAAA-AAAAA-AAAAA", "1790000000000")
            .await
            .status,
        403
    );
    let utc_us = Some(NOW_MS * 1000);
    served.handle.event(Event::Tick { utc_us });
    assert_eq!(said(&NOW_MS.to_string()).await, "not needed");
    assert!(served.dated.try_recv().is_err());
}
