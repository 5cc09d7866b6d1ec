//! `fringed replay RECORDING`: judges a part that did not pass again, from its recorded frames, and
//! compares the result with the one in the history, bit by bit. With `--recipe FILE` it judges any
//! frames of the recipe's sequences.

use super::options::Measuring;
use crate::error::{Exit, Failure, Result};
use crate::history::kept::{self, Kept, missing};
use crate::history::{Entry, GaugeEntry, Reader, difference, seq_of};
use crate::recipe::plan::PlanError;
use crate::recipe::{Demands, Recipe, Store};
use crate::station::result::flag::SIMULATED;
use crate::station::{Inspection, ResultRecord, Square};
use crate::storage::archive::Unpacked;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Judge a part that did not pass again, from its recorded frames, or any recording by a recipe.
#[derive(Debug, clap::Args)]
pub struct Replay {
    /// The folder of its frames, which `fringed history` names, or their ZIP from the page; with a
    /// recipe also imported frames.
    recording: PathBuf,
    /// Another recipe than the one that it was judged by: a file, or `stored` for the station's
    /// recipe of the same number.
    #[arg(long, value_name = "FILE|stored")]
    recipe: Option<PathBuf>,
    #[command(flatten)]
    measuring: Measuring,
}

/// The recipe that a part is judged by again.
struct Chosen {
    recipe: Recipe,
    /// Where it comes from, in words.
    from: String,
    /// Whether the part was judged by this recipe before.
    original: bool,
}

impl Replay {
    /// Judges and compares.
    ///
    /// # Errors
    /// If the recording, the recipe or the history's result is missing (66) or damaged (65), the
    /// frames do not fit the recipe (65), the results differ (70), or as for every command with a
    /// configuration and a state folder.
    pub fn run(&self) -> Result<()> {
        let options = &self.measuring;
        let unpacked = Unpacked::of(&self.recording)?;
        let state = self.state()?;
        let store = Store::at(&state.join("recipes"));
        let (kept, chosen) = self.choose(unpacked.folder(), &store)?;
        let Chosen {
            recipe,
            from,
            original,
        } = chosen;
        let (number, fingerprint) = (recipe.id.number, recipe.id.fingerprint.clone());
        let demands = recipe.demands.clone();
        let before = result_of(&state, unpacked.name(), &kept)?;
        let flags = before.as_ref().map_or(0, |entry| entry.flags);
        let configured = options.files.configuration()?.threads;
        let judged = options.threads.pool(configured)?.install(|| {
            let plan = kept.plan(recipe, flags & SIMULATED != 0)?;
            let taken = kept.sequence(&plan);
            let look = |(sequence, frames): (_, Vec<_>)| {
                let (inspection, features) = plan.look(sequence, &frames);
                (inspection, serde_json::json!(features))
            };
            Ok::<_, PlanError>(taken.map(look))
        });
        let judged = judged.map_err(Exit::Content.failure())?;
        let (inspection, features) = judged.ok_or_else(|| {
            let words = format!(
                "replay {}: recipe {number}, fingerprint {fingerprint:.8}, has no sequence with these frames: name the recipe that the part was judged by, or record the part with `fringed record --recipe`",
                self.recording.display()
            );
            Failure::new(Exit::Content, words)
        })?;
        let replayed = entry(inspection, number, &fingerprint);
        let document = serde_json::json!({
            "replayed": detailed(&replayed, &demands, features)?, "stored": before,
            "recipe": { "from": from, "number": number, "fingerprint": fingerprint, "same": original },
        });
        let text = || table(&replayed, &from);
        options.output.answer(&document, text)?;
        if !original {
            if let Some(before) = before {
                options.output.remark(|| {
                    format!(
                        "result {} in the history is {}{}, judged by another recipe: the two are not compared",
                        before.seq,
                        before.verdict.word(),
                        because(&before)
                    )
                });
            }
            return Ok(());
        }
        let Some(before) = before else {
            if self.recipe.is_some() {
                let nothing = "the history has no result of this recording: compared with nothing";
                options.output.remark(|| nothing.into());
                return Ok(());
            }
            let message = format!(
                "compare with the history: it has no result of {} with the recording's recipe and PART_ID: the result above was compared with nothing",
                self.recording.display()
            );
            return Exit::Missing.fail(message);
        };
        match difference(&before, &replayed) {
            None => {
                options.output.remark(|| {
                    format!(
                        "the same as result {} in the history, bit by bit",
                        before.seq
                    )
                });
                Ok(())
            }
            Some(difference) => {
                let message = format!(
                    "the replay differs from result {}: {difference}",
                    before.seq
                );
                Exit::Software.fail(message)
            }
        }
    }

    /// The state folder: that of `--state` if it is given, else the one that the recording lies in,
    /// else the configured one.
    fn state(&self) -> Result<PathBuf> {
        let files = &self.measuring.files;
        let own = self.recording.canonicalize().ok();
        let own = own.and_then(|folder| Some(folder.parent()?.parent()?.to_path_buf()));
        match own {
            Some(state) if files.state.is_none() && Reader::of(&state).path().exists() => Ok(state),
            _ => files.state_folder(),
        }
    }

    fn choose(&self, folder: &Path, store: &Store) -> Result<(Kept, Chosen)> {
        let (kept, recipe, from) = match &self.recipe {
            None => {
                let kept = Kept::open(folder)?;
                let (recipe, own) = kept.recipe(store)?;
                let from = match own {
                    true => "the recording's own recipe",
                    false => "the station's recipe: the recording has none of its own",
                };
                (kept, recipe, from.to_owned())
            }
            Some(named) if named == Path::new("stored") => {
                let kept = Kept::open(folder)?;
                let number = kept.reference().map_or(0, |recipe| recipe.number);
                let number = u16::try_from(number).unwrap_or(0);
                let loaded = store.load(number).map_err(|error| missing(&error))?;
                let from = "the station's recipe as it is now";
                (kept, loaded.recipe, from.into())
            }
            Some(path) => {
                let recipe = kept::read(path)?;
                let kept = Kept::judged_by(folder, &recipe)?;
                (kept, recipe, path.display().to_string())
            }
        };
        let original = kept.was_judged_by(&recipe);
        let chosen = Chosen {
            recipe,
            from,
            original,
        };
        Ok((kept, chosen))
    }
}

/// The result of a recording in the history: the one that names the recording, else the one with
/// the SEQ in the recording's name. It is ignored if its recipe or PART_ID is not the recording's:
/// the history may be another station's, or have begun again at SEQ 1.
fn result_of(state: &Path, name: Option<&str>, kept: &Kept) -> Result<Option<Entry>> {
    let reader = Reader::of(state);
    let Some(name) = name.filter(|_| reader.path().exists()) else {
        return Ok(None);
    };
    let mut found = reader.recorded_as(name)?;
    if let (None, Some(seq)) = (&found, seq_of(name)) {
        found = reader.result(seq)?;
    }
    let part = kept.part_id();
    let of_this_part = |entry: &Entry| {
        let judge = kept.reference();
        judge.is_some_and(|judge| judge.fingerprint.starts_with(&entry.fingerprint))
            && part.is_none_or(|part| part == entry.part_id.to_string())
    };
    Ok(found.filter(of_this_part))
}

fn entry(inspection: Inspection, recipe: u16, fingerprint: &str) -> Entry {
    Entry::of(&ResultRecord {
        recipe,
        recipe_crc: crate::recipe::short(fingerprint),
        verdict: inspection.verdict(),
        error_code: inspection.error_code,
        inspection: Arc::new(inspection),
        ..ResultRecord::default()
    })
}

/// An entry with the kind of each gauge, and the features.
fn detailed(entry: &Entry, demands: &Demands, features: Value) -> Result<Value> {
    let shown = serde_json::to_value(entry);
    let mut shown = shown.map_err(Exit::Software.because("write the result"))?;
    for (gauge, value) in entry.gauges.iter().enumerate() {
        shown["gauges"][gauge]["kind"] = demands.kind(value.slot).into();
    }
    shown["features"] = features;
    Ok(shown)
}

/// The verdict, the recipe, and a line for each gauge.
fn table(entry: &Entry, from: &str) -> String {
    let number = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:+.4}"));
    let recipe = format!("recipe {}, fingerprint {}", entry.recipe, entry.fingerprint);
    let mut lines = vec![
        format!("{}{}", entry.verdict.word(), because(entry)),
        format!("judged by {from}: {recipe}"),
    ];
    lines.extend(entry.gauges.iter().map(|gauge| {
        format!(
            "{:<20} {:>10} {:<3} σ {:>8}  U {:>8}  limits {} to {}{}",
            gauge.name,
            number(gauge.value),
            gauge.unit,
            number(gauge.sigma),
            number(gauge.uncertainty),
            number(gauge.low),
            number(gauge.high),
            place(gauge),
        )
    }));
    lines.join("\n")
}

/// Where the value is, in camera pixels.
fn place(gauge: &GaugeEntry) -> String {
    let at = |square: &Square| format!("  at column {}, row {}", square.column, square.row);
    gauge.square.as_ref().map(at).unwrap_or_default()
}

fn because(entry: &Entry) -> String {
    let reason = entry.reason.as_ref();
    reason
        .map(|reason| format!(": {reason}"))
        .unwrap_or_default()
}
