//! Running the program and keeping its output.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The program under test.
#[derive(Clone, Debug)]
pub struct Program {
    path: PathBuf,
}

/// Exit code and output of a run.
#[derive(Clone, Debug)]
pub struct Run {
    /// The exit code; −1 if a signal ended it.
    pub code: i32,
    /// Its standard output.
    pub stdout: String,
    /// Its standard error.
    pub stderr: String,
}

impl Program {
    /// The program at `path`.
    pub fn at(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into() }
    }

    /// Runs it with arguments until it ends; fails if it panicked.
    pub fn run<A: AsRef<OsStr>>(&self, arguments: &[A]) -> Run {
        let output = Command::new(&self.path)
            .args(arguments)
            .output()
            .expect("the program can be started");
        let run = Run {
            code: output.status.code().unwrap_or(-1),
            stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
            stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
        };
        assert!(!run.stderr.contains("panicked"), "{}", run.stderr);
        run
    }

    /// Runs `measure RECORDING --out OUT`, followed by `more` arguments.
    pub fn measure(&self, recording: &Path, out: &Path, more: &[&str]) -> Run {
        let mut arguments = vec![
            OsStr::new("measure"),
            recording.as_os_str(),
            OsStr::new("--out"),
            out.as_os_str(),
        ];
        arguments.extend(more.iter().map(OsStr::new));
        self.run(&arguments)
    }
}

impl Run {
    /// Checks that the exit code is 0.
    pub fn succeeded(self) -> Self {
        assert_eq!(self.code, 0, "{}", self.stderr);
        self
    }
}
