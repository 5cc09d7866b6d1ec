//! Tries an edit of a recipe before it is stored: on golden, on the last part, on kept ones.
//!
//! Of each session one try is answered at a time, and the newest wins: an older one is answered at
//! once and given up at its next step. One is worked out at a time, on a thread with a lower priority
//! than the measuring task. What does not change between tries, the recipe as it is stored, is kept
//! for a minute for the one that was tried last.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use axum::body::Body;
use axum::extract::Request;
use axum::http::HeaderMap;
use axum::response::Json;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use serde_json::value::RawValue;
use serde_json::{Value, json};
use tokio::runtime::Handle;
use tokio::sync::Mutex;
use tokio::time::{Instant, sleep};

use super::gate::token;
use super::history::kept_frames;
use super::problem::{Answered, Problem};
use super::request;
use super::request::Path;
use super::site::{LastOpened, Site, alone};
use crate::history::kept::Kept;
use crate::recipe::ChangeError;
use crate::recipe::edit::Edit;
use crate::recipe::edit::trying::{EditedRecipe, Over, Tried};
use crate::recipe::plan::Plan;
use crate::station::result::flag::SIMULATED;
use crate::system::computing;

/// Most kept parts of one try.
const MAX_PARTS: usize = 20;
/// How long a recipe is kept for the next try of an edit of it: at full size it is 70 MB.
const KEPT: Duration = Duration::from_secs(60);

/// On which parts an edit is tried, beside golden.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(
    untagged,
    expecting = "on: write \"golden\", \"last\" or a list of RESULT_SEQ"
)]
enum On {
    #[default]
    #[serde(skip)]
    Golden,
    Named(Named),
    Kept(Vec<u32>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Named {
    Golden,
    Last,
}

impl On {
    fn json(&self) -> Value {
        match self {
            Self::Golden | Self::Named(Named::Golden) => "golden".into(),
            Self::Named(Named::Last) => "last".into(),
            Self::Kept(seqs) => json!(seqs),
        }
    }
}

/// An edit, and what it is tried on.
#[derive(Debug)]
struct Asked {
    edit: Edit,
    on: On,
}

impl<'de> Deserialize<'de> for Asked {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let mut keys: HashMap<String, Box<RawValue>> = HashMap::deserialize(from)?;
        let on = keys.remove("on");
        let on = on.map(|on| serde_json::from_str(on.get())).transpose();
        let edit = serde_json::to_string(&keys).and_then(|edit| serde_json::from_str(&edit));
        Ok(Self {
            edit: edit.map_err(D::Error::custom)?,
            on: on.map_err(D::Error::custom)?.unwrap_or_default(),
        })
    }
}

fn superseded() -> Problem {
    let words = "try an edit: this session has asked for a newer one";
    Problem::busy(words).with("why", "superseded")
}

pub(super) async fn attempt(
    site: Site,
    Path(number): Path<u16>,
    headers: HeaderMap,
    request: Request<Body>,
) -> Answered<Json<Value>> {
    let asked: Asked = request::edit(request).await?;
    if let On::Kept(seqs) = &asked.on
        && seqs.len() > MAX_PARTS
    {
        let words = format!("try an edit on {} parts: at most {MAX_PARTS}", seqs.len());
        return Err(Problem::unfit(words));
    }
    let turn = site.tries.begin(token(&headers).unwrap_or_default());
    let watched = turn.watched();
    let worked = async {
        // Waiting here takes no thread from other requests.
        let (kept, runtime) = (site.opened.clone(), Handle::current());
        let mut opened = kept.clone().lock_owned().await;
        let site = site.clone();
        let failed = "trying the edit failed; see the log";
        let work = move || {
            computing::give_way();
            let is_over = || watched.is_over();
            let answer = tried(&site, number, asked, (&mut opened, &is_over));
            runtime.spawn(forget(kept));
            answer
        };
        alone("trying", failed, work).await?
    };
    tokio::select! {
        answer = worked => answer.map(Json),
        () = turn.over() => Err(superseded()),
    }
}

/// Lets the recipe go when no edit of it has been tried for [`KEPT`].
async fn forget(opened: Arc<Mutex<LastOpened>>) {
    sleep(KEPT).await;
    let mut opened = opened.lock_owned().await;
    if opened
        .take_if(|(_, tried)| tried.elapsed() >= KEPT)
        .is_some()
    {
        computing::trim_memory();
    }
}

/// Tries an edit, with the recipe that was tried last.
fn tried(
    site: &Site,
    number: u16,
    Asked { edit, on }: Asked,
    (opened, is_over): (&mut LastOpened, &dyn Fn() -> bool),
) -> Answered<Value> {
    let begun = Instant::now();
    if is_over() {
        return Err(superseded());
    }
    let stored = site.recipes.manifest(number).map_err(Problem::missing)?;
    let same =
        |(opened, _): &(EditedRecipe, Instant)| opened.id() == (number, &*stored.fingerprint);
    let open = match opened.take().filter(same) {
        Some((open, _)) => open,
        None => EditedRecipe::new(site.recipes.load_to_edit(number)?).map_err(Problem::unfit)?,
    };
    let fingerprint = open.id().1.to_owned();
    if edit.fingerprint != fingerprint {
        let outdated = Problem::from(ChangeError::Outdated(number));
        return Err(outdated.with("fingerprint", fingerprint));
    }
    let shared = edit.part_number.as_ref();
    let shared = shared.map_or(Ok(()), |of| site.recipes.refuse_shared(number, of));
    let mut tried = open.attempt(edit, is_over).map_err(|Over| superseded())?;
    if let Err(words) = shared {
        let problem = json!({ "words": words.to_string(), "refused": true });
        tried.problems.insert(0, problem);
    }
    let parts = parts(site, (&open, &tried), &on, is_over)?;
    *opened = Some((open, Instant::now()));
    Ok(json!({
        "fingerprint": fingerprint, "on": on.json(), "features": tried.features, "gauges": tried.gauges,
        "problems": tried.problems, "parts": parts, "ms": begun.elapsed().as_millis() as u64,
    }))
}

/// What a tried list measures of a part.
struct TriedPart {
    part: Value,
    /// The verdict that the part had.
    before: Value,
}

fn other_frames() -> Problem {
    Problem::unfit("the recipe has no sequence with its frames")
}

/// What a tried list measures of parts.
fn parts(
    site: &Site,
    of: (&EditedRecipe, &Tried),
    on: &On,
    is_over: &dyn Fn() -> bool,
) -> Answered<Vec<Value>> {
    let part = |seq: Option<u32>, measured: Answered<TriedPart>| {
        let mut part = match measured {
            Ok(TriedPart { mut part, before }) => {
                part["before"] = before;
                part["error"] = Value::Null;
                part
            }
            Err(problem) => json!({ "error": problem.words }),
        };
        part["seq"] = seq.into();
        part
    };
    match on {
        On::Golden | On::Named(Named::Golden) => Ok(Vec::new()),
        On::Named(Named::Last) => {
            let last = last(site, of);
            Ok(vec![part(last.0, last.1)])
        }
        On::Kept(seqs) => seqs
            .iter()
            .map(|&seq| match is_over() {
                true => Err(superseded()),
                false => Ok(part(Some(seq), kept(site, of, seq))),
            })
            .collect(),
    }
}

/// What it measures of the last part, and the verdict that this had.
fn last(site: &Site, (open, tried): (&EditedRecipe, &Tried)) -> (Option<u32>, Answered<TriedPart>) {
    let Some(part) = site.last_cycle.ask(|part| part.clone()) else {
        let words = "the frames are gone, or nothing was measured yet: trigger a cycle";
        return (None, Err(Problem::missing(words)));
    };
    let measured = || {
        let number = part.record.recipe;
        if number != open.id().0 {
            let words = format!("it was measured by recipe {number}");
            return Err(Problem::unfit(words));
        }
        let recipe = open.recipe(tried).map_err(Problem::unfit)?;
        let shots: Vec<_> = part.plan.shots(part.sequence).map(Some).collect();
        let simulated = part.record.flags() & SIMULATED != 0;
        let plan = Plan::new(recipe, &part.calibration, simulated).map_err(Problem::unfit)?;
        let sequence = plan.sequence_among(&shots);
        let (sequence, places) = sequence.ok_or_else(other_frames)?;
        let frames: Vec<_> = places.iter().map(|&k| part.frames[k].clone()).collect();
        Ok(TriedPart {
            part: tried.part(&plan, sequence, &frames),
            before: part.record.verdict.word().into(),
        })
    };
    (Some(part.record.seq), measured())
}

/// What it measures of a kept part, and the verdict that this had.
fn kept(site: &Site, (open, tried): (&EditedRecipe, &Tried), seq: u32) -> Answered<TriedPart> {
    let (entry, folder) = kept_frames(site, seq)?;
    let recipe = open.recipe(tried).map_err(Problem::unfit)?;
    let kept = Kept::judged_by(&folder, &recipe)?;
    let plan = kept.plan(recipe, entry.flags & SIMULATED != 0);
    let plan = plan.map_err(Problem::unfit)?;
    let sequence = kept.sequence(&plan);
    let (sequence, frames) = sequence.ok_or_else(other_frames)?;
    Ok(TriedPart {
        part: tried.part(&plan, sequence, &frames),
        before: entry.verdict.word().into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edit_keeps_the_refusals_of_its_own_keys_beside_what_it_is_tried_on() {
        let asked = |text: &str| serde_json::from_str::<Asked>(text);
        let sound = asked(r#"{"fingerprint": "f", "on": [4, 5]}"#).unwrap();
        assert_eq!(sound.on.json(), json!([4, 5]));
        assert_eq!(sound.edit.fingerprint, "f");
        assert_eq!(
            asked(r#"{"fingerprint": "f"}"#).unwrap().on.json(),
            "golden"
        );
        for (text, words) in [
            (r#"{"on": "last"}"#, "fingerprint"),
            (r#"{"fingerprint": "f", "other": 1}"#, "other"),
            (r#"{"fingerprint": "f", "on": "first"}"#, "on: write"),
            (
                r#"{"fingerprint": "f", "gauges": [{"name": "g", "slot": 1, "kind": "none"}]}"#,
                "none",
            ),
        ] {
            let error = asked(text).unwrap_err().to_string();
            assert!(error.contains(words), "{text}: {error}");
        }
    }
}
