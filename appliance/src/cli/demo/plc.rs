//! The PLC's side of a measurement by token, as a PLC programmer would write it.

use crate::error::{Exit, Failure, Result};
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

/// A connected PLC.
pub struct Plc {
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
        let long = |at: usize| u32::from(words[at]) << 16 | u32::from(words[at + 1]);
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

impl Plc {
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
