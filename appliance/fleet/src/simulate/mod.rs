//! `fringed-fleet simulate`: answers as many heads would, from one process, without light.
//!
//! Nothing is stored. A result is a pure function of (seed, head, history, seq), and its time is
//! the start of its history + seq / rate, so an independent program can work out which rows a store
//! must have (`tests/fleet/plant.py`). Head N answers below `/h/N/`, N with four digits:
//! `api/results`, `api/history.csv`, `api/snapshot`, `api/recipes`, `api/recipes/R/file`,
//! `api/diagnostics.zip`, `metrics`, `healthz`.

mod answer;
mod body;
mod csv;
mod fault;
mod gauge;
mod head;
mod health;
mod hostile;
mod row;
mod serve;

#[cfg(test)]
mod tests;

use crate::error::{Exit, Result};
use fault::Fault;
use gauge::Gauge;
use head::Plant;
use std::sync::{Arc, Mutex};
use tokio::net::TcpListener;

/// The most heads: their numbers have four digits.
const MOST_HEADS: u32 = 9999;
/// The most gauges of a result, as of a recipe.
const MOST_GAUGES: u16 = 64;

/// Answer as many heads would, without light.
#[derive(Clone, Debug, clap::Args)]
pub struct Simulate {
    /// Heads, below /h/0001/, /h/0002/ and so on.
    #[arg(long, default_value_t = 30, value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_HEADS)))]
    heads: u32,
    /// Results per second of each head.
    #[arg(long, default_value_t = 1.0)]
    rate: f64,
    /// Address that is listened at.
    #[arg(long, default_value = "127.0.0.1:8200")]
    listen: String,
    /// Seed of every value and of the times of faults.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// What goes wrong, each on one head in twenty: silence, slow, restart, renew, cut, endless,
    /// line, serial, falling, nan, redirect.
    #[arg(long, value_enum, value_delimiter = ',')]
    faults: Vec<Fault>,
    /// Gauges of a result.
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..=i64::from(MOST_GAUGES)))]
    gauges: u16,
    /// Results that each head has at the start.
    #[arg(long, default_value_t = 0)]
    backlog: u32,
    /// Results after which each head makes no more; those of the backlog count.
    #[arg(long, default_value_t = u32::MAX)]
    results: u32,
    /// Results that the history of a head keeps.
    #[arg(long, default_value_t = u32::MAX)]
    kept: u32,
}

impl Simulate {
    /// Answers until it is stopped. The first line of stdout has the address and when the heads'
    /// first history began, as JSON.
    ///
    /// # Errors
    /// If the rate is not above 0, or the address cannot be listened at.
    pub async fn run(self) -> Result<()> {
        if !(self.rate > 0.0 && self.rate <= 1e4) {
            return Exit::Usage.fail("--rate: write results per second, above 0, at most 10000");
        }
        let failed = || Exit::Unavailable.because(format!("listen at {}", self.listen));
        let listener = TcpListener::bind(&self.listen).await.map_err(failed())?;
        let address = listener.local_addr().map_err(failed())?;
        let backlog_ms = f64::from(self.backlog) * 1000.0 / self.rate;
        let start_ms = crate::now_ms().saturating_sub(backlog_ms as u64);
        say!(
            r#"{{"listen":"{address}","start_unix_ms":{start_ms},"seed":{},"heads":{},"rate":{},"gauges":{}}}"#,
            self.seed,
            self.heads,
            self.rate,
            self.gauges
        );
        let plant = Plant {
            start_ms,
            gauges: Gauge::table(self.gauges),
            counted: Mutex::default(),
            options: self,
        };
        serve::serve(listener, Arc::new(plant)).await
    }
}
