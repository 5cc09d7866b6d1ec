//! `fringed doctor`: runs the checks of the head, and prints a verdict and a remedy for each.

use super::options::Measuring;
use crate::config::Backend;
use crate::error::{Exit, Result};
use crate::head::doctor::{Check, CheckVerdict, computer, examine};
use crate::production::backend;
use crate::system::computing;
use crate::system::host::Host;
use serde_json::json;
use std::path::PathBuf;

/// Examine the head: devices, format, mode, flips, trigger, light, exposure, delay, contrast, grey
/// response, geometry.
#[derive(Debug, clap::Args)]
pub struct Doctor {
    /// Examine a simulated head of this scenario instead of the configured head.
    #[arg(long, value_name = "FILE", conflicts_with = "state")]
    scenario: Option<PathBuf>,
    #[command(flatten)]
    measuring: Measuring,
}

impl Doctor {
    /// Opens the head, examines it and prints what was found.
    ///
    /// # Errors
    /// If the head cannot be opened, or a check failed (69).
    pub fn run(&self) -> Result<()> {
        let options = &self.measuring;
        let why = "doctor: a recording cannot be examined";
        let mut config = options.live(self.scenario.as_ref(), why)?;
        config.head = options.files.head(&config);
        if self.scenario.is_some() {
            // The stored calibration belongs to the configured head.
            config.head.calibration = None;
        }
        let progress = options.output.progress();
        let on_progress =
            |share: f64| progress.tell(0.5 * share, "working out the light of the scene");
        let pool = options.threads.pool(config.threads)?;
        let mut opened = pool.install(|| backend::open_as_it_is(&config.head, &on_progress))?;
        let calibrated = opened.problem.is_none();
        let on_progress = |share: f64, name: &str| progress.tell(0.5 + 0.5 * share, name);
        let real = config.head.backend == Backend::Rpi;
        let trigger = real.then_some(&config.head.trigger);
        let host = Host::default();
        let prompt = computing::prompt(host.isolated_core());
        let mut checks = computer::examine(&host, &config.lines, trigger, prompt);
        checks.extend(pool.install(|| {
            examine(
                &mut opened.head,
                &opened.calibration,
                calibrated,
                &on_progress,
            )
        }));
        let state = opened.head.controller();
        checks.extend(state.as_ref().map(computer::controller));
        progress.clear();
        let failed = checks
            .iter()
            .filter(|check| check.verdict == CheckVerdict::Fail);
        let failed: Vec<&str> = failed.map(|check| check.name).collect();
        let document = json!({ "healthy": failed.is_empty(), "steps": checks });
        options.output.answer(&document, || table(&checks))?;
        if failed.is_empty() {
            return Ok(());
        }
        Exit::Unavailable.fail(format!(
            "doctor: the head is not well: {}",
            failed.join(", ")
        ))
    }
}

fn table(checks: &[Check]) -> String {
    let mut lines = String::new();
    for check in checks {
        lines += &format!(
            "{:9} {:8} {}\n",
            check.name,
            check.verdict.word(),
            check.found
        );
        if !check.remedy.is_empty() {
            lines += &format!("{:18} → {}\n", "", check.remedy);
        }
    }
    lines
}
