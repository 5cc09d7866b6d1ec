//! Hostile archives: refused by name, and nothing is touched.

use super::{backup, place, started};
use crate::history::recording;
use crate::page::Browser;
use appliance::storage::archive::Members;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::io::Cursor;
use std::path::Path;
use std::time::{Duration, Instant};
use tests::archives::{Entry, zip};
use tests::files;
use tests::random::Random;
use tests::until::{PATIENCE, until};

const SEED: u64 = 5656;

/// Members of a ZIP as entries.
fn entries(archive: &[u8]) -> Vec<Entry> {
    let mut members = Members::open(Cursor::new(archive), 65_535).unwrap();
    let names: Vec<String> = members.names().map(str::to_owned).collect();
    let read = |name: &String| Entry::new(name, members.content(name, 1 << 30).unwrap());
    names.iter().map(read).collect()
}

/// The entry of this name, changed, and the manifest made to agree with it.
fn forged(entries: &[Entry], name: &str, change: impl Fn(Vec<u8>) -> Vec<u8>) -> Vec<Entry> {
    let mut entries = entries.to_vec();
    let place = |entries: &[Entry], name: &str| {
        entries.iter().position(|entry| entry.name == name).unwrap()
    };
    let at = place(&entries, name);
    entries[at].content = change(std::mem::take(&mut entries[at].content));
    let (bytes, hash) = (
        entries[at].content.len(),
        files::sha256(&entries[at].content),
    );
    let at = place(&entries, "manifest.json");
    let mut manifest: Value = serde_json::from_slice(&entries[at].content).unwrap();
    for member in manifest["members"].as_array_mut().unwrap() {
        if member["name"] == name {
            (member["bytes"], member["sha256"]) = (json!(bytes), json!(hash));
        }
    }
    entries[at].content = manifest.to_string().into_bytes();
    entries
}

/// The manifest changed.
fn with_manifest(entries: &[Entry], change: impl Fn(&mut Value)) -> Vec<Entry> {
    let mut entries = entries.to_vec();
    for entry in entries
        .iter_mut()
        .filter(|entry| entry.name == "manifest.json")
    {
        let mut manifest = serde_json::from_slice(&entry.content).unwrap();
        change(&mut manifest);
        entry.content = manifest.to_string().into_bytes();
    }
    entries
}

fn replaced(text: Vec<u8>, from: &str, to: &str) -> Vec<u8> {
    let text = String::from_utf8(text).unwrap();
    assert!(text.contains(from), "{from}: {text}");
    text.replace(from, to).into_bytes()
}

/// Archives that are refused, each with a word of the reason.
fn hostile(good: &[u8]) -> Vec<(&'static str, Vec<u8>)> {
    let good_entries = entries(good);
    let with = |more: Vec<Entry>| zip(&[good_entries.clone(), more].concat());
    let named = |name: &str| {
        let member = json!({ "name": name, "bytes": 1, "sha256": files::sha256(b"x") });
        let listed = with_manifest(&good_entries, |manifest| {
            let members = manifest["members"].as_array_mut().unwrap();
            members.push(member.clone());
        });
        zip(&[listed, vec![Entry::new(name, *b"x")]].concat())
    };
    let one = |change: &dyn Fn(&mut Entry)| {
        let mut entries = good_entries.clone();
        change(&mut entries[0]);
        zip(&entries)
    };
    let manifest = |change: &dyn Fn(&mut Value)| zip(&with_manifest(&good_entries, change));
    let users = |from: &str, to: &str| {
        zip(&forged(&good_entries, "access/users.json", |text| {
            replaced(text, from, to)
        }))
    };
    let mut all = vec![
        ("no ZIP", b"nothing".to_vec()),
        ("no backup", zip(&[Entry::new("x", *b"x")])),
        ("compressed", one(&|entry| entry.method = 8)),
        // A bomb: a few bytes that say they are gigabytes.
        (
            "compressed",
            one(&|entry| (entry.method, entry.said) = (8, Some(u32::MAX - 1))),
        ),
        ("", one(&|entry| entry.said = Some(4_000_000_000))),
        ("overlap", {
            let mut entries = good_entries.clone();
            entries.push(Entry {
                at: Some(0),
                ..Entry::new("history.db2", vec![0; 100])
            });
            zip(&entries)
        }),
        ("same name", with(vec![good_entries[0].clone()])),
        (
            "links or folders",
            with(vec![Entry {
                mode: 0o120_777,
                ..Entry::new("commissioning.json", *b"/etc/passwd")
            }]),
        ),
        (
            "links or folders",
            with(vec![Entry {
                mode: 0o040_755,
                ..Entry::new("recipes/", *b"")
            }]),
        ),
        (
            "not those",
            with(vec![Entry::new("recipes/0009.recipe", *b"x")]),
        ),
        ("", zip(&vec![Entry::new("x", *b""); 70_000])),
        ("no backup has", named("../escaped")),
        ("no backup has", named("/tmp/escaped")),
        ("no backup has", named("recipes/../../escaped")),
        ("no backup has", named("access/secret")),
        ("no backup has", named("restore/order.json")),
        ("no backup has", named("result-seq/x")),
        (
            "not what the manifest says",
            zip(&good_entries
                .iter()
                .cloned()
                .map(|mut entry| {
                    if entry.name == "fringed.toml" {
                        entry.content.push(b' ');
                    }
                    entry
                })
                .collect::<Vec<_>>()),
        ),
        ("version 2", manifest(&|m| m["version"] = json!(2))),
        ("version 0", manifest(&|m| m["version"] = json!(0))),
        ("format", manifest(&|m| m["format"] = json!("other"))),
        ("serial", manifest(&|m| m["serial"] = json!("../../x"))),
        ("serial", manifest(&|m| m["serial"] = json!(""))),
        ("manifest.json", manifest(&|m| m["more"] = json!(1))),
        (
            "twice",
            manifest(&|m| {
                let first = m["members"][0].clone();
                m["members"].as_array_mut().unwrap().push(first);
            }),
        ),
        (
            "not those",
            manifest(&|m| drop(m["members"].as_array_mut().unwrap().pop())),
        ),
        ("users.json", users("\"operator\"", "\"root\"")),
        ("users.json", users("\"anna\"", "\"engineer\"")),
        (
            "users.json",
            users("\"pin\": true", "\"pin\": true, \"admin\": true"),
        ),
        ("users.json", users("\"operator\"", "\"engineer\"")),
        ("users.json", users("m=19456", "m=4194304")),
        (
            "history",
            zip(&forged(&good_entries, "history.db", |_| {
                b"SQLite format 3\0".to_vec()
            })),
        ),
        (
            "history",
            zip(&forged(&good_entries, "history.db", |mut file| {
                file.truncate(file.len() / 2);
                file
            })),
        ),
        (
            "no history has",
            zip(&forged(&good_entries, "history.db", with_a_trigger)),
        ),
    ];
    all.push((
        "manifest.json",
        zip(&good_entries
            .iter()
            .cloned()
            .map(|mut entry| {
                if entry.name == "manifest.json" {
                    entry.content = vec![b'['; 1 << 20];
                }
                entry
            })
            .collect::<Vec<_>>()),
    ));
    all
}

/// The database with a trigger that would delete what is stored.
fn with_a_trigger(file: Vec<u8>) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("history.db");
    fs::write(&path, file).unwrap();
    let connection = rusqlite::Connection::open(&path).unwrap();
    let trigger = "CREATE TRIGGER wipe AFTER INSERT ON result BEGIN DELETE FROM result; END";
    connection.execute_batch(trigger).unwrap();
    drop(connection);
    fs::read(path).unwrap()
}

/// The hash of every file of a state that a restore could touch.
fn touched(state: &Path) -> BTreeMap<String, String> {
    let mut all = BTreeMap::new();
    let mut waiting = vec![state.to_path_buf()];
    while let Some(folder) = waiting.pop() {
        for name in files::names(&folder) {
            let path = folder.join(&name);
            let inside = path
                .strip_prefix(state)
                .unwrap()
                .to_str()
                .unwrap()
                .to_owned();
            match path.is_dir() {
                true => waiting.push(path),
                // Each refusal is recorded.
                false if inside.starts_with("access/changes") || inside == "result-seq" => {}
                false => drop(all.insert(inside, files::sha256(&fs::read(&path).unwrap()))),
            }
        }
    }
    all
}

#[test]
fn a_thousand_hostile_archives_are_refused_by_name_and_touch_nothing() {
    const ALL: usize = 1000;
    /// Most of the program's memory, KiB.
    const MOST_KIB: u64 = 200 << 10;
    let place = place();
    let (daemon, mut browser) = started(&place);
    browser.measure();
    recording(&place, 1);
    let body = json!({ "role": "operator", "secret": "135790" });
    assert_eq!(browser.json("PUT", "/api/users/anna", &body).0, 200);
    let good = backup(&mut browser, "?users=true");
    let state = place.path("state");
    // The database's log is brought in when nothing has come for a second.
    until("settled database", PATIENCE, || {
        let before = touched(&state);
        std::thread::sleep(Duration::from_millis(2500));
        (touched(&state) == before).then_some(()).ok_or(())
    });
    let before = touched(&state);
    let outside = files::names(&place.path(""));
    let mut longest = Duration::ZERO;
    let mut refuse = |browser: &mut Browser, zip: &[u8], word: &str| {
        let began = Instant::now();
        let (status, answer) = browser.ask("POST", "/api/restore", zip);
        longest = longest.max(began.elapsed());
        let words = String::from_utf8_lossy(&answer).into_owned();
        assert_eq!(status, 422, "{word}: {words}");
        assert!(words.contains(word), "{word}: {words}");
    };
    let named = hostile(&good);
    for (word, zip) in &named {
        refuse(&mut browser, zip, word);
    }
    // Any byte that is changed, any cut.
    let mut random = Random::new(SEED);
    let manifest = entries(&good)
        .into_iter()
        .find(|entry| entry.name == "manifest.json")
        .unwrap();
    let tail = manifest.content.len();
    for case in named.len()..ALL {
        let mut zip = good.clone();
        match case % 3 {
            0 => zip.truncate(random.below(zip.len())),
            // In the bytes of members, which have hashes.
            1 => {
                let at = 40 + random.below(zip.len() - 2 * tail - 4000);
                let from = at.min(zip.len() - 200);
                for byte in &mut zip[from..from + 120] {
                    *byte = !*byte;
                }
            }
            _ => {
                let from = zip.len() - 22 - random.below(400);
                for byte in &mut zip[from..] {
                    *byte = random.below(256) as u8;
                }
            }
        }
        refuse(&mut browser, &zip, "restore: ");
    }
    assert!(longest < PATIENCE, "{longest:?}");
    assert_eq!(touched(&state), before);
    assert_eq!(files::names(&place.path("")), outside);
    let status = fs::read_to_string(format!("/proc/{}/status", daemon.pid())).unwrap();
    let peak = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))
        .unwrap();
    let peak: u64 = peak.trim().trim_end_matches(" kB").parse().unwrap();
    assert!(peak < MOST_KIB, "{peak} KiB");
    println!("{ALL} archives, at most {longest:?}, peak {peak} KiB");
    // The good one is still taken.
    let (status, _) = browser.ask("POST", "/api/restore", &good);
    assert_eq!(status, 200);
}
