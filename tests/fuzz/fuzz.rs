//! Runs a target of the crate `tests` under libFuzzer; `--target=NAME` selects it. The script `run`
//! builds and starts this program.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::sync::OnceLock;
use tests::fuzz::Target;

static TARGET: OnceLock<Target> = OnceLock::new();

/// The target named by `--target=NAME`; libFuzzer ignores options that begin with two dashes.
fn chosen() -> Target {
    let mut names = std::env::args().filter_map(|argument| argument.strip_prefix("--target=").map(str::to_owned));
    let name = names.next().expect("--target=NAME");
    tests::fuzz::target(&name).expect("a target of this name")
}

fuzz_target!(|data: &[u8]| TARGET.get_or_init(chosen)(data));
