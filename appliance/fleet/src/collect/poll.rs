//! Asks one head for its results and its state, again and again.

use super::Tally;
use super::lines::{Lines, Trouble};
use crate::answer::{EarlierHistory, Header, LIFE, Row, Wrong};
use crate::config::{Config, HeadConfig};
use crate::http::{Client, shortened};
use crate::log::{self, Severity};
use crate::now_ms;
use crate::part::Part;
use crate::store::{Batch, Gap, HeadState, Received};
use serde_json::Value;
use std::collections::HashMap;
use std::fmt::Display;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::sync::mpsc::Sender;
use tokio::time::{Instant, sleep, sleep_until};

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
    pub(super) config: Config,
    pub(super) part: Part,
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

/// The task of one head.
pub(super) struct Poll {
    client: Client,
    plant: Arc<Plant>,
    out: Sender<Batch>,
    /// What was not handed on yet.
    batch: Batch,
    state: HeadState,
    state_asked: Option<Instant>,
    /// The trouble that the log has last: what a collector before said is said again.
    said: String,
}

impl Poll {
    /// A task that goes on where `state` ended.
    pub(super) fn new(
        config: HeadConfig,
        mut state: HeadState,
        plant: Arc<Plant>,
        out: Sender<Batch>,
    ) -> Self {
        state.url = config.url.to_string();
        state.line = config.line;
        if let Some(serial) = config.serial
            && serial != state.serial
        {
            state.serial = serial;
            state.history.clear();
        }
        // Of what it was when the state was written there may be a newer life.
        state.history = plant.newest_life(&state.serial, base(&state.history));
        state.seq = plant.end(&state.serial, &state.history);
        if !state.serial.is_empty() && plant.place(&state.serial, &state.url).is_err() {
            // Two heads have it: this one is named when it answers.
            state.serial.clear();
        }
        Self {
            client: Client::new(config.url, plant.config.tls.clone()),
            plant,
            out,
            batch: Batch::default(),
            state,
            state_asked: None,
            said: String::new(),
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
            sleep_until(next).await;
            match self.ask().await {
                Ok(Asked::Foreign) => {
                    self.plant.tally.note(&self.state.url, None);
                    return;
                }
                Ok(asked) => {
                    pause = PAUSES[0];
                    self.answered().await;
                    if matches!(asked, Asked::All) {
                        // Late questions are not made up for.
                        next = (next + self.plant.config.poll).max(Instant::now());
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
            return Err(Wrong::Serial(header.serial, self.state.serial.clone()).into());
        }
        let restored = self.state.seq == 0 && !header.earlier.is_empty();
        if base(&self.state.history) != header.history || restored {
            // What was fetched under an id before is not fetched again.
            let fetched = header.earlier.iter().map(|earlier| self.fetched(earlier));
            let fetched = fetched.max().unwrap_or(0);
            self.state.history = self.plant.newest_life(&header.serial, &header.history);
            let end = self.plant.end(&header.serial, &self.state.history);
            self.state.seq = end.max(fetched);
            if self.state.seq != after {
                // The answer is about what is behind a SEQ of another history.
                self.client.close();
                return Ok(Asked::More);
            }
        }
        if let Some(last) = header.last
            && last < after
        {
            self.live_again(last).await;
            return Ok(Asked::More);
        }
        if let Some(first) = header.first
            && first > after.saturating_add(1)
        {
            let (first, last) = (after + 1, first - 1);
            self.say(
                Severity::Warning,
                format_args!("results {first} to {last} were deleted before they were fetched"),
            );
            self.skip(first, last);
        }
        let before = self.state.clone();
        let received = self.rows(&mut lines, &header).await;
        if matches!(received, Err(Trouble::Wrong(_))) {
            // It is asked for again from the beginning: what was skipped may be there.
            self.batch.rows.clear();
            self.state = before;
        }
        self.hand_on().await;
        Ok(match received? < LIMIT {
            true => Asked::All,
            false => Asked::More,
        })
    }

    /// The last SEQ that was fetched of a history that a head has under another id now.
    fn fetched(&self, earlier: &EarlierHistory) -> u32 {
        let seq = match base(&self.state.history) == earlier.history {
            true => self.state.seq,
            false => {
                let serial = &self.state.serial;
                let newest = self.plant.newest_life(serial, &earlier.history);
                self.plant.end(serial, &newest)
            }
        };
        seq.min(earlier.last)
    }

    /// Numbers of a history went back to `last`, as those of an image of a card that was restored do:
    /// what follows is stored as results of another life of it, beside those of the one before.
    /// What the head has now up to `last` may be the same as before, and is skipped.
    async fn live_again(&mut self, last: u32) {
        let after = self.state.seq;
        self.state.history = next_life(&self.state.history);
        self.say(
            Severity::Warning,
            format_args!(
                "SEQ went back from {after} to {last}: an older copy of its storage was restored; results behind {last} are stored as those of history {}, and the first {last} of it are not fetched again",
                self.state.history
            ),
        );
        self.skip(1, last);
        self.client.close();
        self.hand_on().await;
    }

    /// Records that results are not fetched.
    fn skip(&mut self, first: u32, last: u32) {
        if first <= last {
            self.batch.gaps.push(Gap {
                serial: self.state.serial.clone(),
                history: self.state.history.clone(),
                first,
                last,
            });
        }
        self.state.seq = last;
    }

    /// Takes the results of an answer.
    async fn rows(&mut self, lines: &mut Lines, header: &Header) -> Result<u32, Trouble> {
        let mut count = 0;
        while let Some(line) = lines.next().await? {
            if count == LIMIT {
                return Err(Wrong::More(LIMIT).into());
            }
            let mut row = Row::read(line, header, self.state.seq)?;
            row.history.clone_from(&self.state.history);
            let at_unix_ms = now_ms();
            self.state.seq = row.seq;
            self.state.last_result_unix_ms = row.at_unix_ms.or(Some(at_unix_ms));
            self.batch.rows.push(Received { row, at_unix_ms });
            count += 1;
            if self.batch.rows.len() == PIECE || !lines.has_next() {
                self.hand_on().await;
            }
        }
        Ok(count)
    }

    async fn hand_on(&mut self) {
        if !self.batch.is_empty() {
            // Without a writer the program is about to end.
            let _ = self.out.send(std::mem::take(&mut self.batch)).await;
        }
    }

    /// Notes that the head answers, and now and then asks for its state.
    async fn answered(&mut self) {
        let changed = self.plant.tally.note(&self.state.url, Some(true));
        if changed && !self.state.error.is_empty() {
            self.say(Severity::Info, "it answers again");
        }
        self.said.clear();
        let pause = self.plant.config.state;
        let due = self
            .state_asked
            .is_none_or(|asked| asked.elapsed() >= pause);
        if !due && !changed {
            return;
        }
        self.state_asked = Some(Instant::now());
        let answer = self
            .client
            .whole("/api/snapshot", None, MOST_SNAPSHOT)
            .await;
        let answer: Value = serde_json::from_slice(&answer.unwrap_or_default()).unwrap_or_default();
        if answer.is_null() {
            self.client.close();
        }
        let text = |value: &Value| shortened(value.as_str().unwrap_or_default());
        let recipe = &answer["recipe"];
        self.state.recipe = recipe["number"]
            .as_u64()
            .and_then(|number| number.try_into().ok());
        self.state.recipe_name = text(&recipe["name"]);
        self.state.drift_px = answer["health"]["drift_px"].as_f64();
        self.state.state = text(&answer["state"]);
        self.write_state(String::new()).await;
    }

    async fn failed(&mut self, trouble: &Trouble, pause: Duration) {
        self.plant.tally.note(&self.state.url, Some(false));
        let words = trouble.to_string();
        if self.said != words {
            let pause_s = pause.as_secs();
            self.say(
                Severity::Warning,
                format_args!("{words}; it is asked again in {pause_s} s"),
            );
            self.said.clone_from(&words);
        }
        self.write_state(words).await;
    }

    async fn write_state(&mut self, error: String) {
        self.state.reachable = u8::from(error.is_empty());
        self.state.error = error;
        self.state.updated_unix_ms = now_ms();
        // Of a head that never answered one collector writes that it does not.
        if !self.state.serial.is_empty() || self.plant.part.has(&self.state.url) {
            self.batch.heads.push(self.state.clone());
        }
        self.hand_on().await;
    }

    fn say(&self, severity: Severity, words: impl Display) {
        let serial = match &*self.state.serial {
            "" => String::new(),
            serial => format!(" ({serial})"),
        };
        log::write(
            severity,
            format_args!("{}{serial}: {words}", self.state.url),
        );
    }
}

/// The id of a history as its head has it.
fn base(history: &str) -> &str {
    history.split(LIFE).next().unwrap_or(history)
}

/// The number of a life of a history.
fn life(history: &str) -> u32 {
    let number = history
        .split_once(LIFE)
        .and_then(|(_, life)| life.parse().ok());
    number.unwrap_or(1)
}

/// What the next life of a history is called.
fn next_life(history: &str) -> String {
    format!("{}{LIFE}{}", base(history), life(history).saturating_add(1))
}

impl Plant {
    /// The life of a history that was fetched last when the collector began.
    fn newest_life(&self, serial: &str, history: &str) -> String {
        let own = self
            .ends
            .keys()
            .filter(|(of, id)| of == serial && base(id) == history);
        let newest = own.map(|(_, id)| id).max_by_key(|id| life(id));
        newest.map_or(history.to_owned(), String::clone)
    }

    /// Notes where a serial answers.
    fn place(&self, serial: &str, url: &str) -> Result<(), Wrong> {
        let mut places = self.places.lock().unwrap_or_else(PoisonError::into_inner);
        let place = places
            .entry(serial.to_owned())
            .or_insert_with(|| url.to_owned());
        match place == url {
            true => Ok(()),
            false => Err(Wrong::Taken(serial.to_owned(), place.clone())),
        }
    }

    /// The last SEQ that was fetched of a history when the collector began.
    fn end(&self, serial: &str, history: &str) -> u32 {
        let key = (serial.to_owned(), history.to_owned());
        self.ends.get(&key).copied().unwrap_or(0)
    }
}
