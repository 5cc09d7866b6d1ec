//! The program `fringed-fleet`: everything is in the library, so that tests can reach it.

fn main() -> std::process::ExitCode {
    fringed_fleet::main()
}
