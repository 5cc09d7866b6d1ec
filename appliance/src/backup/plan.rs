//! What a backup that was checked would bring back, and what it would replace: for a person who
//! chooses.

use super::checking::CheckedBackup;
use super::{Backups, CALIBRATION, CONFIGURATION, RECIPES, RECORDINGS, RestorePart};
use crate::access::User;
use crate::head::calibration::Calibration;
use crate::head::calibration::place::CalibrationPlace;
use crate::history::Reader;
use crate::recipe::plan::Plan;
use crate::recipe::store::manifest_at;
use crate::recipe::{RecipeFile, Store};
use serde::Serialize;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// What a device has now.
pub struct Present<'a> {
    /// Its serial.
    pub serial: &'a str,
    /// Its configuration.
    pub configuration: &'a str,
    /// Its recipes.
    pub recipes: &'a Store,
    /// Its history.
    pub history: &'a Reader,
    /// Its users.
    pub users: &'a [User],
    /// The calibration that it measures with.
    pub calibration: Option<&'a Calibration>,
    /// The sizes of its camera and projector, where they are known.
    pub head: Option<[u32; 5]>,
    /// Whether the configuration names a calibration outside of the state folder.
    pub calibrated_elsewhere: bool,
}

/// What a restore would do.
#[derive(Clone, Debug, Serialize)]
pub struct RestorePlan {
    made_at_unix_s: u64,
    made_by: String,
    serial: String,
    same_device: bool,
    configuration_differs: bool,
    choices: [RestoreOption; 3],
    recipes: Vec<RecipeRow>,
    /// Recipes that the backup lacks.
    removed: Vec<RemovedRow>,
    calibration: Option<CalibrationRow>,
    history: Option<HistoryRow>,
    users: Option<Vec<UserRow>>,
    recordings: usize,
}

/// What may be chosen.
#[derive(Clone, Debug, Serialize)]
struct RestoreOption {
    what: RestorePart,
    /// Why it is refused.
    refused: Option<String>,
}

/// How what comes back compares with what is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Likeness {
    Same,
    Other,
    None,
}

#[derive(Clone, Debug, Serialize)]
struct RecipeRow {
    number: u16,
    name: String,
    fingerprint: String,
    present: Likeness,
    /// Why it cannot be used.
    problem: Option<String>,
}

#[derive(Clone, Debug, Serialize)]
struct RemovedRow {
    number: u16,
    name: String,
}

#[derive(Clone, Debug, Serialize)]
struct CalibrationRow {
    fingerprint: String,
    present: Likeness,
}

#[derive(Clone, Debug, Serialize)]
struct HistoryRow {
    results: u64,
    last: Option<u32>,
    present_results: u64,
    present_last: Option<u32>,
}

#[derive(Clone, Debug, Serialize)]
struct UserRow {
    name: String,
    role: crate::access::Role,
    present_role: Option<crate::access::Role>,
}

impl Backups {
    /// Plans a restore of what was checked; each recipe is planned on the head, which takes a core for
    /// seconds.
    pub fn plan(&self, checked: &CheckedBackup, present: &Present<'_>) -> RestorePlan {
        let staged = self.staged();
        let loaded = CalibrationPlace::at(&staged.join(CALIBRATION)).load();
        let file = loaded.ok().flatten().map(|loaded| loaded.file);
        let restored = file.and_then(|file| file.calibration().ok());
        let misfit = restored.as_ref().and_then(|found| misfit(found, present));
        let of_calibration = match (&restored, &misfit) {
            (None, _) => Some("the backup has no calibration".into()),
            (_, Some(words)) => Some(words.clone()),
            (Some(_), None) => present.calibrated_elsewhere.then(|| {
                "the configuration names another file, head.calibration: put it there by hand"
                    .into()
            }),
        };
        let used = restored.as_ref().filter(|_| misfit.is_none());
        let (recipes, of_recipes) = recipes(&staged, used, present);
        let numbers: BTreeSet<u16> = recipes.iter().map(|row| row.number).collect();
        let mut removed = present.recipes.numbers();
        removed.retain(|number| !numbers.contains(number));
        let refused = |what, refused| RestoreOption { what, refused };
        RestorePlan {
            made_at_unix_s: checked.manifest.made_at_unix_s,
            made_by: checked.manifest.made_by.clone(),
            serial: checked.manifest.serial.clone(),
            same_device: checked.manifest.serial == present.serial,
            configuration_differs: fs::read(staged.join(CONFIGURATION))
                .is_ok_and(|text| text != present.configuration.as_bytes()),
            choices: [
                refused(RestorePart::Everything, misfit),
                refused(RestorePart::Recipes, of_recipes),
                refused(RestorePart::Calibration, of_calibration),
            ],
            removed: removed
                .into_iter()
                .map(|number| RemovedRow {
                    number,
                    name: present
                        .recipes
                        .present(number)
                        .map_or_else(String::new, |file| file.name),
                })
                .collect(),
            calibration: restored.map(|restored| {
                let fingerprint = restored.fingerprint();
                let present = present.calibration.map(Calibration::fingerprint);
                CalibrationRow {
                    present: found(present.as_deref(), &fingerprint),
                    fingerprint,
                }
            }),
            history: checked.history.as_ref().map(|history| {
                let now = present.history.holding().ok();
                HistoryRow {
                    results: history.results,
                    last: history.last,
                    present_results: now.as_ref().map_or(0, |now| now.results),
                    present_last: now.and_then(|now| now.last),
                }
            }),
            users: checked.users.as_ref().map(|users| {
                let rows = users.iter().map(|user| UserRow {
                    name: user.name.clone(),
                    role: user.role,
                    present_role: present
                        .users
                        .iter()
                        .find(|now| now.name.to_lowercase() == user.name.to_lowercase())
                        .map(|now| now.role),
                });
                rows.collect()
            }),
            recipes,
            recordings: fs::read_dir(staged.join(RECORDINGS)).map_or(0, Iterator::count),
        }
    }
}

fn found(present: Option<&str>, fingerprint: &str) -> Likeness {
    match present {
        None => Likeness::None,
        Some(present) if present == fingerprint => Likeness::Same,
        Some(_) => Likeness::Other,
    }
}

/// Why a calibration is not of this head.
fn misfit(restored: &Calibration, present: &Present<'_>) -> Option<String> {
    let head = present.head.filter(|head| *head != restored.sizes())?;
    let describe = |[width, height, bits, columns, rows]: [u32; 5]| {
        format!(
            "a camera of {width}×{height} pixels of {bits} bit and a projector of {columns}×{rows}"
        )
    };
    Some(format!(
        "the backup's calibration is of another head: it is for {}, this is {}",
        describe(restored.sizes()),
        describe(head)
    ))
}

/// The recipes of a backup, and why they cannot come back without its calibration.
fn recipes(
    staged: &Path,
    restored: Option<&Calibration>,
    present: &Present<'_>,
) -> (Vec<RecipeRow>, Option<String>) {
    let store = Store::at(&staged.join(RECIPES));
    let restored_id = restored.map(Calibration::fingerprint);
    let present_id = present.calibration.map(Calibration::fingerprint);
    let mut strange = None;
    let rows = store.numbers().into_iter().map(|number| {
        let loaded = store.load_to_edit(number);
        let (file, problem) = match loaded {
            Err(error) => (store.present(number), Some(error.to_string())),
            Ok(loaded) => {
                let of = |id: &Option<String>| id.as_ref() == Some(&loaded.file.calibration);
                let planned_on = match of(&restored_id) {
                    true => restored,
                    false => present.calibration.or(restored),
                };
                if of(&restored_id) && !of(&present_id) {
                    strange.get_or_insert(number);
                }
                let planned =
                    planned_on.map(|calibration| Plan::try_out(loaded.recipe, calibration));
                let problem = planned.and_then(Result::err).map(|error| error.to_string());
                (Some(loaded.file), problem)
            }
        };
        let file: Option<RecipeFile> = file;
        let fingerprint = file
            .as_ref()
            .map_or_else(String::new, |file| file.fingerprint.clone());
        let now = manifest_at(&present.recipes.path(number)).map(|file| file.fingerprint);
        RecipeRow {
            number,
            name: file.map_or_else(String::new, |file| file.name),
            present: found(now.as_deref(), &fingerprint),
            fingerprint,
            problem,
        }
    });
    let rows = rows.collect();
    let refused = strange.map(|number| {
        format!("recipe {number} was made for the backup's calibration, which this device does not have: restore everything")
    });
    (rows, refused)
}
