//! `fringed-lab bench`: the kernel table, run time against error, and the budget from trigger to
//! verdict.

use crate::benchmark::{self, Effort, Machine, Report, Study};
use appliance::cli::{Output, Threads, names};
use appliance::error::{Exit, Result};
use appliance::storage::folder::OutputFolder;
use appliance::system::computing::give_back;
use std::path::PathBuf;

/// Time the kernels, time against error, and trigger to verdict.
#[derive(Debug, clap::Args)]
pub struct Bench {
    /// What to measure; without it all three.
    #[arg(value_enum)]
    what: Option<What>,
    /// Small frames and one round: whether everything works, not how fast it is.
    #[arg(long)]
    quick: bool,
    /// Folder for tables and CSV; made if it does not exist.
    #[arg(long, value_name = "DIR", value_parser = names::folder())]
    out: Option<PathBuf>,
    /// Write the twelve frames that the kernels are timed on to this folder, for other programs to
    /// be timed on, and measure nothing.
    #[arg(long, value_name = "DIR", value_parser = names::folder(), conflicts_with_all = ["what", "out", "threads", "json"])]
    frames: Option<PathBuf>,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    output: Output,
}

/// A part of the benchmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum What {
    /// Processor time per pixel of every variant.
    Kernel,
    /// Run time against error on the simulated parts.
    Accuracy,
    /// From trigger to verdict, stage by stage.
    Budget,
}

/// Columns and rows of the cameras of the budget: the study's physical head, and the sensor that is
/// aimed at.
const CAMERAS: [(u32, u32); 2] = [(640, 480), (1456, 1088)];
const QUICK_CAMERAS: [(u32, u32); 1] = [(160, 120)];

impl Bench {
    /// Measures, writes and prints.
    ///
    /// # Errors
    /// If something cannot be simulated or results not be written.
    pub fn run(&self) -> Result<()> {
        if let Some(folder) = &self.frames {
            return self.write_frames(folder);
        }
        // Made first: a folder that cannot be written is found before minutes of measuring.
        let folder = self.out.as_deref().map(OutputFolder::create);
        let folder = folder.transpose()?;
        let progress = self.output.progress();
        let on_progress = |share: f64, words: &str| progress.tell(share, words);
        let report = self.measure(&on_progress);
        progress.clear();
        let report = report?;
        let json = serde_json::json!(report);
        let tables = report.markdown();
        if let Some(folder) = &folder {
            folder.write("benchmarks.json", format!("{json:#}\n").as_bytes())?;
            folder.write("benchmarks.md", tables.as_bytes())?;
            if let Some(csv) = report.csv() {
                folder.write("accuracy.csv", csv.as_bytes())?;
            }
        }
        self.output.answer(&json, || tables)
    }

    fn measure(&self, on_progress: &(dyn Fn(f64, &str) + Sync)) -> Result<Report> {
        let wanted = |what| self.what.is_none_or(|asked| asked == what);
        let pool = self.threads.pool(0)?;
        // So that each frame that is timed lies in a mapping of its own.
        give_back();
        let mut report = Report {
            machine: Machine::this(),
            kernel: None,
            accuracy: None,
            budget: None,
        };
        if wanted(What::Kernel) {
            let table = benchmark::kernel_table(&self.effort(), on_progress);
            report.kernel = Some(table.map_err(Exit::Software.because("time the kernels"))?);
        }
        if wanted(What::Accuracy) {
            let study = if self.quick {
                Study::quick()
            } else {
                Study::full()
            };
            let points = pool.install(|| study.run(on_progress));
            report.accuracy =
                Some(points.map_err(Exit::Software.because("measure run time against error"))?);
        }
        if wanted(What::Budget) {
            let cameras = if self.quick {
                &QUICK_CAMERAS[..]
            } else {
                &CAMERAS
            };
            let effort = self.effort();
            let budgets = pool.install(|| {
                let each = |&camera| benchmark::budgets(camera, &effort, on_progress);
                cameras.iter().map(each).collect::<Result<Vec<_>, _>>()
            });
            let budgets =
                budgets.map_err(Exit::Software.because("measure from trigger to verdict"))?;
            report.budget = Some(budgets.concat());
        }
        Ok(report)
    }

    fn effort(&self) -> Effort {
        if self.quick {
            Effort::QUICK
        } else {
            Effort::FULL
        }
    }

    fn write_frames(&self, folder: &std::path::Path) -> Result<()> {
        let folder_of_frames = OutputFolder::create(folder)?;
        let files = benchmark::frame_files(self.effort().size)
            .map_err(Exit::Software.because("render the frames"))?;
        for (name, bytes) in files {
            folder_of_frames.write(&name, &bytes)?;
        }
        self.output
            .remark(|| format!("written to {}", folder.display()));
        Ok(())
    }
}
