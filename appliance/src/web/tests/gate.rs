//! Who may do what.

use super::*;
use crate::access::Role;
use crate::web::gate::Least;
use std::rc::Rc;
use std::time::Duration;

/// A path of a route, with something in place of its parameters.
fn path(route: &server::Route) -> String {
    route
        .path
        .replace("{number}", "1")
        .replace("{layer}", "height")
        .replace("{seq}", "1")
        .replace("{name}", "plane")
}

/// The routes but for those that never end or are about sessions themselves.
fn rows() -> impl Iterator<Item = server::Route> {
    let routes = server::routes().into_iter();
    routes.filter(|route| route.path != "/events" && route.path != "/api/session")
}

/// A user of each role, by a name that is the role's; their cookies.
async fn users(served: &Served) -> Vec<(Role, String)> {
    let mut cookies = Vec::new();
    for role in Role::ALL {
        let by = (None, "a test");
        let access = &served.site.access;
        let name = format!("a-{}", role.word());
        access
            .set_user(&name, role, Some("correct horse"), by)
            .unwrap();
        let body = format!("{{\"user\": \"{name}\", \"secret\": \"correct horse\"}}");
        cookies.push((role, served.sign_in_with(&body).await));
    }
    cookies
}

/// Longest wait for an answer that is refused, and for one that is not.
const PATIENCE: Duration = Duration::from_secs(60);
const SOON: Duration = Duration::from_millis(200);

#[tokio::test]
async fn each_route_is_answered_for_those_who_may_and_for_nobody_else() {
    let tasks = tokio::task::LocalSet::new();
    tasks.run_until(async { each_route(true).await }).await;
    tasks.run_until(async { each_route(false).await }).await;
}

async fn each_route(looking_is_open: bool) {
    let served = Rc::new(served_to(looking_is_open).await);
    let users = users(&served).await;
    let mut cases: Vec<(Option<Role>, String)> = vec![(None, String::new())];
    cases.extend(
        users
            .iter()
            .map(|(role, cookie)| (Some(*role), cookie.clone())),
    );
    // A session whose user has just lost its role, or is gone.
    let lost = |name: &'static str| {
        let body = format!("{{\"user\": \"{name}\", \"secret\": \"correct horse\"}}");
        let access = served.site.access.clone();
        let by = (None, "a test");
        access
            .set_user(name, Role::Engineer, Some("correct horse"), by)
            .unwrap();
        body
    };
    let demoted = served.sign_in_with(&lost("demoted")).await;
    let removed = served.sign_in_with(&lost("removed")).await;
    let access = &served.site.access;
    access
        .set_user("demoted", Role::Operator, None, (None, "a test"))
        .unwrap();
    access.remove_user("removed").unwrap();
    cases.extend([(Some(Role::Operator), demoted), (None, removed)]);
    for route in rows() {
        let path = path(&route);
        let least = match route.least {
            Least::Anyone => None,
            Least::Collector => Some(Role::Viewer),
            Least::User(least) => Some(least),
        };
        let open = looking_is_open && least <= Some(Role::Viewer);
        let mut asking = tokio::task::JoinSet::new();
        for (role, cookie) in cases.clone() {
            let wanted = match (least, role) {
                _ if open => None,
                (None, _) => None,
                (Some(_), None) => Some(401),
                (Some(least), Some(role)) => (role < least).then_some(403),
            };
            let (served, method, path) = (served.clone(), route.method.clone(), path.clone());
            asking.spawn_local(async move {
                let asked = served.change(method.as_str(), &path, &cookie, "{");
                // A refusal comes at once; others may wait for a measuring task, which is silent here.
                let patience = wanted.map_or(SOON, |_| PATIENCE);
                let answer = tokio::time::timeout(patience, asked).await;
                (role, wanted, answer.ok())
            });
        }
        while let Some(answered) = asking.join_next().await {
            let (role, wanted, answer) = answered.unwrap();
            let case = format!("{role:?} {} {path}: {answer:?}", route.method);
            let status = answer.as_ref().map(|answer| answer.status);
            match wanted {
                // What the role may is answered in whatever other way.
                None => assert!(![Some(401), Some(403)].contains(&status), "{case}"),
                Some(wanted) => {
                    assert_eq!(status, Some(wanted), "{case}");
                    let words = least.map(Role::or_more).unwrap_or_default();
                    let body = answer.unwrap().body;
                    assert!(body.contains("sign in") || body.contains(&words), "{case}");
                }
            }
        }
    }
    assert_eq!(served.handle.snapshot().triggers, 0);
}

#[test]
fn the_rows_have_the_roles_of_the_table() {
    let of = |role| -> Vec<String> {
        let rows = rows().filter(|route| route.least == Least::User(role));
        rows.map(|route| format!("{} {}", route.method, route.path))
            .collect()
    };
    let operators = ["/load", "/trigger", "/reset"];
    assert!(
        of(Role::Operator)
            .iter()
            .all(|row| operators.iter().any(|end| row.ends_with(end)))
    );
    assert_eq!(of(Role::Operator).len(), 3);
    for (role, rows) in [
        (
            Role::Technician,
            &[
                "/teach",
                "/try",
                "/undo",
                "PUT /api/recipes",
                "/studies",
                "/steps",
                "/live",
            ][..],
        ),
        (
            Role::Engineer,
            &[
                "POST /api/recipes",
                "DELETE /api/recipes",
                "/simulation",
                "/users",
                "/backup",
                "/restore",
                "/restart",
            ],
        ),
    ] {
        for row in of(role) {
            assert!(
                rows.iter().any(|part| row.contains(part)),
                "{row} needs {role:?}"
            );
        }
        for part in rows {
            assert!(of(role).iter().any(|row| row.contains(part)), "{part}");
        }
    }
    for route in rows() {
        let looks = route.least <= Least::User(Role::Viewer);
        assert!(
            !looks || route.method == "GET",
            "{} changes something for viewers",
            route.path
        );
        assert!(!looks || route.changes.is_none(), "{}", route.path);
    }
}

#[tokio::test]
async fn programs_at_configured_addresses_collect_without_a_login_and_see_nothing_else() {
    let served = served_to(false).await;
    let statuses = async |from: [u8; 4]| {
        let mut answered = Vec::new();
        for route in rows().filter(|route| route.method == "GET") {
            let status = served
                .from(from, route.method.as_str(), &path(&route))
                .await;
            if status != 401 {
                answered.push(route.path);
            }
        }
        answered
    };
    let collected = statuses([127, 0, 0, 2]).await;
    assert_eq!(
        collected,
        [
            "/healthz",
            "/readyz",
            "/metrics",
            "/api/snapshot",
            "/api/results"
        ]
    );
    assert_eq!(statuses([127, 0, 0, 3]).await, [""; 0]);
    // The page itself and signing in are for everybody.
    assert_eq!(served.get("/").await.status, 200);
    let session = served.get("/api/session").await.json();
    assert_eq!(
        (&session["looking"], &session["role"]),
        (&"signed-in".into(), &"viewer".into())
    );
    assert_eq!(session["needs"]["POST /api/trigger"], "operator");
    assert!(session["needs"]["GET /api/history"].is_null());
}

#[tokio::test]
async fn a_request_whose_sender_loses_the_role_while_its_body_comes_changes_nothing() {
    let served = served().await;
    let users = users(&served).await;
    let cookie = &users[3].1;
    let body = "{\"role\": \"engineer\", \"secret\": \"correct horse\"}";
    let mut stream = TcpStream::connect(served.address).await.unwrap();
    let head = format!(
        "PUT /api/users/accomplice HTTP/1.1\r\nConnection: close\r\nHost: {0}\r\nOrigin: http://{0}\r\nCookie: {cookie}\r\nContent-Length: {1}\r\n\r\n{2}",
        served.address,
        body.len(),
        &body[..10]
    );
    stream.write_all(head.as_bytes()).await.unwrap();
    tokio::time::sleep(Duration::from_millis(300)).await;
    let access = &served.site.access;
    access
        .set_user("a-engineer", Role::Technician, None, (None, "a test"))
        .unwrap();
    stream.write_all(&body.as_bytes()[10..]).await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    assert!(answer.starts_with("HTTP/1.1 403"), "{answer}");
    assert!(answer.contains("an engineer"), "{answer}");
    assert!(access.users().iter().all(|user| user.name != "accomplice"));
}

#[tokio::test]
async fn a_user_changes_its_own_password_and_its_other_sessions_end() {
    let served = served().await;
    let users = users(&served).await;
    let other = served
        .sign_in_with("{\"user\": \"a-operator\", \"secret\": \"correct horse\"}")
        .await;
    let set = async |body: &str| {
        served
            .change("PUT", "/api/session", &users[1].1, body)
            .await
    };
    assert_eq!(
        set("{\"secret\": \"wrong\", \"new\": \"135790\"}")
            .await
            .status,
        403
    );
    assert_eq!(
        set("{\"secret\": \"correct horse\", \"new\": \"12345\"}")
            .await
            .status,
        422
    );
    let answer = set("{\"secret\": \"correct horse\", \"new\": \"135790\"}").await;
    assert_eq!(answer.status, 200, "{answer:?}");
    let cookie = answer
        .header("set-cookie")
        .unwrap()
        .split(';')
        .next()
        .unwrap();
    let state = async |cookie: &str| {
        served
            .ask("GET", "/api/session", &[("Cookie", cookie)], "")
            .await
            .json()
    };
    assert_eq!(state(cookie).await["user"], "a-operator");
    assert_eq!(state(&other).await["signed_in"], false);
    let engineer = served.sign_in().await;
    let refused = served
        .change(
            "PUT",
            "/api/session",
            &engineer,
            "{\"secret\": \"x\", \"new\": \"correct horse\"}",
        )
        .await;
    assert!(
        refused.status == 422 || refused.status == 403,
        "{refused:?}"
    );
}

#[tokio::test]
async fn the_record_says_who_did_what_and_is_filtered_by_user_and_recipe() {
    let served = served().await;
    let users = users(&served).await;
    served.change("POST", "/api/reset", &users[1].1, "").await;
    served
        .change("POST", "/api/recipes/7/teach", &users[1].1, "")
        .await;
    served
        .change("POST", "/api/recipes/7/load", &users[2].1, "")
        .await;
    let list = async |query: &str| {
        let answer = served.get(&format!("/api/changes?{query}")).await.json();
        answer["changes"].as_array().unwrap().clone()
    };
    let of_operator = list("user=a-operator").await;
    assert_eq!(of_operator.len(), 3);
    assert_eq!(of_operator[0]["role"], "operator");
    assert!(
        of_operator[0]["outcome"]
            .as_str()
            .unwrap()
            .contains("technician")
    );
    assert_eq!(list("recipe=7").await.len(), 2);
    assert_eq!(list("limit=2").await.len(), 2);
    assert_eq!(served.get("/api/changes?limit=0").await.status, 400);
    assert_eq!(served.get("/api/changes?people=x").await.status, 400);
    let csv = served.get("/api/changes.csv?user=a-operator").await;
    assert!(csv.body.contains("number,time_utc"), "{csv:?}");
    assert!(
        csv.body.contains(",a-operator,operator,reset errors,"),
        "{csv:?}"
    );
    assert_eq!(
        served.site.access.record().check().unwrap().problems,
        Vec::<String>::new()
    );
}

#[tokio::test]
async fn strangers_cannot_fill_the_record() {
    let served = served().await;
    for _ in 0..20 {
        served.change("POST", "/api/trigger", "", "").await;
    }
    let changes = served.get("/api/changes").await.json();
    assert_eq!(changes["changes"].as_array().unwrap().len(), 1);
}

#[tokio::test]
async fn a_change_from_another_site_s_page_is_refused_even_with_the_cookie() {
    let served = served().await;
    let cookie = served.sign_in().await;
    for origin in ["http://evil.example", "null", "", "http://127.0.0.1:1"] {
        for route in rows().filter(|route| route.method != "GET") {
            let (method, path) = (route.method.as_str(), &path(&route));
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
