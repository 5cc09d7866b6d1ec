//! `fringed-fleet status`: a line per head, from what the collectors wrote into the store.

use crate::config::Fleet;
use crate::error::{Exit, Result};
use crate::store::{Complaint, Count, HeadState, Spread, Store};
use serde::Serialize;
use std::collections::HashMap;
use std::iter::once;

/// s of a day.
const DAY_S: u64 = 86_400;
/// A head whose state is older than this (s) has no collector: a head that fails is asked again at
/// least once a minute.
const SILENT_S: u64 = 180;
/// Fewer values than this say nothing about a spread.
const ENOUGH: u64 = 10;

/// Show a line per head: reachable, state, recipe, results today, yield, worst gauge, drift.
#[derive(Debug, clap::Args)]
pub struct Status {
    #[command(flatten)]
    fleet: Fleet,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// A head, as it is shown. Times in s, drift in projector pixels; null where not known.
#[derive(Debug, Serialize)]
struct Line {
    serial: String,
    url: String,
    line: String,
    reachable: bool,
    error: Option<String>,
    state: String,
    recipe: Option<u16>,
    recipe_name: String,
    results_today: u64,
    #[serde(rename = "yield")]
    share: Option<f64>,
    worst_gauge: Option<Worst>,
    drift_px: Option<f64>,
    seconds_since_result: Option<u64>,
}

#[derive(Clone, Debug, Serialize)]
struct Worst {
    name: String,
    cpk: f64,
}

impl Status {
    /// Prints the table. Today begins at midnight UTC.
    ///
    /// # Errors
    /// If the store cannot be read, or no collector ever wrote to it.
    pub async fn run(&self) -> Result<()> {
        let config = self.fleet.read()?;
        let url = config.store()?;
        let mut store = Store::of(url, config.tls.clone())?;
        let now_s = crate::now_ms() / 1000;
        let today = now_s - now_s % DAY_S;
        let read = async {
            let heads = store.heads().await?;
            Ok((
                heads,
                store.counts(today).await?,
                store.spreads(today).await?,
            ))
        };
        let unread = Exit::Unavailable.because::<Complaint>(format!("read {url}"));
        let (heads, counts, spreads) = read.await.map_err(unread)?;
        if heads.is_empty() {
            let words = format!("{url} has no heads: run fringed-fleet collect with this store");
            return Exit::Missing.fail(words);
        }
        let lines = lines(heads, &counts, &spreads, now_s);
        let text = match self.json {
            true => serde_json::to_string_pretty(&lines).unwrap_or_default(),
            false => table(&lines),
        };
        say!("{text}");
        Ok(())
    }
}

fn lines(heads: Vec<HeadState>, counts: &[Count], spreads: &[Spread], now_s: u64) -> Vec<Line> {
    let counts: HashMap<_, _> = counts.iter().map(|count| (&*count.serial, count)).collect();
    let mut worst: HashMap<&str, Worst> = HashMap::new();
    for spread in spreads {
        let Some(cpk) = cpk(spread) else { continue };
        let known = worst.get(&*spread.serial);
        if known.is_none_or(|known| cpk < known.cpk) {
            let name = spread.name.clone();
            worst.insert(&spread.serial, Worst { name, cpk });
        }
    }
    let line = |head: HeadState| {
        let count = counts.get(&*head.serial);
        let last_s = head.last_result_unix_ms.map(|ms| ms / 1000);
        let last_s = last_s.max(count.map(|count| count.last_at));
        let silent = now_s.saturating_sub(head.updated_unix_ms / 1000) > SILENT_S;
        let error = match silent {
            true => Some("no collector asks it".to_owned()),
            false => Some(head.error).filter(|error| !error.is_empty()),
        };
        Line {
            worst_gauge: worst.get(&*head.serial).cloned(),
            serial: head.serial,
            url: head.url,
            line: head.line,
            reachable: head.reachable == 1 && !silent,
            error,
            state: head.state,
            recipe: head.recipe,
            recipe_name: head.recipe_name,
            results_today: count.map_or(0, |count| count.results),
            share: count.map(|count| count.pass as f64 / count.results as f64),
            drift_px: head.drift_px,
            seconds_since_result: last_s.map(|last_s| now_s.saturating_sub(last_s)),
        }
    };
    heads.into_iter().map(line).collect()
}

/// Cpk of values within limits: the distance of the mean to the nearer limit, in 3 s (ISO 22514-2).
fn cpk(spread: &Spread) -> Option<f64> {
    let s = spread.variance.filter(|variance| *variance > 0.0)?.sqrt();
    let below = spread.low.map(|low| spread.mean - low);
    let above = spread.high.map(|high| high - spread.mean);
    let nearer = below.into_iter().chain(above).min_by(f64::total_cmp)?;
    (spread.n >= ENOUGH).then_some(nearer / (3.0 * s))
}

const TITLES: &str = "head|reachable|state|recipe|today|yield|worst gauge (Cpk)|drift|last";

/// The lines in columns.
fn table(lines: &[Line]) -> String {
    let titles = TITLES.split('|').map(str::to_owned).collect();
    let rows: Vec<Vec<String>> = once(titles).chain(lines.iter().map(cells)).collect();
    let mut widths = vec![0; rows[0].len()];
    for row in &rows {
        for (width, cell) in widths.iter_mut().zip(row) {
            *width = cell.chars().count().max(*width);
        }
    }
    let padded = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths);
        let line: String = cells
            .map(|(cell, &width)| format!("{cell:width$}  "))
            .collect();
        line.trim_end().to_owned()
    };
    rows.iter().map(padded).collect::<Vec<_>>().join("\n")
}

fn cells(line: &Line) -> Vec<String> {
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| "–".into());
    let some = |text: &String| Some(text.clone()).filter(|text| !text.is_empty());
    let recipe = line
        .recipe
        .map(|number| format!("{number} {}", line.recipe_name));
    let worst = line.worst_gauge.as_ref();
    let error: String = line
        .error
        .as_deref()
        .unwrap_or("silent")
        .chars()
        .take(40)
        .collect();
    vec![
        some(&line.serial).unwrap_or_else(|| line.url.clone()),
        if line.reachable {
            "yes".into()
        } else {
            format!("no: {error}")
        },
        or_dash(some(&line.state)),
        or_dash(recipe),
        line.results_today.to_string(),
        or_dash(line.share.map(|share| format!("{:.1} %", 100.0 * share))),
        or_dash(worst.map(|worst| format!("{} ({:.2})", worst.name, worst.cpk))),
        or_dash(line.drift_px.map(|px| format!("{px:.2} px"))),
        or_dash(line.seconds_since_result.map(|s| format!("{s} s"))),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spread(name: &str, mean: f64, low: Option<f64>, high: Option<f64>) -> Spread {
        Spread {
            serial: "S".into(),
            name: name.into(),
            low,
            high,
            n: ENOUGH,
            mean,
            variance: Some(0.01),
        }
    }

    #[test]
    fn the_worst_gauge_is_the_one_with_the_least_cpk() {
        let (low, high) = (Some(0.0), Some(1.0));
        assert!((cpk(&spread("a", 0.4, low, high)).unwrap() - 0.4 / 0.3).abs() < 1e-12);
        assert!((cpk(&spread("a", 0.4, None, high)).unwrap() - 2.0).abs() < 1e-12);
        assert_eq!(cpk(&spread("a", 0.4, None, None)), None);
        let few = Spread {
            n: ENOUGH - 1,
            ..spread("a", 0.4, low, high)
        };
        assert_eq!(cpk(&few), None);

        let heads = || {
            vec![HeadState {
                serial: "S".into(),
                updated_unix_ms: 990_000,
                reachable: 1,
                last_result_unix_ms: Some(5000),
                ..HeadState::default()
            }]
        };
        let counts = [Count {
            serial: "S".into(),
            results: 4,
            pass: 3,
            last_at: 995,
        }];
        let spreads = [
            spread("a", 0.5, low, high),
            spread("b", 0.9, low, high),
            spread("c", 0.6, low, high),
        ];
        let line = &lines(heads(), &counts, &spreads, 1000)[0];
        assert_eq!(line.worst_gauge.as_ref().unwrap().name, "b");
        assert_eq!(
            (line.reachable, line.share, line.seconds_since_result),
            (true, Some(0.75), Some(5))
        );
        let cells = cells(line);
        assert!(
            table(&[]).starts_with("head") && cells[6].starts_with("b (0.33)"),
            "{cells:?}"
        );
        // Nobody has written about it for a long time.
        let line = &lines(heads(), &counts, &spreads, 990 + SILENT_S + 1)[0];
        assert_eq!(
            (line.reachable, line.error.as_deref()),
            (false, Some("no collector asks it"))
        );
    }
}
