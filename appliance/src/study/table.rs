//! Values of a study from a CSV file: columns of its own in any order, or what `fringed history --csv` writes.
//!
//! Lines are read one at a time into a buffer of fixed size, so a file needs as much memory as its values, whatever
//! else it holds.

use super::decimal::Decimal;
use super::values::{Characteristic, Reading};
use crate::error::{Exit, Failure, Result, shortened};
use csv_core::{ReadRecordResult, Reader, ReaderBuilder};
use std::collections::{HashMap, HashSet};
use std::fmt::Display;
use std::io::BufRead;
use std::sync::Arc;

/// The most rows of a file.
const MOST_ROWS: usize = 1_000_000;
/// The most bytes of a row without its separators.
const MOST_BYTES: usize = 1 << 20;
/// The most cells of a row: a result with 64 gauges has 469.
const MOST_CELLS: usize = 1024;
/// The most bytes of a cell that is read.
const MOST_OF_CELL: usize = 256;
/// The columns of a file of its own; all but the last may be missing. `operator` is read as `appraiser`.
const COLUMNS: &str = "characteristic, part, appraiser, trial, sigma, U, low, high, seq, value";
/// The columns of a gauge in a history behind that of its value.
const OF_GAUGE: [&str; 6] = ["sigma", "low", "high", "decision", "U", "expected"];
/// The bit of a decision that says that the value is valid.
const VALID: u16 = 1 << 1;

/// A row that is being read.
struct CsvRow<'a> {
    line: u64,
    cells: Vec<&'a str>,
}

/// Reads rows.
struct CsvRows<R> {
    left: usize,
    input: R,
    reader: Reader,
    bytes: Vec<u8>,
    ends: Vec<usize>,
    file: String,
}

fn wrong(file: &str, line: u64, what: impl Display, remedy: impl Display) -> Failure {
    let place = match line {
        0 => format!("read {file}: {what}"),
        _ => format!("read {file}: line {line}: {what}"),
    };
    Failure::because(Exit::Content, place, remedy)
}

impl<R: BufRead> CsvRows<R> {
    fn new(mut input: R, file: String) -> Result<Self> {
        let unread = Exit::Content.advising(format!("read {file}"), "name a CSV file");
        let begin = input.fill_buf().map_err(unread)?;
        let head = begin
            .split(|byte| *byte == b'\n')
            .next()
            .unwrap_or_default();
        let count = |mark| head.iter().filter(|byte| **byte == mark).count();
        let mark = if count(b';') > count(b',') {
            b';'
        } else {
            b','
        };
        Ok(Self {
            // And the first line.
            left: MOST_ROWS + 1,
            input,
            reader: ReaderBuilder::new().delimiter(mark).build(),
            bytes: vec![0; MOST_BYTES],
            ends: vec![0; MOST_CELLS],
            file,
        })
    }

    /// The next row that is not empty.
    fn next(&mut self) -> Result<Option<CsvRow<'_>>> {
        let (mut filled, mut cells, mut last) = (0, 0, 0);
        loop {
            let line = self.reader.line();
            let unread = |error| wrong(&self.file, line, error, "copy the file again");
            let input = self.input.fill_buf().map_err(unread)?;
            let (result, used, written, ended) =
                self.reader
                    .read_record(input, &mut self.bytes[filled..], &mut self.ends[cells..]);
            last = used.checked_sub(1).map_or(last, |at| input[at]);
            self.input.consume(used);
            (filled, cells) = (filled + written, cells + ended);
            let line = self.reader.line() - u64::from(last == b'\n');
            match result {
                ReadRecordResult::InputEmpty => {}
                ReadRecordResult::End => return Ok(None),
                ReadRecordResult::Record if self.left == 0 => {
                    let what = format!("it has more than {MOST_ROWS} rows");
                    return Err(wrong(&self.file, line, what, "make a study of fewer"));
                }
                ReadRecordResult::Record => {
                    self.left -= 1;
                    return self.row(line, cells).map(Some);
                }
                ReadRecordResult::OutputFull | ReadRecordResult::OutputEndsFull => {
                    let what = format!("it has more than {MOST_BYTES} bytes or {MOST_CELLS} cells");
                    return Err(wrong(
                        &self.file,
                        line,
                        what,
                        "is a quotation mark not closed?",
                    ));
                }
            }
        }
    }

    fn row(&self, line: u64, cells: usize) -> Result<CsvRow<'_>> {
        let refused = |at: usize, what: &str| {
            let what = format!("cell {} {what}", at + 1);
            wrong(&self.file, line, what, "save it as CSV with UTF-8 text")
        };
        let starts = [0].into_iter().chain(self.ends.iter().copied());
        let mut read = Vec::with_capacity(cells);
        for (at, (start, &end)) in starts.zip(&self.ends[..cells]).enumerate() {
            let cell = str::from_utf8(&self.bytes[start..end]);
            let cell = cell.map_err(|_| refused(at, "is not UTF-8"))?;
            let commands = |mark: char| mark.is_control() && !matches!(mark, '\t' | '\r' | '\n');
            if cell.contains(commands) {
                return Err(refused(at, "has control characters"));
            }
            read.push(cell.trim());
        }
        Ok(CsvRow { line, cells: read })
    }
}

/// Where the columns of a file are.
#[derive(Default)]
struct Columns {
    characteristic: Option<usize>,
    part: Option<usize>,
    appraiser: Option<usize>,
    trial: Option<usize>,
    value: Option<usize>,
    sigma: Option<usize>,
    uncertainty: Option<usize>,
    low: Option<usize>,
    high: Option<usize>,
    decision: Option<usize>,
    seq: Option<usize>,
    verdict: Option<usize>,
}

impl Columns {
    fn of(rows: &str, line: u64, head: &[String]) -> Result<Self> {
        let mut columns = Self::default();
        for (at, name) in head.iter().enumerate() {
            let place = match name.to_lowercase().as_str() {
                "characteristic" => &mut columns.characteristic,
                "part" => &mut columns.part,
                "appraiser" | "operator" => &mut columns.appraiser,
                "trial" => &mut columns.trial,
                "value" => &mut columns.value,
                "sigma" => &mut columns.sigma,
                "u" => &mut columns.uncertainty,
                "low" => &mut columns.low,
                "high" => &mut columns.high,
                "seq" => &mut columns.seq,
                _ => continue,
            };
            if place.replace(at).is_some() {
                let what = format!("the column {} is there twice", shortened(name));
                return Err(wrong(rows, line, what, "leave one of them out"));
            }
        }
        if columns.value.is_none() {
            let what = "there is no column \"value\"";
            let remedy = format!(
                "name the columns in the first line: {COLUMNS}; or use what fringed history --csv writes"
            );
            return Err(wrong(rows, line, what, remedy));
        }
        Ok(columns)
    }
}

/// The gauges of a history's columns: name, unit and where each begins.
fn gauges(head: &[String]) -> Vec<(String, String, Columns)> {
    let place = |name: &str| head.iter().position(|column| column == name);
    let gauge = |at: usize| {
        let (name, unit) = name_and_unit(&head[at]);
        let follow = OF_GAUGE.iter().zip(head.get(at + 1..)?);
        let follow = follow.filter(|(of, column)| **column == format!("{name} {of}"));
        (follow.count() == OF_GAUGE.len()).then(|| {
            let columns = Columns {
                part: place("part_id"),
                seq: place("seq"),
                verdict: place("verdict"),
                value: Some(at),
                sigma: Some(at + 1),
                low: Some(at + 2),
                high: Some(at + 3),
                decision: Some(at + 4),
                uncertainty: Some(at + 5),
                ..Columns::default()
            };
            (name.to_owned(), unit.to_owned(), columns)
        })
    };
    (0..head.len()).filter_map(gauge).collect()
}

/// `hole 1 diameter [mm]` apart.
fn name_and_unit(text: &str) -> (&str, &str) {
    let inside = text
        .strip_suffix(']')
        .and_then(|text| text.split_once(" ["));
    inside.unwrap_or((text, ""))
}

/// Reads the values of a file, each characteristic by itself.
///
/// # Errors
/// The file is not CSV, lacks columns, has more than 10⁶ rows, or a cell that is no number: with the line (65).
pub fn read(input: impl BufRead, file: &str) -> Result<Vec<Characteristic>> {
    let mut rows = CsvRows::new(input, shortened(file))?;
    let head = rows.next()?.map(|row| {
        (
            row.line,
            row.cells
                .iter()
                .map(|cell| (*cell).to_owned())
                .collect::<Vec<_>>(),
        )
    });
    let nothing = || {
        wrong(
            file,
            0,
            "there is nothing in it",
            format!("write a line with the columns {COLUMNS}"),
        )
    };
    let (line, head) = head.ok_or_else(nothing)?;
    if head.iter().any(|name| name == "fingerprint") {
        of_history(&mut rows, &head)
    } else {
        let columns = Columns::of(&rows.file, line, &head)?;
        own(&mut rows, &columns, head.len())
    }
}

/// Reads rows of a file of its own.
fn own(
    rows: &mut CsvRows<impl BufRead>,
    columns: &Columns,
    width: usize,
) -> Result<Vec<Characteristic>> {
    let (mut all, mut known) = (
        Vec::<Characteristic>::new(),
        HashMap::<String, usize>::new(),
    );
    let (file, mut texts) = (rows.file.clone(), Texts::default());
    while let Some(row) = rows.next()? {
        row.has(width, &file)?;
        let reading = row.reading(columns, &mut texts, &file)?;
        let empty = || {
            wrong(
                &file,
                row.line,
                "the value is empty",
                "measure it, or leave the whole row out",
            )
        };
        let reading = reading.ok_or_else(empty)?;
        let named = columns.characteristic.map_or("value", |at| row.cells[at]);
        let at = match known.get(named) {
            Some(at) => *at,
            None => {
                let (name, unit) = name_and_unit(named);
                known.insert(named.to_owned(), all.len());
                all.push(Characteristic {
                    name: name.into(),
                    unit: unit.into(),
                    ..Characteristic::default()
                });
                all.len() - 1
            }
        };
        all[at].readings.push(reading);
    }
    Ok(all)
}

/// Reads the rows of a history, whose newest result is its first.
fn of_history(rows: &mut CsvRows<impl BufRead>, head: &[String]) -> Result<Vec<Characteristic>> {
    let gauges = gauges(head);
    let (file, mut texts) = (rows.file.clone(), Texts::default());
    let named = gauges.iter().map(|(name, unit, _)| Characteristic {
        name: name.clone(),
        unit: unit.clone(),
        ..Characteristic::default()
    });
    let mut all: Vec<Characteristic> = named.collect();
    while let Some(row) = rows.next()? {
        row.has(head.len(), &file)?;
        for (measured, (_, _, columns)) in all.iter_mut().zip(&gauges) {
            let cell = |at: Option<usize>| at.map_or("", |at| row.cells[at]);
            let decision = cell(columns.decision);
            // The recipe of this result has no such gauge.
            if decision.is_empty() {
                continue;
            }
            let is_valid = decision.parse::<u16>().is_ok_and(|bits| bits & VALID != 0);
            let reading = row.reading(columns, &mut texts, &file)?;
            match (cell(columns.verdict), reading.filter(|_| is_valid)) {
                ("INVALID", _) => measured.left_out.invalid += 1,
                (_, None) => measured.left_out.not_measured += 1,
                (_, Some(reading)) => measured.readings.push(reading),
            }
        }
    }
    for measured in &mut all {
        measured.readings.reverse();
    }
    Ok(all)
}

/// Texts that many rows share.
#[derive(Default)]
struct Texts(HashSet<Arc<str>>);

impl Texts {
    fn shared(&mut self, text: &str) -> Arc<str> {
        if let Some(known) = self.0.get(text) {
            return known.clone();
        }
        let new: Arc<str> = text.into();
        self.0.insert(new.clone());
        new
    }
}

impl CsvRow<'_> {
    fn has(&self, width: usize, file: &str) -> Result<()> {
        let cells = self.cells.len();
        if cells != width {
            let what = format!("it has {cells} cells, the first line {width}");
            return Err(wrong(
                file,
                self.line,
                what,
                "a decimal comma needs ; between cells, or quotation marks",
            ));
        }
        Ok(())
    }

    /// The reading of this row; none where the value is empty.
    fn reading(&self, columns: &Columns, texts: &mut Texts, file: &str) -> Result<Option<Reading>> {
        let cell = |at: Option<usize>| at.map_or("", |at| self.cells[at]);
        let number = |at: Option<usize>| match cell(at) {
            "" => Ok(None),
            text => Decimal::read(text).map(Some).ok_or_else(|| {
                let what = format!(
                    "\"{}\" is not a number of at most 36 digits",
                    shortened(text)
                );
                wrong(
                    file,
                    self.line,
                    what,
                    "write it as 10.012, 10,012 or 1.0012e1",
                )
            }),
        };
        let names = [
            columns.characteristic,
            columns.part,
            columns.appraiser,
            columns.trial,
        ]
        .map(cell);
        let [_, part, appraiser, trial] = names;
        if let Some(long) = names.into_iter().find(|text| text.len() > MOST_OF_CELL) {
            let what = format!(
                "\"{}\" is longer than {MOST_OF_CELL} bytes",
                shortened(long)
            );
            return Err(wrong(file, self.line, what, "write a shorter name"));
        }
        let Some(value) = number(columns.value)? else {
            return Ok(None);
        };
        let rounded = |at| Ok::<_, Failure>(number(at)?.map(Decimal::to_f64));
        Ok(Some(Reading {
            at: cell(columns.seq).parse().unwrap_or(self.line),
            part: texts.shared(part),
            appraiser: texts.shared(appraiser),
            trial: texts.shared(trial),
            value,
            sigma: rounded(columns.sigma)?,
            uncertainty: rounded(columns.uncertainty)?,
            low: number(columns.low)?,
            high: number(columns.high)?,
        }))
    }
}
