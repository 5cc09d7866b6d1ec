//! The part in front of a simulated head: which one lies there, which there are, and putting another in its place.
//!
//! The light of a part is worked out aside, which takes seconds, while the station goes on with the part before. Then the measuring
//! task puts it in place between two cycles: frames of one cycle never show two parts.

use crate::production::Order;
use hal::bounds::clipped;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use sim::{Part, Placement, Scenario, Stage, Staged};
use std::sync::mpsc::{self, RecvTimeoutError, Sender, SyncSender};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;

/// Longest wait for the measuring task: it may be in the middle of a cycle.
const PATIENCE: Duration = Duration::from_secs(3);
/// The most defects of a part: each ray is traced against all of them.
const MAX_DEFECTS: usize = 16;
/// The defects that there are, each with the names of its numbers in their order, and an example of it.
const DEFECTS: [(&str, &[(&str, f64)]); 3] = [
    (
        "dent",
        &[
            ("x", 0.0),
            ("y", -8.0),
            ("depth_mm", 0.6),
            ("diameter_mm", 14.0),
        ],
    ),
    ("missing_hole", &[("index", 1.0)]),
    ("bent_flange", &[("degrees", 3.0)]),
];

/// A part and where it lies, as a scenario has them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Placed {
    /// The part with its defects.
    pub part: Part,
    /// Where it lies; as it was designed, if left out.
    #[serde(default)]
    pub placement: Placement,
}

/// Why a part was not put in place, in words with the remedy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PutError {
    /// There is no such part, or the head is not simulated.
    #[error("{0}")]
    Unfit(String),
    /// Not now.
    #[error("{0}")]
    Busy(String),
}

impl Placed {
    /// The stock part of a kind, good, where it was designed to lie.
    ///
    /// # Errors
    /// If there is no such kind: those that there are.
    pub fn stock(kind: &str) -> Result<Self, String> {
        let mut stock = Part::stock().into_iter();
        let found = stock.find(|part| self::kind(part) == kind);
        let part = found.ok_or_else(|| {
            let kinds: Vec<String> = Part::stock().iter().map(self::kind).collect();
            format!("there is no part {kind}: name one of {}", kinds.join(", "))
        })?;
        Ok(Self {
            part,
            ..Self::default()
        })
    }

    /// The same part without its defects, where it was designed to lie.
    pub fn good(&self) -> Self {
        let mut value = value(&self.part);
        if let Some(defects) = value.get_mut("defects") {
            *defects = json!([]);
        }
        Self {
            // What was one stays one.
            part: serde_json::from_value(value).unwrap_or_default(),
            ..Self::default()
        }
    }

    /// Puts a good part of the kind in the place of the one that was `asked` for, to be taught; that one comes afterwards.
    pub fn after_teaching(asked: &mut Option<Self>) -> Option<Self> {
        let placed = asked.take()?;
        *asked = Some(placed.good());
        Some(placed)
    }

    /// Adds a defect, `KIND:NUMBER,NUMBER,…`, as in `dent:10,5,0.3,8`.
    ///
    /// # Errors
    /// If it is none, or the part has none of this kind.
    pub fn add_defect(&mut self, text: &str) -> Result<(), String> {
        let form = |(kind, keys): &(&str, &[(&str, f64)])| {
            let names: Vec<&str> = keys.iter().map(|(name, _)| *name).collect();
            format!("{kind}:{}", names.join(","))
        };
        let (kind, numbers) = text.split_once(':').unwrap_or((text, ""));
        let known = DEFECTS.iter().find(|(name, _)| *name == kind);
        let Some(known) = known else {
            let forms: Vec<String> = DEFECTS.iter().map(form).collect();
            return Err(format!(
                "there is no defect {:?}: write one of {}",
                clipped(kind),
                forms.join(" ")
            ));
        };
        let numbers: Vec<f64> = numbers
            .split(',')
            .map_while(|number| number.trim().parse().ok())
            .filter(|number: &f64| number.is_finite())
            .collect();
        let is_place = |n: f64| n >= 0.0 && n.fract() == 0.0;
        let mut named = known.1.iter().zip(&numbers);
        if numbers.len() != known.1.len()
            || numbers.len() != text.split(',').count()
            || !named.all(|((name, _), &n)| *name != "index" || is_place(n))
        {
            let (text, form) = (clipped(text), form(known));
            return Err(format!("{text:?} is no defect: write {form}"));
        }
        let named = known.1.iter().zip(numbers).map(|((name, _), n)| (*name, n));
        self.part = with_defect(&self.part, defect(kind, named))
            .map_err(|error| format!("a {} has no {kind}: {error}", self::kind(&self.part)))?;
        Ok(())
    }

    /// Checks every number.
    ///
    /// # Errors
    /// Naming the one that is out of its range.
    pub fn check(&self) -> Result<(), String> {
        let defects = value(&self.part)["defects"].as_array().map_or(0, Vec::len);
        if defects > MAX_DEFECTS {
            return Err(format!(
                "{defects} defects: at most {MAX_DEFECTS} are simulated on a part"
            ));
        }
        let scenario = Scenario {
            part: self.part.clone(),
            placement: self.placement,
            ..Scenario::default()
        };
        scenario.check()
    }
}

fn value(part: &Part) -> Value {
    serde_json::to_value(part).unwrap_or_default()
}

fn kind(part: &Part) -> String {
    value(part)["kind"].as_str().unwrap_or_default().to_owned()
}

fn defect<'a>(kind: &str, numbers: impl Iterator<Item = (&'a str, f64)>) -> Value {
    let mut defect = Map::from_iter([("kind".to_owned(), json!(kind))]);
    for (name, number) in numbers {
        // Places are counted in whole numbers.
        let whole = name == "index" && number.fract() == 0.0 && number >= 0.0;
        let number = if whole {
            json!(number as u64)
        } else {
            json!(number)
        };
        defect.insert(name.to_owned(), number);
    }
    defect.into()
}

/// The part with one more defect, if it has any of this kind.
fn with_defect(part: &Part, defect: Value) -> Result<Part, String> {
    let mut value = value(part);
    let defects = value.get_mut("defects").and_then(Value::as_array_mut);
    defects
        .ok_or("it has no defects to choose from")?
        .push(defect);
    serde_json::from_value(value).map_err(|error| error.to_string())
}

/// Every stock part with an example of each defect that it can have.
fn kinds() -> Vec<Value> {
    let offers = |part: &Part| -> Vec<Value> {
        let all = DEFECTS
            .iter()
            .map(|(kind, numbers)| defect(kind, numbers.iter().copied()));
        let is_one = |defect: &Value| {
            with_defect(part, defect.clone()).is_ok_and(|part| {
                let placed = Placed {
                    part,
                    ..Placed::default()
                };
                placed.check().is_ok()
            })
        };
        all.filter(is_one).collect()
    };
    let parts = Part::stock().into_iter();
    parts
        .map(|part| json!({ "part": part, "defects": offers(&part) }))
        .collect()
}

/// The way to the part in front of a simulated head. Cheap to clone.
#[derive(Clone)]
pub struct Simulation {
    stage: Arc<OnceLock<Stage>>,
    orders: Sender<Order>,
    alone: Arc<Mutex<()>>,
}

impl Simulation {
    /// Of a measuring task that takes these orders.
    pub fn new(orders: Sender<Order>) -> Self {
        Self {
            stage: Arc::default(),
            orders,
            alone: Arc::default(),
        }
    }

    /// The head is open: where parts are placed in front of it, if it is simulated.
    pub fn opened(&self, stage: Option<&Stage>) {
        if let Some(stage) = stage {
            // A second time it is the same one.
            let _ = self.stage.set(stage.clone());
        }
    }

    /// The part that is in place, and those that may be put there, as `GET /api/simulation/part` answers.
    pub fn view(&self) -> Value {
        match self.stage.get() {
            None => json!({ "simulated": false }),
            Some(stage) => {
                let (part, placement) = stage.placed();
                json!({ "simulated": true, "part": part, "placement": placement, "kinds": kinds() })
            }
        }
    }

    /// Puts a part in place, and returns when the next cycle sees it. Takes seconds.
    ///
    /// # Errors
    /// The head is not simulated, the part cannot be, or the measuring task has something else to do.
    pub fn put(&self, placed: &Placed) -> Result<(), PutError> {
        let unfit = |words: String| PutError::Unfit(format!("put the part in place: {words}"));
        let stage = self.stage.get().ok_or_else(|| {
            unfit("the head is not simulated: its part is the one that lies there".into())
        })?;
        placed.check().map_err(unfit)?;
        let Ok(_alone) = self.alone.try_lock() else {
            let words =
                "put the part in place: another one is being put there; try again when it is";
            return Err(PutError::Busy(words.into()));
        };
        let staged = stage
            .work_out(&placed.part, &placed.placement, &|_| ())
            .map_err(|error| PutError::Unfit(error.to_string()))?;
        let (done, told) = mpsc::sync_channel(1);
        let waiting = Arc::new(Mutex::new(Some(staged)));
        let placing = Placing {
            stage: stage.clone(),
            waiting: waiting.clone(),
            done,
        };
        // Where nobody takes it, nobody answers.
        drop(self.orders.send(Order::Place(placing)));
        let busy = || {
            let words = "put the part in place: the measuring task is busy or its head is lost; try again when it is ready";
            Err(PutError::Busy(words.into()))
        };
        match told.recv_timeout(PATIENCE) {
            Ok(()) => Ok(()),
            Err(RecvTimeoutError::Disconnected) => busy(),
            // It is taken back, unless it is being put in place at this moment.
            Err(RecvTimeoutError::Timeout) => match taken(&waiting) {
                Some(_) => busy(),
                None => told.recv().or_else(|_| busy()),
            },
        }
    }
}

/// A part on its way in front of the head, for the measuring task.
pub struct Placing {
    stage: Stage,
    waiting: Arc<Mutex<Option<Staged>>>,
    done: SyncSender<()>,
}

impl Placing {
    /// Puts it in place, unless whoever asked has given up.
    pub fn carry_out(self) {
        if let Some(staged) = taken(&self.waiting) {
            self.stage.show(staged);
            let _ = self.done.send(());
        }
    }
}

impl std::fmt::Debug for Placing {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str("Placing")
    }
}

fn taken(waiting: &Mutex<Option<Staged>>) -> Option<Staged> {
    let mut waiting = waiting.lock().unwrap_or_else(PoisonError::into_inner);
    waiting.take()
}

#[cfg(test)]
mod tests;
