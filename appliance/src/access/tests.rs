//! Secrets, users and guesses; the record and its chain.

use super::patience::{FREE_GUESSES, LONGEST_WAIT};
use super::record::{FILES, RecordFilter};
use super::*;
use crate::storage::state::{Counted, Counter};
use std::fs;
use std::net::Ipv6Addr;

const HERE: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);
const PASSWORD: &str = "correct horse battery";

fn open(folder: &Path) -> (Access, Option<NewSecret>) {
    let opened = Access::open(folder, None, ChangeRecord::of(folder, 1 << 20)).unwrap();
    assert_eq!(opened.complaint, None);
    (opened.access, opened.made)
}

/// With an operator anna, who has a PIN, and a technician bob.
fn with_users() -> (tempfile::TempDir, Access) {
    let folder = tempfile::tempdir().unwrap();
    let (access, _) = open(folder.path());
    let by = (Some(1), ENGINEER);
    let set = |name, role, password| access.set_user(name, role, Some(password), by).unwrap();
    assert!(set("anna", Role::Operator, "135790").pin);
    assert!(!set("bob", Role::Technician, PASSWORD).pin);
    (folder, access)
}

#[test]
fn the_secret_is_shown_once_and_opens_after_every_restart() {
    let folder = tempfile::tempdir().unwrap();
    let now = Instant::now();
    let (access, shown) = open(folder.path());
    let secret = shown.unwrap().secret;
    let (token, signed) = access.sign_in(HERE, None, &secret, now).unwrap();
    assert_eq!(signed.role, Role::Engineer);
    assert_eq!(access.signed_in(token.text(), now), Some(signed));
    access.sign_out(token.text());
    assert_eq!(access.signed_in(token.text(), now), None);
    let (access, shown) = open(folder.path());
    assert_eq!(shown, None);
    // As people write it down: without dashes, in small letters.
    let typed = secret.replace('-', " ").to_lowercase();
    assert!(access.sign_in(HERE, None, &typed, now).is_ok());
}

#[test]
fn a_secret_that_was_given_goes_before_the_stored_one_and_leaves_it_alone() {
    let (folder, given) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let file = given.path().join("secret");
    let open = || {
        let record = ChangeRecord::of(folder.path(), 1 << 20);
        let opened = Access::open(folder.path(), Some(&file), record).unwrap();
        (opened.access, opened.made)
    };
    let now = Instant::now();
    fs::write(&file, "0123A-BCDEF-GHJKM").unwrap();
    let (access, shown) = open();
    assert!(shown.is_none() && !folder.path().join("secret").exists());
    assert!(access.sign_in(HERE, None, "0123A-BCDEF-GHJKM", now).is_ok());
    fs::remove_file(&file).unwrap();
    let (access, shown) = open();
    assert!(
        access
            .sign_in(HERE, None, &shown.unwrap().secret, now)
            .is_ok()
    );
    assert!(
        access
            .sign_in(HERE, None, "0123A-BCDEF-GHJKM", now)
            .is_err()
    );
}

#[test]
fn wrong_guesses_make_their_address_wait_and_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let (access, secret) = open(folder.path());
    let (secret, now) = (secret.unwrap().secret, Instant::now());
    for _ in 0..FREE_GUESSES {
        assert_eq!(
            access.sign_in(HERE, None, "guess", now),
            Err(Refused::Wrong)
        );
    }
    let waiting = access.sign_in(HERE, None, &secret, now);
    assert!(matches!(waiting, Err(Refused::Wait(_))), "{waiting:?}");
    let other = IpAddr::from([10, 0, 0, 7]);
    assert!(access.sign_in(other, None, &secret, now).is_ok());
    let later = now + LONGEST_WAIT;
    assert!(access.sign_in(HERE, None, &secret, later).is_ok());
}

#[test]
fn two_devices_never_share_a_secret_and_the_file_does_not_hold_it() {
    let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    let secrets = folders
        .each_ref()
        .map(|folder| open(folder.path()).1.unwrap().secret);
    assert_ne!(secrets[0], secrets[1]);
    let stored = fs::read_to_string(folders[0].path().join("secret")).unwrap();
    assert!(stored.starts_with("$argon2id$"), "{stored}");
    assert!(!stored.contains(&secrets[0]));
}

#[test]
fn a_damaged_secret_file_is_put_aside_and_lets_nobody_in_but_with_a_new_secret() {
    let folder = tempfile::tempdir().unwrap();
    let now = Instant::now();
    let (_, before) = open(folder.path());
    let before = before.unwrap().secret;
    for damaged in [&b"$argon2id$broken"[..], b"", b"\xff\xfe"] {
        fs::write(folder.path().join("secret"), damaged).unwrap();
        let (access, shown) = open(folder.path());
        let NewSecret { secret, complaint } = shown.unwrap();
        assert!(complaint.unwrap().contains("put aside as secret.damaged"));
        assert!(access.sign_in(HERE, None, &before, now).is_err());
        assert!(access.sign_in(HERE, None, &secret, now).is_ok());
        let kept = fs::read(folder.path().join("secret.damaged")).unwrap();
        assert_eq!(kept, damaged);
        let again = open(folder.path()).1;
        assert_eq!(again, None);
    }
}

#[test]
fn users_sign_in_by_name_and_password_and_lose_their_session_with_either() {
    let (folder, access) = with_users();
    let now = Instant::now();
    let sign_in = |name: &str, password: &str| access.sign_in(HERE, Some(name), password, now);
    let (token, signed) = sign_in("ANNA", "135790").unwrap();
    assert_eq!(signed.to_string(), "anna (operator)");
    let signed_in = || {
        access
            .signed_in(token.text(), now)
            .map(|signed| signed.role)
    };
    // A role that changes counts at once, a password ends the session.
    access
        .set_user("Anna", Role::Viewer, None, (None, "bob"))
        .unwrap();
    assert_eq!(signed_in(), Some(Role::Viewer));
    access
        .set_user("anna", Role::Operator, Some("246802"), (None, "bob"))
        .unwrap();
    assert_eq!(signed_in(), None);
    assert_eq!(sign_in("anna", "135790").unwrap_err(), Refused::WrongUser);
    let (token, _) = sign_in("anna", "246802").unwrap();
    access.remove_user("ANNA").unwrap();
    assert_eq!(access.signed_in(token.text(), now), None);
    assert_eq!(sign_in("anna", "246802").unwrap_err(), Refused::WrongUser);
    // What is stored opens after a restart, and holds no password.
    let (access, _) = open(folder.path());
    assert!(access.sign_in(HERE, Some("bob"), PASSWORD, now).is_ok());
    let stored = fs::read_to_string(folder.path().join(users::FILE)).unwrap();
    assert!(!stored.contains("horse") && stored.contains("$argon2id$"));
    assert!(access.users().iter().all(|user| user.hash.is_empty()));
}

#[test]
fn what_no_user_may_be_is_refused_with_the_remedy() {
    let (_folder, access) = with_users();
    let set = |name: &str, role, password| {
        let set = access.set_user(name, role, password, (None, ENGINEER));
        set.unwrap_err().to_string()
    };
    for (name, role, password, words) in [
        ("anna", Role::Technician, None, "give a password"),
        ("anna", Role::Technician, Some("135790"), "12 characters"),
        ("carl", Role::Operator, None, "is new"),
        ("Engineer", Role::Viewer, Some(PASSWORD), "device's secret"),
        ("a b", Role::Viewer, Some(PASSWORD), "letters, digits"),
        ("", Role::Viewer, Some(PASSWORD), "letters, digits"),
        ("..", Role::Viewer, Some(PASSWORD), "letters, digits"),
    ] {
        let refused = set(name, role, password);
        assert!(refused.contains(words), "{name:?}: {refused}");
    }
    assert!(access.remove_user("engineer").is_err());
    assert!(matches!(
        access.remove_user("carl"),
        Err(UserError::Unknown(_))
    ));
}

#[test]
fn guesses_about_a_name_wait_from_every_address_whether_it_exists_or_not_and_keep_no_other_out() {
    let (_folder, access) = with_users();
    let now = Instant::now();
    let from = |host: u8| IpAddr::from([10, 0, 0, host]);
    for name in ["bob", "nobody"] {
        let mut answers = Vec::new();
        for host in 1..=100 {
            let guess = access.sign_in(from(host), Some(name), "guess", now);
            answers.push(guess.unwrap_err());
        }
        let tried = answers
            .iter()
            .filter(|answer| **answer == Refused::WrongUser);
        assert_eq!(tried.count(), FREE_GUESSES as usize, "{name}");
    }
    let right = access.sign_in(from(200), Some("bob"), PASSWORD, now);
    assert!(matches!(right, Err(Refused::Wait(_))), "{right:?}");
    assert!(
        access
            .sign_in(from(200), Some("anna"), "135790", now)
            .is_ok()
    );
    assert!(
        access
            .sign_in(from(200), Some("bob"), PASSWORD, now + LONGEST_WAIT)
            .is_ok()
    );
}

#[test]
fn a_host_with_many_ipv6_addresses_is_one_guesser() {
    let (_folder, access) = with_users();
    let now = Instant::now();
    let from = |net: u16, host: u16| Ipv6Addr::new(0xfd00, 1, 2, net, host, 0, 0, host).into();
    for host in 0..FREE_GUESSES as u16 {
        let name = format!("nobody{host}");
        access
            .sign_in(from(3, host), Some(&name), "guess", now)
            .unwrap_err();
    }
    let waits = |net| {
        access
            .sign_in(from(net, 9), Some("bob"), PASSWORD, now)
            .is_err()
    };
    assert!(waits(3) && !waits(4));
}

fn record(state: &Path, most: u64) -> ChangeRecord {
    ChangeRecord::of(state, most)
}

fn change(subject: &str) -> Change {
    Change {
        user: Some("anna".into()),
        role: Some(Role::Operator),
        ..Change::of_command("edit recipe", subject.into())
    }
}

/// A record of nine lines in a state folder.
fn nine() -> (tempfile::TempDir, ChangeRecord) {
    let folder = tempfile::tempdir().unwrap();
    let record = record(folder.path(), 1 << 20);
    for number in 1..=9 {
        record.add(&change(&format!("recipes/{number}"))).unwrap();
    }
    (folder, record)
}

#[test]
fn what_a_loss_of_power_leaves_of_the_last_line_is_dropped() {
    // Without an end, and with sectors that are missing.
    for torn in [&b"{\"number\":10,\"prev"[..], b"\0\0\0\0vious\":\"12\"}\n"] {
        let (folder, record) = nine();
        let path = folder.path().join("access").join(FILES[0]);
        let whole = fs::read(&path).unwrap();
        fs::write(&path, [&whole, torn].concat()).unwrap();
        let report = || {
            let found = record.check().unwrap();
            (found.lines, found.unnumbered, found.problems)
        };
        assert_eq!(report(), (9, 0, vec![]));
        let list = record.list(&RecordFilter::default()).unwrap();
        assert_eq!((list.len(), &list[0]["subject"]), (9, &"recipes/9".into()));
        record.add(&change("recipes/7/load")).unwrap();
        assert_eq!(report(), (10, 0, vec![]));
    }
}

#[test]
fn a_last_line_that_was_answered_and_then_damaged_is_kept_and_said_to_be_missing() {
    let (folder, record) = nine();
    let path = folder.path().join("access").join(FILES[0]);
    let damaged = fs::read_to_string(&path)
        .unwrap()
        .replace("{\"number\":9", "{number:9");
    fs::write(&path, &damaged).unwrap();
    for problem in ["line 9 is missing at the end", "line 9 is missing"] {
        let problems = record.check().unwrap().problems;
        assert!(problems.contains(&problem.to_owned()), "{problems:?}");
        record.add(&change("recipes/7/load")).unwrap();
    }
    assert!(fs::read_to_string(&path).unwrap().starts_with(&damaged));
}

#[test]
fn changes_are_read_back_newest_first_and_filtered() {
    let (_folder, record) = nine();
    record.add(&change("recipes/7/load")).unwrap();
    let of = |filter: RecordFilter| record.list(&filter).unwrap().len();
    assert_eq!(
        of(RecordFilter {
            recipe: Some(7),
            ..Default::default()
        }),
        2
    );
    assert_eq!(
        of(RecordFilter {
            user: Some("bob".into()),
            ..Default::default()
        }),
        0
    );
    assert_eq!(
        of(RecordFilter {
            before: Some(4),
            limit: Some(2),
            ..Default::default()
        }),
        2
    );
    assert_eq!(
        of(RecordFilter {
            until_us: Some(1),
            ..Default::default()
        }),
        0
    );
}

#[test]
fn a_line_that_was_changed_removed_or_moved_and_an_end_that_was_cut_off_are_told_apart() {
    let found = |alter: &dyn Fn(&mut Vec<String>)| {
        let (folder, record) = nine();
        let path = folder.path().join("access").join(FILES[0]);
        let text = fs::read_to_string(&path).unwrap();
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        alter(&mut lines);
        fs::write(&path, lines.join("\n") + "\n").unwrap();
        record.check().unwrap().problems.join("; ")
    };
    assert_eq!(found(&|_| {}), "");
    let changed = found(&|lines| lines[3] = lines[3].replace("anna", "bob"));
    assert_eq!(changed, "line 4 was changed");
    let last = found(&|lines| lines[8] = lines[8].replace("anna", "bob"));
    assert!(last.contains("line 9, the last"), "{last}");
    assert_eq!(found(&|lines| drop(lines.remove(3))), "line 4 is missing");
    assert_eq!(
        found(&|lines| drop(lines.drain(2..5))),
        "lines 3 to 5 are missing"
    );
    let moved = found(&|lines| lines.swap(3, 4));
    assert!(moved.contains("line 4 stands behind line 5"), "{moved}");
    let cut = found(&|lines| lines.truncate(7));
    assert_eq!(cut, "lines 8 to 9 are missing at the end");
    let begin = found(&|lines| drop(lines.drain(..2)));
    assert_eq!(begin, "lines 1 to 2 are missing at the beginning");
    let damaged = found(&|lines| lines[3] = "{}".into());
    assert!(
        damaged.contains("the line before 5 was changed"),
        "{damaged}"
    );
    assert_eq!(found(&Vec::clear), "all lines are missing");
    // A line behind a cut end does not hide it.
    let (folder, record) = nine();
    let path = folder.path().join("access").join(FILES[0]);
    let text = fs::read_to_string(&path).unwrap();
    let kept: Vec<&str> = text.lines().take(7).collect();
    fs::write(&path, kept.join("\n") + "\n").unwrap();
    record.add(&change("recipes/1")).unwrap();
    let problems = record.check().unwrap().problems;
    assert_eq!(problems, ["lines 8 to 9 are missing"]);
}

#[test]
fn the_record_stays_bounded_and_dropped_lines_are_told_from_missing_ones() {
    let folder = tempfile::tempdir().unwrap();
    let most = 64 << 10;
    let record = record(folder.path(), most);
    for number in 0..400 {
        record
            .add(&change(&format!("{number} {}", "x".repeat(400))))
            .unwrap();
    }
    let sizes = FILES.map(|name| {
        let file = folder.path().join("access").join(name);
        fs::metadata(file).unwrap().len()
    });
    assert!(sizes.iter().sum::<u64>() < most + 2048, "{sizes:?}");
    let report = record.check().unwrap();
    assert_eq!((report.last, report.problems), (Some(400), vec![]));
    assert!(report.first.unwrap() > 1);
    // Both files are of the chain: without the older one lines are missing.
    fs::remove_file(folder.path().join("access").join(FILES[1])).unwrap();
    let problems = record.check().unwrap().problems;
    assert!(problems[0].contains("at the beginning"), "{problems:?}");
}

#[test]
fn the_record_of_an_older_program_goes_on_and_the_counter_keeps_its_numbers() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("access")).unwrap();
    let path = folder.path().join("access").join(FILES[0]);
    let old = "{\"utc_us\":1,\"from\":\"10.0.0.7\",\"action\":\"trigger\",\"subject\":\"trigger\",\"outcome\":\"done\"}\n";
    fs::write(&path, old.repeat(2)).unwrap();
    let counter = Counter::of(folder.path());
    let counted = Counted {
        last: 41,
        run: 7,
        ..Counted::default()
    };
    counter.store(counted).unwrap();
    let record = record(folder.path(), 1 << 20);
    record.add(&change("recipes/1")).unwrap();
    record.add(&change("recipes/2")).unwrap();
    let report = record.check().unwrap();
    assert_eq!(
        (report.lines, report.unnumbered, report.problems),
        (2, 2, vec![])
    );
    assert_eq!(record.list(&RecordFilter::default()).unwrap().len(), 4);
    assert_eq!(Counted::in_folder(folder.path()).unwrap(), counted);
    // Numbers of results do not touch the end of the record.
    counter
        .store(Counted {
            last: 99,
            ..counted
        })
        .unwrap();
    assert_eq!(record.check().unwrap().problems, Vec::<String>::new());
    fs::write(
        &path,
        old.to_owned() + &fs::read_to_string(&path).unwrap()[2 * old.len()..],
    )
    .unwrap();
    assert_eq!(record.check().unwrap().problems, Vec::<String>::new());
    let altered = fs::read_to_string(&path)
        .unwrap()
        .replace("10.0.0.7", "10.0.0.8");
    fs::write(&path, altered).unwrap();
    assert_eq!(
        record.check().unwrap().problems,
        ["the line before 1 was changed"]
    );
}

#[test]
fn the_one_who_made_a_version_of_a_recipe_is_known_by_its_fingerprint() {
    let (_folder, record) = nine();
    for (user, fingerprint) in [("anna", "aa"), ("bob", "bb"), ("carl", "aa")] {
        let mut change = change("recipes/7");
        (change.user, change.fingerprint) = (Some(user.into()), Some(fingerprint.into()));
        record.add(&change).unwrap();
    }
    let makers = record.makers().unwrap();
    assert_eq!(makers["aa"], "carl (operator)");
    assert_eq!((&*makers["bb"], makers.len()), ("bob (operator)", 2));
}

#[test]
fn many_writers_append_whole_lines_to_one_chain() {
    let folder = tempfile::tempdir().unwrap();
    let writers: Vec<_> = (0..4)
        .map(|writer| {
            let record = record(folder.path(), 1 << 20);
            std::thread::spawn(move || {
                for number in 0..25 {
                    record.add(&change(&format!("{writer}/{number}"))).unwrap();
                }
            })
        })
        .collect();
    for writer in writers {
        writer.join().unwrap();
    }
    let report = record(folder.path(), 1 << 20).check().unwrap();
    assert_eq!((report.lines, report.problems), (100, vec![]));
}

#[test]
fn a_spreadsheet_takes_nothing_in_the_record_for_a_formula() {
    let line =
        serde_json::json!({ "number": 7, "user": "-1", "changed": "=1+1, \"a\"", "recipe": null });
    let found = record::csv_line(&line);
    assert_eq!(found, "7,,,,,,\"'-1\",,,,,\"'=1+1, \"\"a\"\"\",,\r\n");
}
