//! What a backup that was checked would bring back, and what it would replace: JSON for the page, where
//! a person chooses.

use super::checking::CheckedBackup;
use super::{Backups, CALIBRATION, CONFIGURATION, RECIPES, RECORDINGS, RestorePart};
use crate::access::User;
use crate::access::users::is_same;
use crate::head::calibration::Calibration;
use crate::head::calibration::place::CalibrationPlace;
use crate::history::Reader;
use crate::recipe::Store;
use crate::recipe::plan::Plan;
use serde_json::{Value, json};
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

impl Backups {
    /// Plans a restore of what was checked; each recipe is planned on the head, which takes a core for
    /// seconds.
    pub fn plan(&self, checked: &CheckedBackup, present: &Present<'_>) -> Value {
        let staged = self.staged();
        let loaded = CalibrationPlace::at(&staged.join(CALIBRATION)).load();
        let file = loaded.ok().flatten().map(|loaded| loaded.file);
        let restored = file.and_then(|file| file.calibration().ok());
        let misfit = restored
            .as_ref()
            .and_then(|restored| misfit(restored, present));
        let elsewhere =
            "the configuration names another file, head.calibration: put it there by hand";
        let of_calibration = match (&restored, &misfit) {
            (None, _) => Some("the backup has no calibration"),
            (_, Some(words)) => Some(&**words),
            (Some(_), None) => present.calibrated_elsewhere.then_some(elsewhere),
        };
        let used = restored.as_ref().filter(|_| misfit.is_none());
        let (recipes, of_recipes) = recipes(&staged, used, present);
        let stored = Store::at(&staged.join(RECIPES)).numbers();
        let gone = present.recipes.numbers().into_iter();
        let gone = gone
            .filter(|number| !stored.contains(number))
            .map(|number| {
                let name = present.recipes.present(number).map(|file| file.name);
                json!({ "number": number, "name": name.unwrap_or_default() })
            });
        let present_id = present.calibration.map(Calibration::fingerprint);
        let calibration = restored.as_ref().map(Calibration::fingerprint);
        let calibration = calibration.map(
            |id| json!({ "fingerprint": id, "present": compared(present_id.as_deref(), &id) }),
        );
        let history = checked.history.as_ref().map(|history| {
            let now = present.history.holding().ok();
            json!({
                "results": history.results, "last": history.last,
                "present_results": now.as_ref().map_or(0, |now| now.results),
                "present_last": now.and_then(|now| now.last),
            })
        });
        let users = checked.users.as_ref().map(|users| {
            let rows = users.iter().map(|user| {
                let known = present.users.iter().find(|now| is_same(&now.name, &user.name));
                json!({ "name": user.name, "role": user.role, "present_role": known.map(|now| now.role) })
            });
            rows.collect::<Value>()
        });
        let configuration = fs::read(staged.join(CONFIGURATION));
        let manifest = &checked.manifest;
        json!({
            "made_at_unix_s": manifest.made_at_unix_s, "made_by": manifest.made_by,
            "serial": manifest.serial, "same_device": manifest.serial == present.serial,
            "configuration_differs": configuration.is_ok_and(|text| text != present.configuration.as_bytes()),
            "choices": [
                { "what": RestorePart::Everything, "refused": misfit },
                { "what": RestorePart::Recipes, "refused": of_recipes },
                { "what": RestorePart::Calibration, "refused": of_calibration },
            ],
            "recipes": recipes, "removed": gone.collect::<Value>(), "calibration": calibration,
            "history": history, "users": users,
            "recordings": fs::read_dir(staged.join(RECORDINGS)).map_or(0, Iterator::count),
        })
    }
}

/// How what comes back compares with what is there.
fn compared(present: Option<&str>, fingerprint: &str) -> &'static str {
    match present {
        None => "none",
        Some(present) if present == fingerprint => "same",
        Some(_) => "other",
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
) -> (Value, Option<String>) {
    let store = Store::at(&staged.join(RECIPES));
    let [restored_id, present_id] =
        [restored, present.calibration].map(|known| known.map(Calibration::fingerprint));
    let mut refused = None;
    let rows = store.numbers().into_iter().map(|number| {
        let (file, problem) = match store.load_to_edit(number) {
            Err(error) => (store.present(number), Some(error.to_string())),
            Ok(loaded) => {
                let is_of = |id: &Option<String>| id.as_ref() == Some(&loaded.file.calibration);
                let (comes, is_here) = (is_of(&restored_id), is_of(&present_id));
                if comes && !is_here {
                    refused.get_or_insert_with(|| format!(
                        "recipe {number} was made for the backup's calibration, which this device does not have: restore everything"
                    ));
                }
                let head = restored.filter(|_| comes).or(present.calibration).or(restored);
                let planned = head.map(|head| Plan::try_out(loaded.recipe, head));
                let problem = planned.and_then(Result::err);
                (Some(loaded.file), problem.map(|error| error.to_string()))
            }
        };
        let (name, fingerprint) = file.map_or_else(Default::default, |file| (file.name, file.fingerprint));
        let now = present.recipes.manifest(number).ok().map(|file| file.fingerprint);
        json!({
            "number": number, "name": name, "fingerprint": fingerprint, "problem": problem,
            "present": compared(now.as_deref(), &fingerprint),
        })
    });
    (rows.collect(), refused)
}
