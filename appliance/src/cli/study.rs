//! `fringed study`: what releases a station for production, from a CSV file or from stored results.

use super::history::warn_of_undated;
use super::numbers::number;
use super::options::{Files, Json};
use crate::error::{Exit, Failure, Result, shortened};
use crate::history::course::Rest;
use crate::history::studies::Studies;
use crate::history::{Filter, Reader, export};
use crate::station::MAX_GAUGES;
use crate::station::control::MAX_RECIPE;
use crate::storage::state::StateFolder;
use crate::study::{
    CapabilityLimits, Characteristic, Course, Decimal, GaugeCapability, Repeatability, StudyLimits,
    marks, table, write_json,
};
use crate::system::computing;
use serde::Serialize;
use std::fmt::Display;
use std::fs::File;
use std::io::{self, BufRead, BufReader, BufWriter};
use std::path::PathBuf;

/// Which study.
#[derive(Debug, clap::Subcommand)]
pub enum StudyCommand {
    Cg(Cg),
    Grr(Grr),
    Process(ProcessOptions),
}

/// A file with values.
#[derive(Debug, clap::Args)]
struct ValuesFile {
    /// CSV with the columns characteristic, part, appraiser (or operator), trial and value, or what `fringed history
    /// --csv` writes; "-" is standard input.
    #[arg(value_name = "VALUES.csv")]
    file: PathBuf,
    #[command(flatten)]
    of: OneCharacteristic,
}

/// Of which values.
#[derive(Debug, clap::Args)]
struct OneCharacteristic {
    /// Only of this characteristic, a gauge for instance.
    #[arg(long, value_name = "NAME")]
    characteristic: Option<String>,
}

/// Limits of a characteristic.
#[derive(Debug, clap::Args)]
struct Bounded {
    /// Lower limit; without limits those of the values are taken, if they have any.
    #[arg(long, value_name = "L", value_parser = decimal, allow_hyphen_values = true)]
    low: Option<Decimal>,
    /// Upper limit.
    #[arg(long, value_name = "H", value_parser = decimal, allow_hyphen_values = true)]
    high: Option<Decimal>,
}

/// What is known of the measurement besides the values.
#[derive(Debug, clap::Args)]
struct Uncertainties {
    /// The step of the values, for u_RE.
    #[arg(long, value_name = "R", default_value = "0", value_parser = number(0.0, LARGEST))]
    resolution: f64,
    /// Standard uncertainty of the reference, u_CAL.
    #[arg(long, value_name = "U", default_value = "0", value_parser = number(0.0, LARGEST))]
    u_reference: f64,
    /// A further standard uncertainty, of linearity or temperature for instance; more than once for more.
    #[arg(long, value_name = "U", value_parser = number(0.0, LARGEST))]
    u_other: Vec<f64>,
}

/// The largest number of an option.
const LARGEST: f64 = 1e12;
/// The smallest tolerance.
const SMALLEST: f64 = 1e-12;

/// Capability of a gauge by repeated measurements of one reference part: C_g, C_gk, Q_MS.
#[derive(Debug, clap::Args)]
pub struct Cg {
    #[command(flatten)]
    values: ValuesFile,
    /// The reference part's value.
    #[arg(long, value_name = "X", value_parser = decimal, allow_hyphen_values = true)]
    reference: Decimal,
    /// T, the upper limit less the lower one.
    #[arg(long, value_name = "T", value_parser = number(SMALLEST, LARGEST))]
    tolerance: f64,
    #[command(flatten)]
    known: Uncertainties,
    /// Share of T that the gauge may take, %.
    #[arg(long, value_name = "PERCENT", default_value_t = CapabilityLimits::USUAL.share, value_parser = number(0.1, 100.0))]
    share: f64,
    /// Widths in s that must fit into it.
    #[arg(long, value_name = "N", default_value_t = CapabilityLimits::USUAL.spread, value_parser = number(1.0, 12.0))]
    spread: f64,
    /// The least C_g of a gauge that is fit.
    #[arg(long, value_name = "CG", default_value_t = CapabilityLimits::USUAL.cg, value_parser = number(0.0, 100.0))]
    least_cg: f64,
    /// The least C_gk.
    #[arg(long, value_name = "CGK", default_value_t = CapabilityLimits::USUAL.cgk, value_parser = number(0.0, 100.0))]
    least_cgk: f64,
    /// The most Q_MS, %.
    #[arg(long, value_name = "PERCENT", default_value_t = CapabilityLimits::USUAL.q_ms, value_parser = number(0.0, 1000.0))]
    most_q: f64,
    #[command(flatten)]
    json: Json,
}

/// Gage R&R: which share of the scatter is the gauge's, by an analysis of variance.
#[derive(Debug, clap::Args)]
pub struct Grr {
    #[command(flatten)]
    values: ValuesFile,
    #[command(flatten)]
    bounded: Bounded,
    /// Pool the interaction of parts and appraisers where its p is above this.
    #[arg(long, value_name = "P", default_value_t = StudyLimits::USUAL.pool, value_parser = number(0.0, 1.0))]
    pool: f64,
    #[command(flatten)]
    known: Uncertainties,
    /// Fit up to this GRR, % of the tolerance, or of the study's variation where there are no limits.
    #[arg(long, value_name = "PERCENT", default_value_t = StudyLimits::USUAL.fit, value_parser = number(0.0, 1000.0))]
    fit: f64,
    /// Fit with conditions up to this GRR, %.
    #[arg(long, value_name = "PERCENT", default_value_t = StudyLimits::USUAL.conditions, value_parser = number(0.0, 1000.0))]
    conditions: f64,
    /// The least number of distinct categories.
    #[arg(long, value_name = "N", default_value_t = StudyLimits::USUAL.ndc, value_parser = number(0.0, 1000.0))]
    least_ndc: f64,
    /// The most Q_MP, %.
    #[arg(long, value_name = "PERCENT", default_value_t = StudyLimits::USUAL.q_mp, value_parser = number(0.0, 1000.0))]
    most_q: f64,
    #[command(flatten)]
    json: Json,
}

/// What a process does over time: P_pk, C_pk, control limits and Shewhart's marks, by stored results or a file.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("from").required(true).args(["file", "recipe"]))]
pub struct ProcessOptions {
    /// CSV with the column value, in the order of time, or what `fringed history --csv` writes; "-" is standard
    /// input.
    #[arg(value_name = "VALUES.csv")]
    file: Option<PathBuf>,
    /// Stored results of this recipe.
    #[arg(long, value_name = "NUMBER", value_parser = number(1, MAX_RECIPE))]
    recipe: Option<u16>,
    /// Only of the gauge in this slot.
    #[arg(long, value_name = "SLOT", value_parser = number(1, MAX_GAUGES as u16), conflicts_with = "file")]
    slot: Option<u16>,
    /// Only triggered at or after this time (UTC).
    #[arg(long, value_parser = export::utc_us, value_name = "TIME", conflicts_with = "file")]
    since: Option<u64>,
    /// Only triggered before this time (UTC).
    #[arg(long, value_parser = export::utc_us, value_name = "TIME", conflicts_with = "file")]
    until: Option<u64>,
    #[command(flatten)]
    of: OneCharacteristic,
    #[command(flatten)]
    bounded: Bounded,
    /// Which of the eight tests mark values (Nelson 1984).
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_values_t = marks::USUAL, value_parser = number(1u8, 8))]
    tests: Vec<u8>,
    #[command(flatten)]
    files: Files,
    #[command(flatten)]
    json: Json,
}

fn decimal(text: &str) -> Result<Decimal, &'static str> {
    Decimal::read(text).ok_or("write a number of at most 36 digits, as 10.012")
}

impl StudyCommand {
    /// Prints the study.
    ///
    /// # Errors
    /// If the file is missing (66) or wrong (65), or there is no history.
    pub fn run(&self) -> Result<()> {
        match self {
            Self::Cg(options) => options.run(),
            Self::Grr(options) => options.run(),
            Self::Process(options) => options.run(),
        }
    }
}

impl ValuesFile {
    fn read(&self) -> Result<Vec<Characteristic>> {
        self.of.of(read(&self.file)?, |measured| &measured.name)
    }
}

/// The values of a file.
fn read(file: &PathBuf) -> Result<Vec<Characteristic>> {
    let name = file.display().to_string();
    let input: Box<dyn BufRead> = match name.as_str() {
        "-" => Box::new(BufReader::new(io::stdin())),
        _ => {
            let missing =
                Exit::Missing.advising(format!("read {}", shortened(&name)), "name a CSV file");
            Box::new(BufReader::new(File::open(file).map_err(missing)?))
        }
    };
    table::read(input, &name)
}

impl OneCharacteristic {
    /// Those that are asked for.
    fn of<T>(&self, all: Vec<T>, name: impl Fn(&T) -> &str) -> Result<Vec<T>> {
        let names: Vec<String> = all.iter().take(8).map(|one| shortened(name(one))).collect();
        let wanted = |one: &T| {
            self.characteristic
                .as_ref()
                .is_none_or(|wanted| name(one) == wanted)
        };
        let found: Vec<T> = all.into_iter().filter(wanted).collect();
        if found.is_empty() {
            let what = format!(
                "there are no values{}",
                self.characteristic
                    .as_ref()
                    .map_or(String::new(), |name| format!(" of {}", shortened(name)))
            );
            return Err(Failure::because(
                Exit::Content,
                what,
                format!("name one of: {}", names.join(", ")),
            ));
        }
        Ok(found)
    }
}

/// Prints reports: as JSON a list of them.
fn print<T: Serialize + Display>(json: Json, reports: &[T]) -> Result<()> {
    if json.json {
        // JSON has no characters that command a terminal; a pipe that the reader has closed is not an error.
        let _ = write_json(&mut BufWriter::new(io::stdout().lock()), reports);
    } else {
        let texts: Vec<String> = reports.iter().map(T::to_string).collect();
        say!("{}", texts.join("\n").trim_end());
    }
    Ok(())
}

impl Cg {
    fn run(&self) -> Result<()> {
        let measured = self.values.read()?;
        let [measured] = &measured[..] else {
            let names: Vec<_> = measured
                .iter()
                .take(8)
                .map(|one| shortened(&one.name))
                .collect();
            let what = format!(
                "there are {} characteristics, which have no common reference",
                measured.len()
            );
            return Err(Failure::because(
                Exit::Content,
                what,
                format!("name one with --characteristic: {}", names.join(", ")),
            ));
        };
        let limits = CapabilityLimits {
            resolution: self.known.resolution,
            u_reference: self.known.u_reference,
            u_others: self.known.u_other.clone(),
            share: self.share,
            spread: self.spread,
            cg: self.least_cg,
            cgk: self.least_cgk,
            q_ms: self.most_q,
        };
        print(
            self.json,
            &[GaugeCapability::of(
                measured,
                self.reference,
                self.tolerance,
                &limits,
            )?],
        )
    }
}

impl Grr {
    fn run(&self) -> Result<()> {
        let others = self.known.u_other.iter().copied();
        let limits = StudyLimits {
            low: self.bounded.low,
            high: self.bounded.high,
            pool: self.pool,
            resolution: self.known.resolution,
            u_others: others.chain([self.known.u_reference]).collect(),
            fit: self.fit,
            conditions: self.conditions,
            ndc: self.least_ndc,
            q_mp: self.most_q,
        };
        let measured = self.values.read()?;
        let reports: Result<Vec<_>> = measured
            .iter()
            .map(|measured| Repeatability::of(measured, &limits))
            .collect();
        print(self.json, &reports?)
    }
}

impl ProcessOptions {
    fn run(&self) -> Result<()> {
        let bounds = (self.bounded.low, self.bounded.high);
        let courses = match &self.file {
            Some(file) => read(file)?
                .iter()
                .map(|measured| Course::of(measured, bounds))
                .collect(),
            None => {
                // A running station needs the cores.
                computing::stand_back();
                let state = self.files.state_folder()?;
                let reader = Reader::of(&state);
                let filter = Filter {
                    recipe: self.recipe,
                    since_us: self.since,
                    until_us: self.until,
                    limit: usize::MAX,
                    ..Filter::default()
                };
                warn_of_undated(&reader, &filter)?;
                let rest = if StateFolder::is_used(&state) {
                    Rest(3)
                } else {
                    Rest(0)
                };
                let of_studies = Studies::of(&state).seqs(&reader.id()?);
                reader.courses(&filter, self.slot, bounds, &of_studies, rest)?
            }
        };
        let courses = self.of.of(courses, |course| &course.name)?;
        let reports: Vec<_> = courses
            .iter()
            .map(|course| course.figures(&self.tests))
            .collect();
        print(self.json, &reports)
    }
}
