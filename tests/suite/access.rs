//! Who did it: roles and users on the real program, guesses, and the record of changes over kills.

use crate::changeover::select;
use crate::page::Browser;
use crate::station_plc::{Daemon, Place, Plc, READY};
use crate::written::FRINGED;
use appliance::access::ChangeRecord;
use serde_json::{Value, json};
use std::fs;
use std::io::{Read as _, Write as _};
use std::net::{Ipv4Addr, SocketAddr, TcpStream};
use std::process::Command;
use std::time::{Duration, Instant};
use tests::random::Random;
use tests::until::{PATIENCE, until};

const SEED: u64 = 56;
const PASSWORD: &str = "correct horse";

/// A browser of this user.
fn user(daemon: &Daemon, name: &str) -> Browser {
    let mut browser = Browser::new(daemon);
    let body = json!({ "user": name, "secret": PASSWORD });
    let (status, answer) = browser.json("POST", "/api/session", &body);
    assert_eq!(status, 200, "{answer}");
    browser
}

fn record(place: &Place) -> ChangeRecord {
    ChangeRecord::of(&place.path("state"), 16 << 20)
}

#[test]
fn a_state_folder_of_before_users_works_unchanged_with_the_secret_alone() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let secret = secret(&daemon);
    assert!(daemon.terminate().success());
    // As the program before wrote them: no numbers, no hashes, no end of the record.
    let access = place.path("state/access");
    let line = "{\"utc_us\":null,\"uptime_s\":3,\"boot_id\":\"0000b007\",\"from\":\"127.0.0.1\",\"action\":\"sign in\",\"subject\":\"session\",\"outcome\":\"done\",\"changed\":null}\n";
    fs::write(access.join("changes.jsonl"), line.repeat(3)).unwrap();
    let counter = place.path("state/result-seq");
    let text = fs::read_to_string(&counter).unwrap();
    fs::write(&counter, format!("{}\n", &text[..47])).unwrap();
    let daemon = Daemon::start(&place);
    let mut script = Browser::new(&daemon);
    let (status, answer) = script.json("POST", "/api/session", &json!({ "secret": secret }));
    assert_eq!(
        (status, &answer["signed_in"]),
        (200, &json!(true)),
        "{answer}"
    );
    script.ready();
    assert_eq!(script.measure()["seq"], 1);
    // What engineers alone may, the secret may as before.
    let (status, _) = script.json("PUT", "/api/simulation/part", &json!({ "part": "plane" }));
    assert_eq!(status, 200);
    let changes = script.get("/api/changes");
    assert_eq!(changes["changes"].as_array().unwrap().len(), 6);
    let report = record(&place).check().unwrap();
    assert_eq!(
        (report.lines, report.unnumbered, report.problems),
        (3, 3, vec![])
    );
    // Without signing in everybody looks, as before.
    let mut viewer = Browser::new(&daemon);
    assert_eq!(viewer.get("/api/snapshot")["counters"]["sequence"], 1);
    let (status, _) = viewer.json("POST", "/api/trigger", &json!({}));
    assert_eq!(status, 401);
}

fn secret(daemon: &Daemon) -> String {
    let (_, rest) = daemon.log.split_once("shown this once: ").unwrap();
    rest.split(' ').next().unwrap().to_owned()
}

#[test]
fn a_thousand_changes_by_three_users_are_all_in_the_chain_whenever_the_program_is_killed() {
    const CHANGES: usize = 1000;
    let place = Place::taught();
    let names = ["anna", "bob", "carl"];
    let mut daemon = Some(Daemon::start(&place));
    let mut engineer = Browser::new(daemon.as_ref().unwrap());
    engineer.sign_in(daemon.as_ref().unwrap());
    for name in names {
        let body = json!({ "role": "operator", "secret": PASSWORD });
        let (status, answer) = engineer.json("PUT", &format!("/api/users/{name}"), &body);
        assert_eq!(status, 200, "{answer}");
    }
    let mut random = Random::new(SEED);
    let (mut done, mut kills) = (Vec::new(), 0);
    while done.len() < CHANGES {
        let running = match daemon.take() {
            Some(running) => running,
            None => Daemon::start(&place),
        };
        let mut users = names.map(|name| user(&running, name));
        for _ in 0..100 {
            let who = random.below(3);
            let (status, answer) = users[who].json("POST", "/api/reset", &json!({}));
            assert_eq!(status, 202, "{answer}");
            done.push(names[who]);
        }
        // Killed while further changes are under way: of those nobody knows whether they were done.
        let wait = Duration::from_micros(random.below(20_000) as u64);
        std::thread::scope(|scope| {
            for user in &mut users {
                scope.spawn(move || {
                    let mut stream = user.begin("POST", "/api/reset", 0);
                    let _ = stream.flush();
                    std::thread::sleep(Duration::from_millis(15));
                });
            }
            std::thread::sleep(wait);
            running.kill();
        });
        kills += 1;
    }
    assert_eq!(kills, CHANGES / 100);
    let report = record(&place).check().unwrap();
    assert_eq!(report.problems, Vec::<String>::new());
    let lines = record(&place).list(&Default::default()).unwrap();
    for name in names {
        let told = done.iter().filter(|who| **who == name).count();
        let of_user = |line: &&Value| line["user"] == name && line["action"] == "reset errors";
        let stored = lines.iter().filter(of_user).count();
        // One may have been stored that was not answered any more, at each kill.
        assert!(
            (told..=told + kills).contains(&stored),
            "{name}: {stored} of {told}"
        );
    }
    // A line that is changed is found, by the command as well.
    let file = place.path("state/access/changes.jsonl");
    let text = fs::read_to_string(&file).unwrap();
    let altered = text.replacen("\"anna\"", "\"carl\"", 1);
    assert_ne!(altered, text);
    fs::write(&file, altered).unwrap();
    let checked = Command::new(FRINGED)
        .args(["changes", "--check", "--state"])
        .arg(place.path("state"))
        .output()
        .unwrap();
    assert_eq!(checked.status.code(), Some(65));
    let said = String::from_utf8_lossy(&checked.stdout).into_owned();
    assert!(said.contains("was changed"), "{said}");
}

#[test]
fn what_the_plc_and_the_command_line_change_is_recorded_with_address_and_uid() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    plc.wait("READY", |status| status.has(READY));
    // The first write of a connection is no edge.
    plc.write(0, &[1]);
    assert_eq!(select(&mut plc, 1, false), 0);
    plc.wait("READY", |status| status.has(READY));
    let exported = place.path("1.recipe");
    let run = |arguments: &[&str]| {
        let ran = Command::new(FRINGED)
            .args(arguments)
            .arg("--config")
            .arg(place.path("fringed.toml"))
            .output()
            .unwrap();
        assert!(
            ran.status.success(),
            "{}",
            String::from_utf8_lossy(&ran.stderr)
        );
        String::from_utf8_lossy(&ran.stdout).into_owned()
    };
    let file = exported.to_str().unwrap();
    run(&["recipe", "export", "1", file]);
    run(&["recipe", "import", file, "--number", "7"]);
    let uid = rustix::process::getuid().as_raw();
    let lines = until("both lines", PATIENCE, || {
        let lines = record(&place).list(&Default::default()).unwrap();
        (lines.len() >= 2).then_some(lines).ok_or(())
    });
    let line = |way: &str| lines.iter().find(|line| line["way"] == way).unwrap();
    let (plc, command) = (line("plc"), line("command-line"));
    assert_eq!(
        (&plc["from"], &plc["action"], &plc["recipe"]),
        (&json!("127.0.0.1"), &json!("load recipe"), &json!(1))
    );
    assert_eq!(
        (&command["from"], &command["action"], &command["recipe"]),
        (
            &json!(format!("uid {uid}")),
            &json!("import recipe"),
            &json!(7)
        )
    );
    let listed = Browser::new(&daemon).get("/api/recipes");
    assert_eq!(listed["recipes"][1]["made_by"], format!("uid {uid}"));
    assert_eq!(
        record(&place).check().unwrap().problems,
        Vec::<String>::new()
    );
    assert!(run(&["changes"]).contains("PLC 127.0.0.1"));
    assert!(run(&["changes", "--csv", "--recipe", "7"]).lines().count() == 2);
}

/// Status of a guess from an address of this machine, and how long it took.
fn guess(
    runtime: &tokio::runtime::Runtime,
    http: SocketAddr,
    from: [u8; 4],
    body: &str,
) -> (u16, Duration) {
    let connected = async {
        let socket = tokio::net::TcpSocket::new_v4()?;
        socket.bind((Ipv4Addr::from(from), 0).into())?;
        socket.connect(http).await?.into_std()
    };
    let mut stream: TcpStream = runtime.block_on(connected).unwrap();
    stream.set_nonblocking(false).unwrap();
    let began = Instant::now();
    let text = format!(
        "POST /api/session HTTP/1.1\r\nHost: {http}\r\nOrigin: http://{http}\r\nConnection: close\r\nContent-Length: {}\r\n\r\n{body}",
        body.len()
    );
    stream.write_all(text.as_bytes()).unwrap();
    let mut answer = String::new();
    let _ = stream.read_to_string(&mut answer);
    let status = answer.get(9..12).and_then(|status| status.parse().ok());
    (status.unwrap_or(0), began.elapsed())
}

#[test]
fn ten_thousand_guesses_open_nothing_tell_nothing_and_keep_nobody_else_out() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let mut engineer = Browser::new(&daemon);
    engineer.sign_in(&daemon);
    for name in ["anna", "bob"] {
        let body = json!({ "role": "technician", "secret": PASSWORD });
        assert_eq!(
            engineer.json("PUT", &format!("/api/users/{name}"), &body).0,
            200
        );
    }
    let http = daemon.http;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    let guess = |from, body: &str| guess(&runtime, http, from, body);
    let body = |name: &str, number: u32| {
        format!("{{\"user\":\"{name}\",\"secret\":\"guess number {number}\"}}")
    };
    // Each from an address of its own, so that none waits: a name that exists answers as one that does not.
    let mut took = [Vec::new(), Vec::new()];
    for host in 1..=2 {
        for (at, name) in ["anna", "nobody"].into_iter().enumerate() {
            let (status, time) = guess([127, 1, host, at as u8 + 1], &body(name, 0));
            assert_eq!(status, 403);
            took[at].push(time);
        }
    }
    // Both hash: neither answers in a tenth of the other's time.
    let least = took
        .each_ref()
        .map(|took| took.iter().min().copied().unwrap());
    assert!(
        least[0] < 10 * least[1] && least[1] < 10 * least[0],
        "{took:?}"
    );
    let mut statuses = std::collections::BTreeMap::new();
    for number in 0..5000_u32 {
        let (status, _) = guess([127, 0, 0, 9], &body("anna", number));
        *statuses.entry(status).or_insert(0) += 1;
        let from = [127, 2, 0, (number % 100) as u8 + 1];
        let (status, _) = guess(from, &body("anna", number));
        *statuses.entry(status).or_insert(0) += 1;
    }
    assert!(
        statuses.keys().all(|status| [403, 429].contains(status)),
        "{statuses:?}"
    );
    assert!(statuses[&403] < 20, "{statuses:?}");
    // Others sign in meanwhile, also from an address that nobody guessed from.
    let mut bob = user(&daemon, "bob");
    assert_eq!(bob.get("/api/session")["user"], "bob");
    let mut stranger = Browser::new(&daemon);
    for cookie in ["0", "", &"f".repeat(64)] {
        stranger.cookie = format!("fringed-session={cookie}");
        assert_eq!(stranger.get("/api/session")["signed_in"], false);
    }
    // The record has the guesses that were tried, and the changes of before.
    let lines = record(&place).list(&Default::default()).unwrap();
    assert!(lines.len() < 40, "{} lines", lines.len());
    assert_eq!(
        record(&place).check().unwrap().problems,
        Vec::<String>::new()
    );
}
