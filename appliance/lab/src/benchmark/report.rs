//! The results as one JSON object, as CSV, and as tables for people.
//!
//! | key of the object | meaning |
//! |---|---|
//! | `machine` | where: processor, cores, architecture |
//! | `kernel.floor_ns_per_px`, `.floor_range` | a loop that only reads 12 frames of 8 bits and writes one map of 32 bits, 1456 × 1088 |
//! | `kernel.<variant>.ns_per_px`, `.least_ns_per_px` | processor time of a set, per pixel of one frame: median, least |
//! | `….x_floor`, `.x_floor_range` | in floors of the same round: median, least and most |
//! | `….right` | share of pixels within 0.05 turn, or rejected where it is dark |
//! | `accuracy[]` | what decoded which sequence, its time, and error, unresolved and gross pixels: means over the parts |
//! | `budget.<columns>x<rows>.<frames>` | of a cycle: `exposure_ms`, `stages`, `verdict_ms`, `total_ms`; `one_thread_ms`, `kernel_ms`, `x_kernel` of processor time |
//! | `….production_`, `….aligned_`, `….moved_golden_N` | frames to readings of a part that lies as taught, with its motion taken back, of a part that was moved |
//!
//! A variant is the implementation and the workload, which [`super::workload`] names.

use super::accuracy::{Point, means};
use super::budget::{Budget, Lies};
use super::gauges::Gauges;
use super::kernel::KernelTable;
use serde::{Serialize, Serializer};
use serde_json::{Map, json};
use std::env::consts::ARCH;
use std::fmt::Write as _;
use std::fs;

/// The machine on which times are measured.
#[derive(Clone, Debug, Serialize)]
pub struct Machine {
    /// The board, or the processor's model, or its architecture if the system names neither.
    pub processor: String,
    /// Cores that this program may use.
    pub cores: usize,
    /// Architecture, `x86_64` or `aarch64`.
    pub architecture: &'static str,
}

impl Machine {
    /// This machine.
    pub fn this() -> Self {
        let cpuinfo = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let board = fs::read_to_string("/proc/device-tree/model").unwrap_or_default();
        let board = board.trim_end_matches('\0').trim();
        let processor = match board {
            "" => model(&cpuinfo).unwrap_or(ARCH),
            board => board,
        };
        Self {
            processor: processor.to_owned(),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            architecture: ARCH,
        }
    }
}

/// The processor's name in `/proc/cpuinfo`; on ARM only the board has one.
fn model(cpuinfo: &str) -> Option<&str> {
    let mut lines = cpuinfo.lines();
    let line = lines.find(|line| line.starts_with("model name"))?;
    line.split(':').nth(1).map(str::trim)
}

/// What was measured; `None` where it was not asked for.
#[derive(Debug, Serialize)]
pub struct Report {
    /// The machine.
    pub machine: Machine,
    /// The kernel table.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kernel: Option<KernelTable>,
    /// Run time against error, a point for each part; in JSON the means over the parts.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "as_means")]
    pub accuracy: Option<Vec<Point>>,
    /// From trigger to verdict.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "by_size")]
    pub budget: Option<Vec<Budget>>,
}

/// Columns of `accuracy.csv`.
pub const HEADER: &str = "part,implementation,sequence,frames,steps,bits,skipping,ns_per_px,x_floor,\
    ms_per_set,rms_mm,unresolved_px,gross_px";

impl Report {
    /// The points of every part, if there are any.
    pub fn csv(&self) -> Option<String> {
        let points = self.accuracy.as_ref()?;
        let mut csv = format!("{HEADER}\n");
        for point in points {
            let number = |x: f64| {
                if x.is_finite() {
                    x.to_string()
                } else {
                    String::new()
                }
            };
            // Writing to a string does not fail, here and below.
            let _ = writeln!(
                csv,
                "{},{},{},{},{},{},{},{:.3},{:.2},{:.3},{},{},{}",
                point.part,
                point.implementation,
                point.sequence,
                point.frames,
                point.shifts,
                point.bits,
                point.skipping,
                point.ns_per_px,
                point.x_floor,
                point.ms_per_set,
                number(point.rms_mm),
                number(point.unresolved_px),
                number(point.gross_px),
            );
        }
        Some(csv)
    }

    /// Tables in Markdown.
    pub fn markdown(&self) -> String {
        let Machine {
            processor,
            cores,
            architecture,
        } = &self.machine;
        let mut text = format!("Machine: {processor}, {cores} cores, {architecture}.\n");
        if let Some(table) = &self.kernel {
            kernel_table(&mut text, table);
        }
        if let Some(points) = &self.accuracy {
            accuracy_table(&mut text, &means(points));
        }
        if let Some(budgets) = &self.budget {
            budget_table(&mut text, budgets);
        }
        text
    }
}

fn as_means<S: Serializer>(points: &Option<Vec<Point>>, out: S) -> Result<S::Ok, S::Error> {
    points.as_deref().map(means).serialize(out)
}

/// `{"640x480": {"12": {…}, "4": {…}}}`: sizes, then frames of the sequence, and many gauges.
fn by_size<S: Serializer>(budgets: &Option<Vec<Budget>>, out: S) -> Result<S::Ok, S::Error> {
    let mut all = Map::new();
    for budget in budgets.iter().flatten() {
        let size = format!("{}x{}", budget.width, budget.height);
        let sizes = all.entry(size).or_insert_with(|| json!({}));
        if budget.gauges != Gauges::Taught {
            let key = budget.gauges.words().replace(", ", "_").replace(' ', "_");
            sizes[key] = json!({
                "verdict_ms": budget.verdict_ms,
                "one_thread_ms": budget.one_thread_ms,
            });
            continue;
        }
        if budget.lies == Lies::Aligned {
            sizes[budget.frames.to_string()] = json!(budget);
        }
        let per_px =
            |ms: f64| json!(ms * 1e6 / (f64::from(budget.width) * f64::from(budget.height)));
        let key = |timed: &str| format!("{timed}_golden_{}", budget.frames);
        let cycle = match budget.lies {
            Lies::AsTaught => "production",
            Lies::Aligned => "aligned",
            Lies::Moved => "moved",
        };
        sizes[key(cycle)] = json!({
            "ns_per_px": per_px(budget.one_thread_ms),
            "x_kernel": budget.x_kernel,
        });
        if budget.lies != Lies::Moved {
            sizes[key("kernel")] = json!({ "ns_per_px": per_px(budget.kernel_ms) });
        }
    }
    all.serialize(out)
}

fn kernel_table(text: &mut String, table: &KernelTable) {
    let [least, most] = table.floor_range;
    let _ = write!(
        text,
        "\n### Kernels\n\nFloor {:.3} ns/px ({least:.3} to {most:.3}).\n\n\
         | variant | frames | ns/px | least | × floor |\n|---|---:|---:|---:|---:|\n",
        table.floor_ns_per_px
    );
    for row in &table.rows {
        let _ = writeln!(
            text,
            "| {} | {} | {:.2} | {:.2} | {:.2} |",
            row.name, row.frames, row.ns_per_px, row.least_ns_per_px, row.x_floor,
        );
    }
}

/// A row for each sequence and depth, a column of times for each implementation.
fn accuracy_table(text: &mut String, means: &[Point]) {
    let mut implementations: Vec<(&str, bool)> = Vec::new();
    let mut sequences: Vec<&Point> = Vec::new();
    for point in means {
        let implementation = (point.implementation, point.skipping);
        if !implementations.contains(&implementation) {
            implementations.push(implementation);
        }
        if !sequences.iter().any(|known| known.same_frames(point)) {
            sequences.push(point);
        }
    }
    text.push_str(
        "\n### Run time against error\n\nMeans over the parts. The error is that of the first implementation; spread: how much the \
         others' errors differ from it at most. Times in ns/px.\n\n| pattern | frames | N | bits | RMS error, mm | spread | unresolved px | gross |",
    );
    for (name, skipping) in &implementations {
        let skipping = if *skipping { ", skipping" } else { "" };
        let _ = write!(text, " {name}{skipping} |");
    }
    text.push_str("\n|---|---:|---:|---:|---:|---:|---:|---:|");
    text.push_str(&"---:|".repeat(implementations.len()));
    text.push('\n');
    for first in sequences {
        let same: Vec<&Point> = means.iter().filter(|p| p.same_frames(first)).collect();
        let differences = same
            .iter()
            .map(|point| (point.rms_mm / first.rms_mm - 1.0).abs());
        let _ = write!(
            text,
            "| {} | {} | {} | {} | {:.4} | {:.4} % | {:.0} | {:.0} |",
            first.sequence,
            first.frames,
            first.shifts,
            first.bits,
            first.rms_mm,
            100.0 * differences.fold(0.0, f64::max),
            first.unresolved_px,
            first.gross_px,
        );
        for (name, skipping) in &implementations {
            let here =
                |point: &&&Point| point.implementation == *name && point.skipping == *skipping;
            let time = same.iter().find(here).map(|point| point.ns_per_px);
            let _ = match time {
                Some(time) => write!(text, " {time:.2} |"),
                None => write!(text, " |"),
            };
        }
        text.push('\n');
    }
}

fn budget_table(text: &mut String, budgets: &[Budget]) {
    text.push_str(
        "\n### From trigger to verdict\n\nMilliseconds; stages in wall time on all threads, the last three columns in \
         processor time on one.\n\n\
         | camera | frames | motion | gauges | exposure | stages | frames → verdict | trigger → verdict | frames → verdict, one thread | phase kernel alone | ratio |\n\
         |---|---:|---|---|---:|---|---:|---:|---:|---:|---:|\n",
    );
    for budget in budgets {
        let stages: Vec<String> = budget
            .stages
            .iter()
            .map(|(name, ms)| format!("{name} {ms:.1}"))
            .collect();
        let _ = writeln!(
            text,
            "| {}×{} | {} | {} | {} | {:.0} | {} | {:.1} | {:.0} | {:.1} | {:.2} | {:.2} |",
            budget.width,
            budget.height,
            budget.frames,
            match budget.lies {
                Lies::AsTaught => "none",
                Lies::Aligned => "taken back",
                Lies::Moved => "taken back, moved part",
            },
            budget.gauges.words(),
            budget.exposure_ms,
            stages.join(", "),
            budget.verdict_ms,
            budget.total_ms,
            budget.one_thread_ms,
            budget.kernel_ms,
            budget.x_kernel,
        );
    }
    if let Some(budget) = budgets.first() {
        let _ = writeln!(
            text,
            "\nStart of the camera: {:.0} ms in each cycle, 500 ms in the first one after a pause. The camera stays on between cycles.",
            budget.start_ms
        );
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_processors_name_is_found() {
        let cpuinfo = "processor\t: 0\nmodel name\t: Some CPU @ 2 GHz\nflags\t: a b\n";
        assert_eq!(super::model(cpuinfo), Some("Some CPU @ 2 GHz"));
        assert_eq!(super::model("processor : 0\nBogoMIPS : 108"), None);
    }
}
