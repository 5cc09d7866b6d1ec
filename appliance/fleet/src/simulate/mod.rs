//! `fringed-fleet simulate`: answers as many heads would, from one process.

use crate::error::{Exit, Result};

/// Answer as many heads would, without light.
#[derive(Debug, clap::Args)]
pub struct Simulate {
    /// Heads, below /h/0001/, /h/0002/ and so on.
    #[arg(long, default_value_t = 30)]
    heads: u32,
    /// Results per second of each head.
    #[arg(long, default_value_t = 1.0)]
    rate: f64,
    /// Address that is listened at.
    #[arg(long, default_value = "127.0.0.1:8200")]
    listen: String,
    /// Seed of every value.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

impl Simulate {
    /// Answers until it is stopped.
    ///
    /// # Errors
    /// If the address cannot be listened at.
    pub fn run(&self) -> Result<()> {
        Exit::Software.fail("not there yet")
    }
}
