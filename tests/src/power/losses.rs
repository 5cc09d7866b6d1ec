//! A run of the program that loses power again and again.

use super::Operation;
use super::disk::{Disk, Left};
use crate::random::Random;
use std::fs;
use std::path::Path;

const SEED: u64 = 0x0FF_0FF;
/// The most that are named of what is wrong, and how much of each.
const NAMED: usize = 10;
const LONGEST: usize = 400;

/// A loss of power.
#[derive(Clone, Copy, Debug)]
pub struct Loss {
    /// When: just before the next operation, µs since 1970.
    pub time: u64,
    /// Whether nothing is left of what was not certain.
    pub leaves_nothing: bool,
}

/// Replays a run on a disk, with three losses of power after every `step`-th operation, of which
/// `check` says what is wrong with the folder that is left. Returns how many there were.
///
/// # Panics
/// If something is wrong, or a folder cannot be written.
pub fn losses(
    mut disk: Disk,
    operations: &[Operation],
    step: usize,
    mut check: impl FnMut(Loss, &Path) -> Result<(), String>,
) -> usize {
    let folder = tempfile::tempdir().expect("a folder");
    let mut random = Random::new(SEED);
    let mut broken = Vec::new();
    let mut losses = 0;
    for (at, operation) in operations.iter().enumerate() {
        disk.apply(operation);
        if at % step != 0 {
            continue;
        }
        let next = operations.get(at + 1);
        let time = next.map_or(u64::MAX, |next| next.done) - 1;
        for kind in 0..3 {
            let mut left = match kind {
                0 => Left::Nothing,
                1 => Left::All,
                _ => Left::Some(&mut random),
            };
            let target = folder.path().join(format!("{at}-{kind}"));
            disk.leave(&mut left, &target).expect("what is left");
            losses += 1;
            let loss = Loss {
                time,
                leaves_nothing: kind == 0,
            };
            if let Err(words) = check(loss, &target) {
                broken.push(format!("{at}, {kind}: {words}, after {:?}", operation.what));
            }
            fs::remove_dir_all(&target).expect("removed");
        }
    }
    let named = broken.iter().take(NAMED);
    let named: Vec<String> = named
        .map(|words| words.chars().take(LONGEST).collect())
        .collect();
    let count = broken.len();
    assert!(broken.is_empty(), "{count} of {losses}: {named:#?}");
    println!(
        "{losses} losses of power in {} operations",
        operations.len()
    );
    losses
}
