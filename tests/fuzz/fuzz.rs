//! libFuzzer around the targets of the crate `tests`; `--target=NAME` chooses one. `run` beside this file builds and starts it.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::sync::OnceLock;
use tests::fuzz::Target;

static TARGET: OnceLock<Target> = OnceLock::new();

/// libFuzzer leaves options that begin with two dashes to the program.
fn chosen() -> Target {
    let mut names = std::env::args().filter_map(|argument| argument.strip_prefix("--target=").map(str::to_owned));
    let name = names.next().expect("--target=NAME");
    tests::fuzz::target(&name).expect("a target of this name")
}

fuzz_target!(|data: &[u8]| TARGET.get_or_init(chosen)(data));
