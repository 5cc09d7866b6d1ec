//! The last program of `cargo test --release --workspace`: prints how many tests were skipped because the shared
//! recordings are not beside the project. It has no tests of its own; the suite marks the tests
//! that it skips.

use std::fs;
use tests::{files, shared};

fn main() {
    let marks = shared::marks();
    let skipped = files::names(&marks);
    // Removed, so that a later run with the recordings finds no marks.
    let _ = fs::remove_dir_all(&marks);
    if !skipped.is_empty() {
        println!(
            "{} tests SKIPPED: their recordings are not in {}",
            skipped.len(),
            shared::recordings().display()
        );
        for test in skipped {
            println!("    {test}");
        }
    }
}
