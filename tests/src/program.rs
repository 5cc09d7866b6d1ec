//! Running the program and keeping its output.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc;
use std::time::Duration;

/// A run that takes longer is killed: a program that should have refused its input may serve for
/// ever instead.
pub const LONGEST: Duration = Duration::from_secs(600);

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

    /// Runs it with arguments until it ends, at most [`LONGEST`]; fails if it panicked.
    pub fn run<A: AsRef<OsStr>>(&self, arguments: &[A]) -> Run {
        let child = Command::new(&self.path)
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program can be started");
        let pid = child.id().to_string();
        let (ended, wait) = mpsc::channel::<()>();
        std::thread::spawn(move || {
            if wait.recv_timeout(LONGEST) == Err(mpsc::RecvTimeoutError::Timeout) {
                // It is killed, so its exit code is −1.
                let _ = Command::new("kill").args(["-KILL", &pid]).status();
            }
        });
        let output = child.wait_with_output().expect("its output can be read");
        drop(ended);
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
