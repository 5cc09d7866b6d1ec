//! A start that restores is killed at each of its steps.

use super::{backup, collected, measured, ordered, place, seqs, started};
use crate::page::Browser;
use crate::power::can_trace;
use crate::station_plc::command;
use serde_json::{Value, json};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use tests::until::PATIENCE;

/// More system calls of a kind than a restore makes.
const MOST_STEPS: usize = 60;

/// The state as a whole: recipe, calibration and results, of which two are compared.
#[derive(Debug, PartialEq)]
struct Whole {
    name: Value,
    results: Vec<u64>,
    users: usize,
}

fn whole(browser: &mut Browser) -> Whole {
    let (_, results) = collected(browser, 0);
    Whole {
        name: browser.get("/api/recipes/1")["name"].clone(),
        results: seqs(&results),
        users: browser.get("/api/users")["users"].as_array().unwrap().len(),
    }
}

#[test]
fn a_restore_that_is_killed_at_any_rename_leaves_the_old_state_or_the_new_one_whole() {
    killed_at_each(&["rename"]);
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn a_restore_that_is_killed_at_any_step_leaves_the_old_state_or_the_new_one_whole() {
    killed_at_each(&[
        "fsync",
        "fdatasync",
        "pwrite64",
        "unlink",
        "mkdir",
        "openat",
    ]);
}

/// Kills the start that restores at the first, second and so on of these system calls, until a start
/// is through before.
fn killed_at_each(calls: &[&str]) {
    if !can_trace() {
        return;
    }
    let place = place();
    let (daemon, mut browser) = started(&place);
    measured(&mut browser);
    let zip = backup(&mut browser, "?users=true&recordings=true");
    let body = json!({ "role": "operator", "secret": "135790" });
    assert_eq!(browser.json("PUT", "/api/users/anna", &body).0, 200);
    let fingerprint = browser.get("/api/recipes/1")["fingerprint"].clone();
    let edit = json!({ "fingerprint": fingerprint, "name": "later" });
    assert_eq!(browser.json("PUT", "/api/recipes/1", &edit).0, 200);
    browser.ready();
    measured(&mut browser);
    let old = whole(&mut browser);
    let mut daemon = Some(daemon);
    let mut steps = 0;
    // Restores and takes back in turn, killed at the next call that renames, links, writes or syncs.
    for (at, call) in calls.iter().enumerate() {
        for step in 1.. {
            let running = daemon.take().unwrap();
            match (at + step) % 2 {
                0 => drop(ordered(
                    &mut browser,
                    &zip,
                    &json!({ "what": "everything" }),
                )),
                _ => {
                    let undone = browser.json("POST", "/api/restore/undo", &json!({}));
                    // At first there is nothing to take back.
                    if undone.0 != 200 {
                        ordered(&mut browser, &zip, &json!({ "what": "everything" }));
                    }
                }
            }
            assert!(running.terminate().success());
            let plain = command(&place);
            let mut killed = Command::new("strace");
            killed
                .args([
                    "-f",
                    "-qq",
                    "-o",
                    "/dev/null",
                    "-e",
                    &format!("trace={call}"),
                ])
                .args(["-e", &format!("inject={call}:signal=SIGKILL:when={step}")])
                .arg(plain.get_program())
                .args(plain.get_args())
                .stdin(Stdio::null())
                .stdout(Stdio::null())
                .stderr(Stdio::null());
            let mut child = killed.spawn().unwrap();
            let order = place.path("state/restore/order.json");
            let began = Instant::now();
            // Killed at the step, or the restore is done: then the step is behind it.
            while child.try_wait().unwrap().is_none() && order.exists() {
                assert!(began.elapsed() < PATIENCE);
                std::thread::sleep(Duration::from_millis(5));
            }
            let survived = child.try_wait().unwrap().is_none();
            if survived {
                let _ = Command::new("pkill")
                    .args(["-KILL", "-P", &child.id().to_string()])
                    .status();
                let _ = child.wait();
            }
            let began = Instant::now();
            let (again, now) = started(&place);
            assert!(began.elapsed() < PATIENCE);
            browser = now;
            let state = whole(&mut browser);
            let is_old =
                state.name == old.name && state.users == old.users && state.results.contains(&2);
            let is_new =
                state.name != old.name && state.users == old.users && !state.results.contains(&2);
            assert!(is_old || is_new, "{call} {step}: {state:?}");
            daemon = Some(again);
            steps += 1;
            if survived || step == MOST_STEPS {
                break;
            }
        }
    }
    assert!(steps > 6, "{steps}");
    println!("{steps} kills");
}
