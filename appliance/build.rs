//! Tells the program which commit it was built from.
//!
//! The first of these that is there: the environment variable `FRINGED_COMMIT`, for packagers; the
//! name that `git archive` wrote into the file `commit` of a tarball; the answer of git. Only builds
//! without debug assertions ask git, so that a commit costs development and tests no new
//! compilation.

use std::path::Path;
use std::process::Command;

/// What the program is made of. Uncommitted changes elsewhere do not count.
const SOURCES: [&str; 5] = ["algo", "hal", "appliance", "Cargo.toml", "Cargo.lock"];
/// Digits of a commit's name: enough for one of many.
const DIGITS: usize = 12;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=commit");
    println!("cargo::rerun-if-env-changed=FRINGED_COMMIT");
    let version = std::env::var("CARGO_PKG_VERSION").unwrap_or_default();
    let version = match commit() {
        Some(commit) => format!("{version} ({commit})"),
        None => version,
    };
    println!("cargo::rustc-env=FRINGED_VERSION={version}");
}

fn commit() -> Option<String> {
    from_environment().or_else(from_archive).or_else(from_git)
}

fn from_environment() -> Option<String> {
    let commit = std::env::var("FRINGED_COMMIT").ok()?;
    Some(commit.trim().to_owned()).filter(|commit| !commit.is_empty())
}

fn from_archive() -> Option<String> {
    let name = std::fs::read_to_string("commit").ok()?;
    // In a working copy the file still holds the placeholder.
    let name = name.trim().get(..DIGITS)?;
    let is_one = name.chars().all(|c| c.is_ascii_hexdigit());
    is_one.then(|| name.to_owned())
}

fn from_git() -> Option<String> {
    if std::env::var_os("CARGO_CFG_DEBUG_ASSERTIONS").is_some() {
        return None;
    }
    let root = Path::new("..").canonicalize().ok()?;
    // A tarball that was unpacked inside another project's repository does not belong to its
    // commits.
    let top = git(&root, &["rev-parse", "--show-toplevel"])?;
    if Path::new(&top).canonicalize().ok()? != root {
        return None;
    }
    let commit = git(&root, &["rev-parse", "HEAD"])?
        .get(..DIGITS)?
        .to_owned();
    // Every commit and every checkout adds a line there; a file that is not there would be new each
    // time.
    let moves = root.join(git(&root, &["rev-parse", "--git-path", "logs/HEAD"])?);
    if moves.exists() {
        println!("cargo::rerun-if-changed={}", moves.display());
    }
    for source in SOURCES {
        println!("cargo::rerun-if-changed=../{source}");
    }
    let differences = [
        &["status", "--porcelain", "--untracked-files=no", "--"],
        &SOURCES[..],
    ];
    let changed = git(&root, &differences.concat())?;
    Some(match changed.is_empty() {
        true => commit,
        false => format!("{commit}, changed"),
    })
}

/// What git answers, unless it fails or is not there.
fn git(root: &Path, arguments: &[&str]) -> Option<String> {
    let mut command = Command::new("git");
    let output = command.current_dir(root).args(arguments).output().ok()?;
    let answer = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| answer.trim().to_owned())
}
