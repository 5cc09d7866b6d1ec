//! Asks one head for its results and its state, again and again.

use super::lines::Lines;
use super::now_ms;
use super::tally::Tally;
use super::trouble::Trouble;
use crate::answer::{Header, Row, Wrong};
use crate::config::HeadConfig;
use crate::http::{Client, shortened};
use crate::log::{self, Severity};
use crate::part::Part;
use crate::store::{Batch, Gap, HeadState, Received};
use rustls::ClientConfig;
use serde::Deserialize;
use std::collections::HashMap;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::sync::mpsc::Sender;
use tokio::time::{Instant, sleep};

/// The most results that are handed to the writer at a time.
pub(super) const PIECE: usize = 500;
/// The most results that are asked for at a time.
const LIMIT: u32 = 10_000;
/// Pause before a head that fails is asked again, at first and at most.
const PAUSES: [Duration; 2] = [Duration::from_secs(1), Duration::from_secs(60)];
/// The most bytes of a snapshot: 64 gauges take a third.
const MOST_SNAPSHOT: usize = 256 << 10;

/// What the tasks of all heads share.
pub(super) struct Plant {
    pub(super) tls: Option<Arc<ClientConfig>>,
    pub(super) part: Part,
    pub(super) poll: Duration,
    pub(super) state: Duration,
    /// How far each history was fetched when the collector began, by serial and history.
    pub(super) ends: HashMap<(String, String), u32>,
    /// Where each serial answers.
    pub(super) places: Mutex<HashMap<String, String>>,
    pub(super) tally: Tally,
}

/// What a question came to.
enum Asked {
    /// There is nothing more for now.
    All,
    /// There is more, or another question is to be asked.
    More,
    /// The head belongs to another collector.
    Foreign,
}

/// The part of `GET /api/snapshot` that is read.
#[derive(Deserialize)]
struct Snapshot {
    state: String,
    recipe: Option<Recipe>,
    #[serde(default)]
    health: Health,
}

#[derive(Deserialize)]
struct Recipe {
    number: u16,
    name: String,
}

#[derive(Default, Deserialize)]
struct Health {
    drift_px: Option<f64>,
}

/// The task of one head.
pub(super) struct Poll {
    config: HeadConfig,
    client: Client,
    plant: Arc<Plant>,
    out: Sender<Batch>,
    state: HeadState,
    /// Whether it answered the last question; none before the first.
    answers: Option<bool>,
    state_asked: Option<Instant>,
}

impl Poll {
    /// A task that goes on where `before` ended.
    pub(super) fn new(
        config: HeadConfig,
        before: HeadState,
        plant: Arc<Plant>,
        out: Sender<Batch>,
    ) -> Self {
        let mut state = HeadState {
            url: config.url.to_string(),
            line: config.line.clone(),
            ..before
        };
        if let Some(serial) = config
            .serial
            .as_ref()
            .filter(|serial| **serial != state.serial)
        {
            state.serial.clone_from(serial);
            state.history.clear();
        }
        state.seq = plant.end(&state.serial, &state.history);
        if !state.serial.is_empty() && plant.place(&state.serial, &state.url).is_err() {
            // Two heads have it: this one is named when it answers.
            state.serial.clear();
        }
        Self {
            client: Client::new(config.url.clone(), plant.tls.clone()),
            config,
            plant,
            out,
            state,
            answers: None,
            state_asked: None,
        }
    }

    /// Asks until the program ends, or the head turns out to be another collector's.
    pub(super) async fn run(mut self, offset: Duration) {
        if !self.state.serial.is_empty() && !self.plant.part.has(&self.state.serial) {
            return;
        }
        let mut next = Instant::now() + offset;
        let mut pause = PAUSES[0];
        loop {
            tokio::time::sleep_until(next).await;
            match self.ask().await {
                Ok(Asked::Foreign) => {
                    self.note(None);
                    return;
                }
                Ok(asked) => {
                    pause = PAUSES[0];
                    self.answered().await;
                    if matches!(asked, Asked::All) {
                        // Late questions are not made up for.
                        next = (next + self.plant.poll).max(Instant::now());
                    }
                }
                Err(trouble) => {
                    self.client.close();
                    self.failed(&trouble, pause).await;
                    sleep(pause).await;
                    next = Instant::now();
                    pause = (2 * pause).min(PAUSES[1]);
                }
            }
        }
    }

    /// Asks for the results behind the last, and hands them on.
    async fn ask(&mut self) -> Result<Asked, Trouble> {
        let after = self.state.seq;
        let path = format!("/api/results?after={after}&limit={LIMIT}");
        let mut lines = Lines::of(self.client.get(&path).await?);
        let header = Header::read(lines.next().await?.ok_or(Trouble::Cut)?)?;
        if self.state.serial.is_empty() {
            if !self.plant.part.has(&header.serial) {
                return Ok(Asked::Foreign);
            }
            self.plant.place(&header.serial, &self.state.url)?;
            self.state.serial.clone_from(&header.serial);
        } else if self.state.serial != header.serial {
            let (found, known) = (header.serial, self.state.serial.clone());
            return Err(Wrong::Serial { found, known }.into());
        }
        if self.state.history != header.history {
            self.state.history.clone_from(&header.history);
            self.state.seq = self.plant.end(&header.serial, &header.history);
            if self.state.seq != after {
                // The answer is about what is behind a SEQ of another history.
                self.client.close();
                return Ok(Asked::More);
            }
        }
        if header.last.is_some_and(|last| last < after) {
            return Err(header.impossible(after).into());
        }
        if let Some(first) = header
            .first
            .filter(|&first| first > after.saturating_add(1))
        {
            let gap = Gap {
                serial: header.serial.clone(),
                history: header.history.clone(),
                first: after + 1,
                last: first - 1,
            };
            let words = format!(
                "results {} to {} were deleted before they were fetched",
                gap.first, gap.last
            );
            self.say(Severity::Warning, &words);
            self.hand_on(Batch {
                gaps: vec![gap],
                ..Batch::default()
            })
            .await;
            self.state.seq = first - 1;
        }
        let received = self.rows(&mut lines, &header).await?;
        Ok(if received < LIMIT {
            Asked::All
        } else {
            Asked::More
        })
    }

    /// Hands on the results of an answer. One with a wrong line is asked for again from its
    /// beginning: what was skipped before that line may be there.
    async fn rows(&mut self, lines: &mut Lines, header: &Header) -> Result<u32, Trouble> {
        let (mut count, after) = (0, self.state.seq);
        let mut rows = Vec::new();
        loop {
            if rows.len() == PIECE || (!rows.is_empty() && !lines.has_next()) {
                self.take(&mut rows).await;
            }
            let read = match lines.next().await {
                Ok(None) => return Ok(count),
                Ok(Some(_)) if count == LIMIT => Err(Wrong::More(LIMIT).into()),
                Ok(Some(line)) => {
                    let before = rows
                        .last()
                        .map_or(self.state.seq, |row: &Received| row.row.seq);
                    Row::read(line, header, before).map_err(Trouble::from)
                }
                Err(trouble) => Err(trouble),
            };
            match read {
                Ok(row) => rows.push(Received {
                    row,
                    at_unix_ms: now_ms(),
                }),
                Err(Trouble::Wrong(wrong)) => {
                    self.state.seq = after;
                    return Err(wrong.into());
                }
                Err(trouble) => {
                    self.take(&mut rows).await;
                    return Err(trouble);
                }
            }
            count += 1;
        }
    }

    /// Hands rows on, and remembers the last.
    async fn take(&mut self, rows: &mut Vec<Received>) {
        let Some(last) = rows.last() else { return };
        self.state.seq = last.row.seq;
        self.state.last_result_unix_ms = last.row.at_unix_ms.or(Some(last.at_unix_ms));
        let rows = std::mem::take(rows);
        self.hand_on(Batch {
            rows,
            ..Batch::default()
        })
        .await;
    }

    /// Notes that the head answers, and now and then asks for its state.
    async fn answered(&mut self) {
        let changed = self.note(Some(true));
        if changed && !self.state.error.is_empty() {
            self.say(Severity::Info, "it answers again");
        }
        let due = self
            .state_asked
            .is_none_or(|asked| asked.elapsed() >= self.plant.state);
        if !due && !changed {
            return;
        }
        self.state_asked = Some(Instant::now());
        let answer = self.client.get_whole("/api/snapshot", MOST_SNAPSHOT).await;
        let answer = answer
            .ok()
            .and_then(|answer| serde_json::from_slice(&answer).ok());
        let answer: Option<Snapshot> = answer;
        let known = answer.is_some();
        let recipe = answer.as_ref().and_then(|answer| answer.recipe.as_ref());
        self.state.recipe = recipe.map(|recipe| recipe.number);
        self.state.recipe_name = recipe.map_or_else(String::new, |recipe| shortened(&recipe.name));
        self.state.drift_px = answer.as_ref().and_then(|answer| answer.health.drift_px);
        self.state.state = answer.map_or_else(String::new, |answer| shortened(&answer.state));
        if !known {
            self.client.close();
        }
        self.write_state(String::new()).await;
    }

    async fn failed(&mut self, trouble: &Trouble, pause: Duration) {
        self.note(Some(false));
        let words = trouble.to_string();
        if self.state.error != words {
            self.say(
                Severity::Warning,
                &format!("{words}; it is asked again in {} s", pause.as_secs()),
            );
        }
        self.write_state(words).await;
    }

    async fn write_state(&mut self, error: String) {
        self.state.reachable = u8::from(error.is_empty());
        self.state.error = error;
        self.state.updated_unix_ms = now_ms();
        // Of a head that never answered one collector writes that it does not.
        if !self.state.serial.is_empty() || self.plant.part.has(&self.state.url) {
            let heads = vec![self.state.clone()];
            self.hand_on(Batch {
                heads,
                ..Batch::default()
            })
            .await;
        }
    }

    async fn hand_on(&self, batch: Batch) {
        // Without a writer the program is about to end.
        let _ = self.out.send(batch).await;
    }

    /// Counts the head among those that answer, those that do not, or neither; answers whether that
    /// is new.
    fn note(&mut self, now: Option<bool>) -> bool {
        let tally = &self.plant.tally;
        let count = |answers| {
            if answers {
                &tally.answering
            } else {
                &tally.failing
            }
        };
        let before = std::mem::replace(&mut self.answers, now);
        if before == now {
            return false;
        }
        before.map(|answers| count(answers).fetch_sub(1, Relaxed));
        now.map(|answers| count(answers).fetch_add(1, Relaxed));
        true
    }

    fn say(&self, severity: Severity, words: &str) {
        let serial = match &*self.state.serial {
            "" => String::new(),
            serial => format!(" ({serial})"),
        };
        log::write(severity, &format!("{}{serial}: {words}", self.config.url));
    }
}

impl Plant {
    /// Notes where a serial answers.
    fn place(&self, serial: &str, url: &str) -> Result<(), Wrong> {
        let mut places = self.places.lock().unwrap_or_else(PoisonError::into_inner);
        let place = places
            .entry(serial.to_owned())
            .or_insert_with(|| url.to_owned());
        match place == url {
            true => Ok(()),
            false => Err(Wrong::Taken {
                serial: serial.to_owned(),
                url: place.clone(),
            }),
        }
    }

    /// The last SEQ that was fetched of a history when the collector began.
    fn end(&self, serial: &str, history: &str) -> u32 {
        let key = (serial.to_owned(), history.to_owned());
        self.ends.get(&key).copied().unwrap_or(0)
    }
}
