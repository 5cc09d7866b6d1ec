//! Tests of the model of a disk: what is synced stays, and what is not may be lost in part.

use super::disk::{Disk, Left};
use super::{Operation, What};
use crate::random::Random;
use std::fs;

const SEED: u64 = 0x0FF_0FF;

/// A run of operations one after the other.
fn sequence(all: Vec<What>) -> Vec<Operation> {
    let operation = |(at, what): (usize, What)| Operation {
        asked: 10 * at as u64,
        done: 10 * at as u64 + 5,
        what,
    };
    all.into_iter().enumerate().map(operation).collect()
}

fn open(path: &str) -> What {
    What::Open {
        path: path.into(),
        empty: true,
    }
}

fn write(path: &str, bytes: &[u8]) -> What {
    What::Write {
        path: path.into(),
        at: Some(0),
        bytes: bytes.into(),
    }
}

/// The different contents of `name` that losses of power after all operations may leave; `None`
/// where it does not exist.
fn left_of(name: &str, all: Vec<What>) -> Vec<Option<Vec<u8>>> {
    left_of_each([name], all)
        .into_iter()
        .map(|[content]| content)
        .collect()
}

/// The same of several names at once.
fn left_of_each<const N: usize>(names: [&str; N], all: Vec<What>) -> Vec<[Option<Vec<u8>>; N]> {
    let folder = tempfile::tempdir().unwrap();
    let mut disk = Disk::default();
    for operation in sequence(all) {
        disk.apply(&operation);
    }
    let mut random = Random::new(SEED);
    let mut found = Vec::new();
    for at in 0..40 {
        let mut left = match at {
            0 => Left::Nothing,
            1 => Left::All,
            _ => Left::Some(&mut random),
        };
        let target = folder.path().join(at.to_string());
        disk.leave(&mut left, &target).unwrap();
        found.push(names.map(|name| fs::read(target.join(name)).ok()));
    }
    found.sort();
    found.dedup();
    found
}

#[test]
fn what_is_not_synced_may_be_lost_and_what_is_synced_stays() {
    let old = || Some(b"old".to_vec());
    let new = || Some(b"new".to_vec());
    let synced = || vec![open("a"), write("a", b"old"), What::Sync("a".into())];
    assert_eq!(left_of("a", synced()), [old()]);
    let renamed = || What::Rename {
        from: "b".into(),
        to: "a".into(),
    };
    let whole = [
        open("b"),
        write("b", b"new"),
        What::Sync("b".into()),
        renamed(),
    ];
    let replaced: Vec<What> = synced().into_iter().chain(whole.clone()).collect();
    // The old or the new content; after the folder's sync only the new one.
    assert_eq!(left_of("a", replaced.clone()), [new(), old()]);
    let certain = replaced
        .into_iter()
        .chain([What::Sync("".into())])
        .collect();
    assert_eq!(left_of("a", certain), [new()]);
    // A file that was not synced before it got its name may be empty.
    let hasty = synced()
        .into_iter()
        .chain([open("b"), write("b", b"new"), renamed()])
        .collect();
    assert_eq!(left_of("a", hasty), [Some(vec![]), new(), old()]);
}

#[test]
fn a_folder_that_is_removed_may_be_there_with_a_part_of_its_files() {
    let made = [
        What::Folder("f".into()),
        open("f/1"),
        write("f/1", b"one"),
        What::Sync("f/1".into()),
        open("f/2"),
        write("f/2", b"two"),
        What::Sync("f/2".into()),
    ];
    let removed = [
        What::Remove("f/1".into()),
        What::Remove("f/2".into()),
        What::Remove("f".into()),
    ];
    assert_eq!(left_of("f/2", made.to_vec()), [Some(b"two".to_vec())]);
    let all = || made.iter().chain(&removed).cloned().collect();
    assert_eq!(left_of("f/1", all()), [None, Some(b"one".to_vec())]);
    assert_eq!(left_of("f/2", all()), [None, Some(b"two".to_vec())]);
}

#[test]
fn a_rename_into_another_folder_happens_in_both_or_in_neither() {
    let renamed = |more: &[What]| {
        let made = [
            What::Folder("f".into()),
            What::Folder("g".into()),
            open("f/a"),
            open("g/b"),
            What::SyncAll,
            What::Remove("g/b".into()),
            What::Rename {
                from: "f/a".into(),
                to: "g/a".into(),
            },
        ];
        let all = [&made[..], more].concat();
        left_of_each(["f/a", "g/a", "g/b"], all)
    };
    let is = |there: bool| there.then(Vec::new);
    let (before, after) = (
        [is(true), is(false), is(false)],
        [is(false), is(true), is(false)],
    );
    let with_other = [is(true), is(false), is(true)];
    assert_eq!(renamed(&[]), [after.clone(), before, with_other]);
    // What is synced in one folder is certain in the other.
    for synced in ["f", "g", "g/a"] {
        assert_eq!(
            renamed(&[What::Sync(synced.into())]),
            std::slice::from_ref(&after)
        );
    }
}

#[test]
fn a_write_over_several_sectors_may_be_torn() {
    let long = vec![7; 2000];
    let torn = left_of(
        "a",
        vec![open("a"), What::Sync("a".into()), write("a", &long)],
    );
    let part = |left: &Option<Vec<u8>>| {
        left.as_ref()
            .is_some_and(|bytes| bytes.contains(&0) && bytes.contains(&7))
    };
    assert!(
        torn.iter().any(part) && torn.contains(&Some(long)),
        "{torn:?}"
    );
}
