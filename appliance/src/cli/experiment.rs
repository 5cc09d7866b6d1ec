//! `fringed experiment`.

use super::Common;
use crate::error::{Exit, Failure};
use crate::experiment::{Method, OpticsKind, PARTS, Runner, Scene};

/// Repeat the paper's experiments on the simulated head.
#[derive(Debug, clap::Args)]
pub struct Experiment {
    /// A part, or all.
    #[arg(long, default_value = "all")]
    part: Vec<String>,
    /// How sharp projector and camera are.
    #[arg(long, value_enum, default_value = "ideal")]
    optics: OpticsKind,
    /// Noise seeds.
    #[arg(long, default_value_t = 3)]
    seeds: u64,
}

impl Experiment {
    /// Runs the experiments and prints a table.
    ///
    /// # Errors
    /// If a part is not known or a run fails.
    #[expect(
        clippy::print_stdout,
        reason = "the table is what the command is asked for"
    )]
    pub fn run(&self, common: &Common) -> Result<(), Failure> {
        let pool = super::pool(common.threads.unwrap_or(0))?;
        let names: Vec<&str> = if self.part.iter().any(|name| name == "all") {
            PARTS.to_vec()
        } else {
            self.part.iter().map(String::as_str).collect()
        };
        let failed =
            |error: crate::bench::BenchError| Failure::new(Exit::Software, error.to_string());
        for name in names {
            let scene = Scene::named(name).ok_or_else(|| {
                let message = format!(
                    "experiment: no part {name:?}: one of {}, all",
                    PARTS.join(", ")
                );
                Failure::new(Exit::Usage, message)
            })?;
            let mut runner = pool
                .install(|| Runner::new(&scene, self.optics))
                .map_err(failed)?;
            for method in Method::all() {
                for seed in 1..=self.seeds {
                    let outcome = pool.install(|| runner.run(method, seed)).map_err(failed)?;
                    println!("{name} {method:?} {seed} {outcome:?}");
                }
            }
        }
        Ok(())
    }
}
