//! The program `fringed-lab`: everything is in the library, so that tests can reach it.

fn main() -> std::process::ExitCode {
    fringed_lab::cli::main()
}
