//! `fringed demo`: runs the station and plays its PLC over real Modbus TCP, as a PLC programmer would
//! write it.

use super::options::{Output, Serving};
use crate::config::Backend;
use crate::error::{Exit, Failure, Result};
use crate::recipe::{LoadError, Store};
use crate::service::{Caller, Daemon};
use crate::storage::state::StateFolder;
use crate::system::caller::StopSignal;
use crate::system::runtime;
use serde_json::{Value, json};
use sim::Part;
use sim::parts::{Defect, SheetMetal};
use std::fmt::Write as _;
use std::io::IsTerminal;
use std::net::SocketAddr;
use std::time::{Duration, Instant};
use tokio_modbus::client::{Context, Reader as _, Writer as _, tcp};

/// First register of the RESULT block, and its length.
const RESULT: (u16, u16) = (200, 120);
/// STATUS, its READY bit.
const STATUS: u16 = 100;
const READY: u16 = 1 << 1;
/// TRIGGER_TOKEN; RECIPE_SELECT, PLC_HEARTBEAT, PART_ID and PRESS_STROKE follow.
const TRIGGER_TOKEN: u16 = 1;
/// Period of polling, and longest wait for a result.
const POLL: Duration = Duration::from_millis(20);
const PATIENCE: Duration = Duration::from_secs(30);

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
struct DemoResult {
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
        self.output.answer(&json(&rows), || table(&rows))?;
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

impl DemoResult {
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
) -> Result<Vec<DemoResult>> {
    let Some(stage) = &daemon.stage else {
        return Exit::Software.fail("demo: there is no simulated head");
    };
    // Other noise than that of the golden measurement.
    stage.reseed(NOISE_SEED);
    let mut plc = DemoPlc::connect(daemon.modbus, recipe).await?;
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
        rows.push(DemoResult {
            placed,
            result,
            outside,
        });
    }
    Ok(rows)
}

/// A part that is put in front of the head.
pub struct DemoPart {
    /// For people.
    pub what: &'static str,
    /// Its defect, if it has one.
    pub defect: Option<Defect>,
}

const GOOD: DemoPart = DemoPart {
    what: "good",
    defect: None,
};

/// Seven good parts, and one each with a dent, a missing hole and a bent flange.
pub const PARTS: [DemoPart; 10] = [
    GOOD,
    GOOD,
    DemoPart {
        what: "dent 0.6 mm",
        defect: Some(Defect::Dent {
            x: 0.0,
            y: -8.0,
            depth_mm: 0.6,
            diameter_mm: 14.0,
        }),
    },
    GOOD,
    GOOD,
    DemoPart {
        what: "missing hole",
        defect: Some(Defect::MissingHole { index: 1 }),
    },
    GOOD,
    DemoPart {
        what: "bent flange 3°",
        defect: Some(Defect::BentFlange { degrees: 3.0 }),
    },
    GOOD,
    GOOD,
];

impl DemoPart {
    /// The part as the simulator takes it.
    pub fn part(&self) -> Part {
        Part::SheetMetal(SheetMetal {
            defects: self.defect.into_iter().collect(),
            ..SheetMetal::default()
        })
    }
}

/// A connected PLC.
pub struct DemoPlc {
    context: Context,
    /// The recipe of the parts on this line.
    recipe: u16,
}

/// A result as the registers tell it.
#[derive(Clone, Debug)]
pub struct PlcResult {
    /// RESULT_SEQ.
    pub seq: u32,
    /// 1 PASS, 2 FAIL, 3 INVALID.
    pub verdict: u16,
    /// Value of each of the first slots in mm or as a share; NaN = invalid or empty.
    pub values: Vec<f32>,
    /// Whether the gauge of each of these slots passes.
    pub passes: Vec<bool>,
    /// Trigger → exposure done, µs.
    pub exposure_us: u32,
    /// Trigger → result, µs.
    pub total_us: u32,
}

impl PlcResult {
    /// The verdict's word.
    pub fn word(&self) -> &'static str {
        match self.verdict {
            1 => "PASS",
            2 => "FAIL",
            3 => "INVALID",
            _ => "none",
        }
    }

    /// Whether the verdict is PASS.
    pub fn passed(&self) -> bool {
        self.verdict == 1
    }

    fn from_words(words: &[u16]) -> Self {
        let long = |first: usize| u32::from(words[first]) << 16 | u32::from(words[first + 1]);
        let gauges = usize::from(words[27]).min(16);
        Self {
            seq: long(0),
            verdict: words[8],
            values: (0..gauges)
                .map(|k| f32::from_bits(long(64 + 2 * k)))
                .collect(),
            passes: (0..gauges).map(|k| words[96 + k] & 1 == 1).collect(),
            exposure_us: long(18),
            total_us: long(20),
        }
    }
}

fn lost(error: impl std::fmt::Display) -> Failure {
    Failure::because(
        Exit::Unavailable,
        "demo: talk Modbus TCP to the station",
        error,
    )
}

impl DemoPlc {
    /// Connects to the station, to measure parts with this recipe.
    ///
    /// # Errors
    /// If there is no answer.
    pub async fn connect(address: SocketAddr, recipe: u16) -> Result<Self> {
        let context = tcp::connect(address).await.map_err(lost)?;
        Ok(Self { context, recipe })
    }

    async fn read(&mut self, address: u16, count: u16) -> Result<Vec<u16>> {
        let answer = self.context.read_holding_registers(address, count).await;
        answer.map_err(lost)?.map_err(lost)
    }

    /// Waits for READY, triggers with the token, which is also the PART_ID, and waits for the
    /// result. RECIPE_SELECT is written with the trigger, so that no part is measured with another
    /// recipe.
    ///
    /// # Errors
    /// If the station does not answer in time.
    pub async fn measure(&mut self, token: u16) -> Result<PlcResult> {
        let started = Instant::now();
        let patient = |what: &str| {
            if started.elapsed() < PATIENCE {
                Ok(())
            } else {
                Err(lost(format!("no {what} within {PATIENCE:?}")))
            }
        };
        while self
            .read(STATUS, 1)
            .await?
            .first()
            .is_none_or(|status| status & READY == 0)
        {
            patient("READY")?;
            tokio::time::sleep(POLL).await;
        }
        let trigger = [token, self.recipe, token, 0, token, 0, token];
        let written = self
            .context
            .write_multiple_registers(TRIGGER_TOKEN, &trigger)
            .await;
        written.map_err(lost)?.map_err(lost)?;
        loop {
            let words = self.read(RESULT.0, RESULT.1).await?;
            if words.len() == usize::from(RESULT.1) && words[2] == token {
                return Ok(PlcResult::from_words(&words));
            }
            patient("result")?;
            tokio::time::sleep(POLL).await;
        }
    }
}

/// As aligned text.
fn table(rows: &[DemoResult]) -> String {
    let mut table = String::from(
        "part  placed           verdict  deviation  coverage  exposed    result  outside its limits\n",
    );
    for (at, row) in rows.iter().enumerate() {
        let result = &row.result;
        let value = |gauge: usize| result.values.get(gauge).copied().unwrap_or(f32::NAN);
        // Writing to a string cannot fail.
        let _ = writeln!(
            table,
            "{:>4}  {:<15}  {:<7}  {:>+6.3} mm  {:>6.2} %  {:>4} ms  {:>5} ms  {}",
            at + 1,
            row.placed.what,
            result.word(),
            value(0),
            value(1) * 100.0,
            result.exposure_us / 1000,
            result.total_us / 1000,
            outside(row),
        );
    }
    table
}

/// "slot 1 deviation, slot 3 opening"; "-" if no gauge is outside its limits.
fn outside(row: &DemoResult) -> String {
    let names = row.outside.iter();
    let names: Vec<_> = names
        .map(|(slot, name)| format!("slot {slot} {name}"))
        .collect();
    match names.is_empty() {
        true => "-".into(),
        false => names.join(", "),
    }
}

/// As JSON: one object per part.
fn json(rows: &[DemoResult]) -> Value {
    rows.iter()
        .enumerate()
        .map(|(at, row)| {
            json!({
                "part": at + 1,
                "placed": row.placed.what,
                "verdict": row.result.word(),
                "seq": row.result.seq,
                "values": row.result.values,
                "outside": row.outside.iter().map(|(_, name)| name).collect::<Vec<_>>(),
                "slots_outside": row.outside.iter().map(|(slot, _)| slot).collect::<Vec<_>>(),
                "exposure_us": row.result.exposure_us,
                "total_us": row.result.total_us,
            })
        })
        .collect()
}
