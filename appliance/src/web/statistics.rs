//! Statistics of a recipe over its stored results: a line of JSON for each part of the answer, as it is worked out.
//!
//! A thread of its own works, only where a core has nothing else to do; one at a time.

use super::downloads::sent_alone;
use super::problem::{Answered, Problem};
use super::request::Query;
use super::results::line;
use super::site::Site;
use crate::history::Filter;
use crate::history::statistics::{Axis, StatisticsPart, StatisticsRequest};
use crate::station::MAX_GAUGES;
use crate::station::control::MAX_RECIPE;
use crate::system::computing;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use serde_json::json;
use std::io::{self, Write as _};
use std::ops::RangeInclusive;
use std::time::{Duration, Instant};

/// Columns of a chart, unless asked for another number.
const COLUMNS: usize = 120;
const MOST_COLUMNS: usize = 1000;
/// Longest wait for the statistics of others.
const TURN: Duration = Duration::from_secs(30);
/// Longest wait for a client, all in all: meanwhile the history's log grows.
const SLOW: Duration = Duration::from_secs(30);

/// Since when results count, besides `since_us`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Period {
    /// Since ever.
    #[default]
    All,
    /// Since the recipe was taught last.
    Teach,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StatisticsQuery {
    recipe: u16,
    slot: Option<u16>,
    #[serde(default)]
    period: Period,
    since_us: Option<u64>,
    until_us: Option<u64>,
    #[serde(default)]
    axis: Axis,
    columns: Option<usize>,
}

fn within<T: PartialOrd + std::fmt::Display>(
    key: &str,
    value: T,
    range: RangeInclusive<T>,
) -> Answered<T> {
    if range.contains(&value) {
        return Ok(value);
    }
    let (least, most) = range.into_inner();
    let words = format!("{key}={value}: write {least} to {most}");
    Err(Problem::unclear(words))
}

impl StatisticsQuery {
    fn request(self, site: &Site) -> Answered<StatisticsRequest> {
        let recipe = within("recipe", self.recipe, 1..=MAX_RECIPE)?;
        let slot = self
            .slot
            .map(|slot| within("slot", slot, 1..=MAX_GAUGES as u16));
        let columns = self.columns.unwrap_or(COLUMNS);
        let since_us = match self.period {
            Period::All => self.since_us,
            Period::Teach if self.since_us.is_some() => {
                let words = "period=teach: leave out since_us, or write period=all";
                return Err(Problem::unclear(words));
            }
            Period::Teach => {
                let taught = site
                    .recipes
                    .manifest(recipe)
                    .map_err(|error| Problem::unclear(format!("period=teach: {}", error.words)))?;
                let at = Some(taught.taught_at_unix_s).filter(|at| *at > 0);
                let words = "period=teach: the clock was not synchronised when the recipe was taught: write since_us";
                Some(at.ok_or_else(|| Problem::unclear(words))? * 1_000_000)
            }
        };
        if let Some((since, until)) = since_us.zip(self.until_us)
            && since >= until
        {
            let words = format!("until_us={until}: write a time behind since_us, {since}");
            return Err(Problem::unclear(words));
        }
        Ok(StatisticsRequest {
            filter: Filter {
                recipe: Some(recipe),
                since_us,
                until_us: self.until_us,
                ..Filter::default()
            },
            slot: slot.transpose()?,
            axis: self.axis,
            columns: within("columns", columns, 1..=MOST_COLUMNS)?,
        })
    }
}

pub(super) async fn statistics(
    site: Site,
    Query(wanted): Query<StatisticsQuery>,
) -> Answered<Response> {
    let asked = site.aside(move |site| wanted.request(site)).await?;
    let turn = tokio::time::timeout(TURN, site.reckoning.clone().acquire_owned()).await;
    let crowded = |_| Problem::crowded("other statistics are worked out: try again");
    let turn = turn
        .map_err(crowded)?
        .map_err(|_| Problem::broken(FAILED))?;
    let body = sent_alone("statistics", FAILED, move |mut to, begun| {
        let _turn = turn;
        computing::stand_back();
        let (mut begun, mut waited) = (Some(begun), Duration::ZERO);
        let worked = site.history.id().and_then(|id| {
            let of_studies = site.studies.seqs(&id);
            site.history.statistics(&asked, &of_studies, |part| {
                if let StatisticsPart::Results(_) = part
                    && begun.take().is_none_or(|begun| begun.send(Ok(())).is_err())
                {
                    return false;
                }
                let since = Instant::now();
                let said = line(&mut to, &part).and_then(|()| to.flush());
                waited += since.elapsed();
                said.is_ok() && waited < SLOW
            })
        });
        let ended = worked.map_err(|error| match begun.take() {
            Some(begun) => drop(begun.send(Err(error.into()))),
            // The client has the beginning: it is told why there is no end.
            None => drop(line(
                &mut to,
                &json!({ "part": "error", "error": error.to_string() }),
            )),
        });
        to.end(ended.map_err(|()| io::ErrorKind::Other.into()));
    });
    let body = body.await?;
    Ok(([(header::CONTENT_TYPE, "application/x-ndjson")], body).into_response())
}

const FAILED: &str = "working the statistics out failed; see the log";
