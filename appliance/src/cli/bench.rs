//! `fringed bench`: the kernel table, time against error, and the budget from trigger to verdict.

use super::Common;
use crate::benchmark::{Effort, KernelTable, Machine, kernel_table};
use crate::error::{Exit, Failure};
use serde_json::{Map, Value, json};

/// Time the kernels, time against error, and trigger to verdict.
#[derive(Debug, clap::Args)]
pub struct Bench {
    /// Small frames and one round: whether everything works, not how fast it is.
    #[arg(long)]
    quick: bool,
}

impl Bench {
    /// Measures and prints.
    ///
    /// # Errors
    /// If something cannot be simulated or results not be written.
    pub fn run(&self, common: &Common) -> Result<(), Failure> {
        let effort = if self.quick {
            Effort::QUICK
        } else {
            Effort::FULL
        };
        let progress = common.progress();
        let told = |share: f64, words: &str| progress.tell(share, words);
        let table = kernel_table(&effort, &told)
            .map_err(|error| Failure::because(Exit::Software, "time the kernels", error))?;
        progress.clear();
        if common.json {
            let all = json!({"machine": Machine::this(), "kernel": kernel_json(&table)});
            say!("{all:#}");
        } else {
            say!(
                "floor {:.3} ns/px ({:.3}-{:.3})",
                table.floor_ns_per_px,
                table.floor_range[0],
                table.floor_range[1]
            );
            for row in &table.rows {
                say!(
                    "{:30} {:3} frames {:8.3} ns/px {:8.2} x floor ({:.2}-{:.2}) {:.4}",
                    row.name,
                    row.frames,
                    row.ns_per_px,
                    row.x_floor,
                    row.x_floor_range[0],
                    row.x_floor_range[1],
                    row.right
                );
            }
        }
        Ok(())
    }
}

fn kernel_json(table: &KernelTable) -> Value {
    let mut all = Map::new();
    all.insert("floor_ns_per_px".into(), json!(table.floor_ns_per_px));
    for row in &table.rows {
        all.insert(
            row.name.clone(),
            json!({"frames": row.frames, "ns_per_px": row.ns_per_px, "x_floor": row.x_floor, "x_floor_range": row.x_floor_range, "right": row.right}),
        );
    }
    Value::Object(all)
}
