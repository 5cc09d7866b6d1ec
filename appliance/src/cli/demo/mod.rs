//! `fringed demo`: runs the station and plays its PLC over real Modbus TCP.

mod parts;
mod plc;
mod table;

use super::options::{Output, Serving};
use crate::config::Backend;
use crate::error::{Exit, Result};
use crate::recipe::{LoadError, Store};
use crate::service::{Caller, Daemon};
use crate::storage::state::StateFolder;
use crate::system::caller::StopSignal;
use crate::system::runtime;
use parts::{DemoPart, PARTS};
use plc::{Plc, PlcResult};
use std::io::IsTerminal;

/// Run the station and play the PLC.
#[derive(Debug, clap::Args)]
pub struct Demo {
    /// End after the table; the default where stdout is no terminal.
    #[arg(long)]
    exit: bool,
    #[command(flatten)]
    serving: Serving,
    #[command(flatten)]
    output: Output,
}

/// Seed of the noise of the demonstration's frames.
const NOISE_SEED: u64 = 2008;

/// One part of the demonstration and its result.
struct MeasuredPart {
    placed: &'static DemoPart,
    result: PlcResult,
    /// Slots and names of the gauges outside their limits.
    outside: Vec<(u16, String)>,
}

impl Demo {
    /// Starts the station, measures ten parts, prints the table, and on a terminal serves the page
    /// until Ctrl-C.
    ///
    /// # Errors
    /// If the station cannot start or answer, or judges a part wrongly.
    pub fn run(&self) -> Result<()> {
        let mut config = self.serving.configuration()?;
        if config.head.backend != Backend::Sim || config.head.scenario.is_some() {
            return Exit::Usage
                .fail("demo: it brings its own parts: leave out head.backend and head.scenario");
        }
        if config.state.is_none() {
            // Not the state of the real station, whose recipes stay unchanged.
            let state = StateFolder::default_path()?.join("demo");
            forget_unusable(&StateFolder::open(&state)?, config.station.recipe)?;
            config.state = Some(state);
        }
        let progress = self.output.progress();
        let pool = self.serving.threads.pool(config.threads)?;
        let daemon = Daemon::start(&config, pool, progress.clone(), &Caller::default())?;
        daemon.wait_until_ready()?;
        progress.log(&format!(
            "page on http://{}, Modbus TCP on {}",
            daemon.http, daemon.modbus
        ));
        let recipe = config.station.recipe;
        let rows = runtime()?.block_on(play(&daemon, recipe, &progress));
        progress.clear();
        let rows = rows?;
        self.output
            .answer(&table::json(&rows), || table::text(&rows))?;
        if !self.exit && std::io::stdout().is_terminal() {
            if !self.output.is_json() {
                say!("\nThe page stays on http://{} until Ctrl-C.", daemon.http);
            }
            runtime()?.block_on(StopSignal::listen()?.wait());
        }
        daemon.stop();
        let wrong = rows.iter().filter(|row| row.is_wrong()).count();
        if wrong > 0 {
            let message = format!("demo: {wrong} of {} parts were judged wrongly", rows.len());
            return Exit::Software.fail(message);
        }
        Ok(())
    }
}

impl MeasuredPart {
    /// A good part that did not pass, or a defective one that did.
    fn is_wrong(&self) -> bool {
        self.placed.defect.is_some() == self.result.passed()
    }
}

/// Deletes the recipe of the demonstration's own folder if it cannot be used, e.g. because another
/// version of the program taught it: the station teaches the part again at its start.
fn forget_unusable(state: &StateFolder, number: u16) -> Result<()> {
    let recipes = Store::of_state(state)?;
    if let Err(LoadError::Unfit { .. } | LoadError::Corrupt { .. }) = recipes.load(number) {
        recipes.delete(number)?;
    }
    Ok(())
}

/// Places ten parts one after the other and triggers a measurement of each.
async fn play(
    daemon: &Daemon,
    recipe: u16,
    progress: &crate::system::progress::Progress,
) -> Result<Vec<MeasuredPart>> {
    let Some(stage) = &daemon.stage else {
        return Exit::Software.fail("demo: there is no simulated head");
    };
    // Other noise than that of the golden measurement.
    stage.reseed(NOISE_SEED);
    let mut plc = Plc::connect(daemon.modbus, recipe).await?;
    let mut rows = Vec::with_capacity(PARTS.len());
    for (at, placed) in PARTS.iter().enumerate() {
        progress.tell(at as f64 / PARTS.len() as f64, "measuring parts");
        stage
            .place(&placed.part(), &sim::Placement::default())
            .map_err(Exit::Software.failure())?;
        let result = plc.measure(at as u16 + 1).await?;
        // The names of the slots are taken from the station.
        let snapshot = daemon.station.snapshot();
        let gauges = snapshot
            .result
            .iter()
            .flat_map(|record| &record.inspection.gauges);
        let fails = |slot: u16| result.passes.get(usize::from(slot) - 1) == Some(&false);
        let outside = gauges
            .filter(|gauge| fails(gauge.slot))
            .map(|gauge| (gauge.slot, gauge.name.to_string()))
            .collect();
        rows.push(MeasuredPart {
            placed,
            result,
            outside,
        });
    }
    Ok(rows)
}
