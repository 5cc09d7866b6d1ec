//! Generations of a recipe: keeping the previous one, deleting, and undoing both.
//!
//! Beside `NNNN.recipe` lies `NNNN.recipe.previous`, its previous generation. `NNNN.recipe.kept` is
//! a deleted recipe or, while two generations are being exchanged, a second link to the newest one.
//! A kill between any two renames loses no generation.

use super::{is_sound, manifest_at, write};
use crate::recipe::{ChangeError, LoadError, RecipeFile, Refusal, Store};
use crate::station::control::MAX_RECIPE;
use crate::storage::folder::{name_also, remove, rename_whole, sync_folder_of};
use std::io;
use std::path::{Path, PathBuf};

impl Store {
    pub(crate) fn previous(&self, number: u16) -> PathBuf {
        self.folder.join(format!("{number:04}.recipe.previous"))
    }

    pub(crate) fn kept(&self, number: u16) -> PathBuf {
        self.folder.join(format!("{number:04}.recipe.kept"))
    }

    /// Makes the current generation the previous one, unless it is damaged: a damaged file must not
    /// replace a sound previous generation.
    pub(crate) fn keep_previous(&self, number: u16) -> io::Result<()> {
        let (path, previous) = (self.path(number), self.previous(number));
        if !is_sound(&path) {
            return Ok(());
        }
        // A second link: the current generation keeps its name until it is replaced.
        name_also(&path, &previous)?;
        // A recipe that was deleted before the current one was stored would be two generations back
        // now.
        remove(&self.kept(number)).map(drop)
    }

    /// The file that [`Store::undo`] restores.
    fn before(&self, number: u16) -> Option<PathBuf> {
        let files = [self.previous(number), self.kept(number)];
        files.into_iter().find(|file| file.exists())
    }

    /// The manifest of what [`Store::undo`] restores: the previous generation, or the deleted
    /// recipe.
    pub fn manifest_before(&self, number: u16) -> Option<RecipeFile> {
        manifest_at(&self.before(number)?)
    }

    /// The manifest of the newest generation that can be read; `None` if there is none.
    pub fn present(&self, number: u16) -> Option<RecipeFile> {
        let files = [self.path(number), self.previous(number)];
        files.iter().find_map(|file| manifest_at(file))
    }

    /// The numbers under which there is only a deleted recipe, in order.
    pub fn deleted(&self) -> Vec<u16> {
        let stored = self.numbers();
        let mut kept = self.numbers_with(&[".kept"]);
        kept.retain(|number| stored.binary_search(number).is_err());
        kept
    }

    /// The lowest number without a stored or deleted recipe; `None` if all 9999 are taken.
    pub fn free(&self) -> Option<u16> {
        let taken = self.numbers_with(&["", ".previous", ".kept"]);
        (1..=MAX_RECIPE).find(|number| taken.binary_search(number).is_err())
    }

    /// Exchanges the newest and the previous generation, or restores a deleted recipe. A second
    /// undo reverses the first. `calibration` is the fingerprint of the head's, where it is known:
    /// a generation that was made for another one does not take the place of one that this head can
    /// use. Returns the manifest of what is now the newest generation.
    ///
    /// # Errors
    /// If there is nothing to restore, it is damaged, was made for another calibration than the
    /// head's, or has the part number of another recipe, or the files cannot be renamed.
    pub fn undo(&self, number: u16, calibration: Option<&str>) -> Result<RecipeFile, ChangeError> {
        let _alone = self.lock().map_err(write(&self.folder))?;
        let before = self.before(number).ok_or(ChangeError::Nothing(number))?;
        let unfit = |reason: Refusal| {
            let words = format!("undo recipe {number}: its previous generation {reason}");
            Refusal::from(words)
        };
        let restored = read(&before, number).map_err(unfit)?;
        let (path, previous, kept) = (self.path(number), self.previous(number), self.kept(number));
        let is_of_head =
            |file: &RecipeFile| calibration.is_none_or(|head| file.calibration == head);
        if !is_of_head(&restored) && manifest_at(&path).is_some_and(|newest| is_of_head(&newest)) {
            let reason = "was made for another head or calibration: teach it again";
            return Err(unfit(reason.into()).into());
        }
        let shared = self.refuse_shared(number, &restored.part_number);
        shared.map_err(|words| Refusal::from(format!("undo recipe {number}: {words}")))?;
        let rename = |from: &Path, to: &Path| rename_whole(from, to).map_err(write(to));
        if !path.exists() {
            rename(&before, &path)?;
            return Ok(restored);
        }
        if before == kept {
            rename(&kept, &previous)?;
        }
        name_also(&path, &kept).map_err(write(&kept))?;
        rename(&previous, &path)?;
        rename(&kept, &previous)?;
        Ok(restored)
    }

    /// Deletes a recipe. Its newest sound generation is kept, for [`Store::undo`], until another
    /// recipe with this number is replaced or deleted. The caller makes sure that no station has
    /// the recipe active.
    ///
    /// # Errors
    /// If there is no such recipe or its files cannot be renamed or removed.
    pub fn delete(&self, number: u16) -> Result<(), ChangeError> {
        let _alone = self.lock().map_err(write(&self.folder))?;
        let (path, previous, kept) = (self.path(number), self.previous(number), self.kept(number));
        let whole = self.whole(number);
        if let Err(error @ LoadError::Unknown(_)) = whole {
            return Err(error.into());
        }
        let removed = |file: &Path| remove(file).map_err(write(file));
        // In this order a kill in between never leaves an old generation as the newest.
        match whole {
            Ok(whole) if whole == path => {
                removed(&previous)?;
                rename_whole(&path, &kept).map_err(write(&kept))?;
            }
            Ok(_) => {
                rename_whole(&previous, &kept).map_err(write(&kept))?;
                removed(&path)?;
            }
            Err(_) => {
                removed(&previous)?;
                removed(&path)?;
            }
        }
        sync_folder_of(&path).map_err(write(&path))
    }
}

/// The manifest of a recipe file that can be used under this number.
///
/// # Errors
/// In words: why it cannot be used.
fn read(path: &Path, number: u16) -> Result<RecipeFile, Refusal> {
    let read = Store::read(path, number).ok_or("is gone: teach the recipe again")?;
    read.and_then(|(file, _)| file.check_judging().map(|()| file))
        .map_err(|reason| format!("cannot be used: {reason}").into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recipe::Recipe;
    use crate::recipe::file::archive::{self, Arrays};
    use crate::recipe::file::{FORMAT, VERSION};
    use serde_json::json;
    use std::fs;
    use std::io::Cursor;

    /// A small whole recipe.
    fn packed(number: u16, name: &str, calibration: &str) -> Vec<u8> {
        let device = json!({
            "fx": 10.0, "fy": 10.0, "cx": 1.5, "cy": 1.5, "distortion": [0.0, 0.0, 0.0, 0.0, 0.0],
            "rotation": [1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0], "translation_mm": [0.0, 0.0, 600.0],
        });
        let file = json!({
            "format": FORMAT, "version": VERSION, "fingerprint": "", "number": number, "part_number": "", "name": name,
            "taught_by": "a test", "taught_at_unix_s": 0, "calibration": calibration,
            "camera": { "width": 4, "height": 4, "bit_depth": 8 }, "projector": { "width": 8, "height": 8 },
            "pattern": { "kind": "vertical", "fringes": 2.0 },
            "sequences": [{ "kind": "full", "frames": [[1.0, 0.0], [1.0, 0.25], [1.0, 0.5], [1.0, 0.75]], "sigma_mm": 0.01, "safe_share": 1.0 }],
            "production": 0, "two_frames": false, "placement_tolerance_mm": 1.0, "alignment": "none", "range_mm": [0.0, 1.0],
            "exposures": 1, "noise_counts": 1.0, "read_noise_counts": 1.0, "shot_noise": 0.0, "golden_captures": 1,
            "models": { "camera": device, "projector": device },
            "least_modulation": 16.0, "expansion_range_turns": 0.5, "min_coverage": 0.8, "guard_k": 0.0,
            "judges_nothing": false, "tried": [],
            "features": [{ "name": "frame", "kind": "surface", "region": [[-0.5, -0.5], [3.5, -0.5], [3.5, 3.5], [-0.5, 3.5]] }],
            "datums": [],
            "gauges": [{ "slot": 1, "name": "coverage", "kind": "coverage", "of": ["frame"], "low": 0.5 }],
        });
        let arrays = Arrays {
            golden_phase: vec![0.0; 16].into(),
            golden_height: vec![0.0; 16].into(),
            height_slope: vec![1.0; 16].into(),
            height_curvature: vec![0.0; 16].into(),
            valid: vec![1; 16].into(),
            modulation: vec![50.0; 16].into(),
            phase_reach: vec![0.1; 16].into(),
            ..Arrays::default()
        };
        archive::pack(&serde_json::from_value(file).unwrap(), &arrays)
            .unwrap()
            .0
    }

    struct Place {
        store: Store,
        folder: tempfile::TempDir,
    }

    impl Place {
        fn with(names: &[&str]) -> Self {
            let folder = tempfile::tempdir().unwrap();
            let store = Store::open(folder.path()).unwrap();
            for name in names {
                store.save(7, &packed(7, name, "c")).unwrap();
            }
            Self { store, folder }
        }

        fn newest(&self) -> String {
            self.store.load(7).unwrap().file.name
        }

        fn before(&self) -> Option<String> {
            Some(self.store.manifest_before(7)?.name)
        }

        fn file(&self, ending: &str) -> PathBuf {
            self.folder.path().join(format!("0007.recipe{ending}"))
        }
    }

    #[test]
    fn undo_exchanges_the_two_generations_and_undo_again_takes_it_back() {
        let place = Place::with(&["first", "second"]);
        for (newest, before) in [("first", "second"), ("second", "first")] {
            assert_eq!(place.store.undo(7, None).unwrap().name, newest);
            assert_eq!(
                (place.newest(), place.before()),
                (newest.into(), Some(before.into()))
            );
        }
        assert_eq!(fs::read_dir(place.folder.path()).unwrap().count(), 3);
    }

    #[test]
    fn a_kill_between_any_two_steps_of_an_undo_loses_no_generation() {
        type Step = fn(&Place);
        let steps: [Step; 2] = [
            |place| name_also(&place.file(""), &place.file(".kept")).unwrap(),
            |place| fs::rename(place.file(".previous"), place.file("")).unwrap(),
        ];
        for done in 1..=steps.len() {
            let place = Place::with(&["first", "second"]);
            steps[..done].iter().for_each(|step| step(&place));
            let undone = done == 2;
            assert_eq!(place.newest() == "first", undone);
            // The next undo finds the other one, and so does the one after it.
            place.store.undo(7, None).unwrap();
            assert_eq!(place.newest() == "first", !undone);
            place.store.undo(7, None).unwrap();
            assert_eq!(place.newest() == "first", undone);
        }
    }

    #[test]
    fn a_deleted_recipe_loads_no_more_and_comes_back_whole() {
        let place = Place::with(&["first", "second"]);
        place.store.delete(7).unwrap();
        let gone = place.store.load(7).unwrap_err();
        assert_eq!(gone, LoadError::Unknown("7".into()));
        assert!(place.store.numbers().is_empty());
        assert_eq!(place.store.deleted(), [7]);
        assert_eq!(place.before().unwrap(), "second");
        assert!(matches!(
            place.store.delete(7),
            Err(ChangeError::Load(LoadError::Unknown(_)))
        ));
        assert_eq!(place.store.undo(7, None).unwrap().name, "second");
        assert_eq!(place.newest(), "second");
        assert_eq!(place.store.deleted(), [0; 0]);
    }

    #[test]
    fn a_deleted_recipe_is_the_generation_before_what_takes_its_number() {
        let place = Place::with(&["first"]);
        place.store.delete(7).unwrap();
        place.store.save(7, &packed(7, "second", "c")).unwrap();
        assert_eq!(place.before().unwrap(), "first");
        place.store.undo(7, None).unwrap();
        assert_eq!(
            (place.newest(), place.before()),
            ("first".into(), Some("second".into()))
        );
        place.store.save(7, &packed(7, "third", "c")).unwrap();
        assert_eq!(place.before().unwrap(), "first");
        assert!(!place.file(".kept").exists());
    }

    #[test]
    fn a_damaged_newest_generation_is_undone_and_does_not_come_back() {
        let place = Place::with(&["first", "second"]);
        fs::write(place.file(""), "torn").unwrap();
        assert_eq!(place.store.undo(7, None).unwrap().name, "first");
        let refused = place.store.undo(7, None).unwrap_err();
        assert!(refused.to_string().contains("cannot be used"), "{refused}");
        assert_eq!(place.newest(), "first");
        // A deletion keeps the generation that is whole.
        fs::rename(place.file(""), place.file(".whole")).unwrap();
        fs::rename(place.file(".previous"), place.file("")).unwrap();
        fs::rename(place.file(".whole"), place.file(".previous")).unwrap();
        place.store.delete(7).unwrap();
        assert_eq!(place.store.undo(7, None).unwrap().name, "first");
    }

    #[test]
    fn without_a_generation_before_nothing_is_undone() {
        let place = Place::with(&["first"]);
        let refused = place.store.undo(7, None).unwrap_err();
        assert!(matches!(refused, ChangeError::Nothing(7)), "{refused}");
        assert_eq!(place.newest(), "first");
    }

    #[test]
    fn what_this_head_can_use_is_brought_back_over_a_recipe_of_another_head_and_stays_there() {
        let place = Place::with(&["own"]);
        let foreign = packed(7, "foreign", "another");
        place.store.save(7, &foreign).unwrap();
        assert_eq!(place.store.undo(7, Some("c")).unwrap().name, "own");
        let refused = place.store.undo(7, Some("c")).unwrap_err();
        assert!(refused.to_string().contains("another head"), "{refused}");
        assert_eq!(place.newest(), "own");
        // Without a head it is not known which of them can be used.
        assert_eq!(place.store.undo(7, None).unwrap().name, "foreign");
    }

    #[test]
    fn a_deleted_recipe_does_not_come_back_with_the_part_number_of_another_one() {
        let place = Place::with(&[]);
        let named = |number| {
            let (mut file, recipe) =
                Recipe::read_to_edit(Cursor::new(packed(number, "x", "c")), u64::MAX).unwrap();
            file.part_number = "A-1".into();
            archive::pack(&file, &recipe.arrays).unwrap().0
        };
        place.store.save(7, &named(7)).unwrap();
        place.store.delete(7).unwrap();
        place.store.save(8, &named(8)).unwrap();
        let refused = place.store.undo(7, None).unwrap_err().to_string();
        assert!(
            refused.contains("recipe 8 has the part number"),
            "{refused}"
        );
        place.store.delete(8).unwrap();
        assert_eq!(place.store.undo(7, None).unwrap().part_number, "A-1");
    }

    #[test]
    fn the_first_number_without_a_recipe_of_any_kind_is_free() {
        let place = Place::with(&["seven"]);
        assert_eq!(place.store.free(), Some(1));
        for number in [1, 2, 4] {
            let bytes = packed(number, "x", "c");
            place.store.save(number, &bytes).unwrap();
        }
        assert_eq!(place.store.free(), Some(3));
        place.store.delete(2).unwrap();
        assert_eq!(place.store.free(), Some(3));
        fs::write(place.folder.path().join("0003.recipe"), "damaged").unwrap();
        assert_eq!(place.store.free(), Some(5));
    }

    #[test]
    fn a_recipe_of_another_version_is_refused_with_the_remedy_and_stays_as_it_is() {
        let place = Place::with(&["first"]);
        let (mut file, recipe) =
            Recipe::read_to_edit(Cursor::new(packed(7, "first", "c")), u64::MAX).unwrap();
        for version in [1, 2, VERSION + 1] {
            file.version = version;
            let (bytes, _) = archive::pack(&file, &recipe.arrays).unwrap();
            let expected =
                format!("version is {version}, this program reads 3: teach the part again");
            let words = Recipe::from_bytes(&bytes).unwrap_err();
            assert!(words.words.contains(&expected), "{words}");
            fs::write(place.file(""), &bytes).unwrap();
            let error = place.store.load(7).unwrap_err();
            assert!(matches!(error, LoadError::Unfit { .. }), "{error}");
            assert!(error.to_string().contains(&expected), "{error}");
            assert_eq!(fs::read(place.file("")).unwrap(), bytes);
        }
    }
}
