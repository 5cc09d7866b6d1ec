//! Targets for recipes: imported files, and changes from the page.

use super::bounded;
use super::part::PART;
use appliance::recipe::edit::{self, Edit};
use appliance::recipe::file::archive;
use appliance::recipe::file::gauges_toml::Gauging;
use appliance::recipe::plan::Plan;
use appliance::recipe::{Recipe, RecipeFile, Store};
use std::fs;
use std::io::Cursor;
use tempfile::TempDir;

/// A recipe file: an accepted one can be packed and read again.
pub fn zip(data: &[u8]) {
    bounded(16 * data.len() + (16 << 20), || {
        let _ = archive::manifest(Cursor::new(data));
        let _ = archive::is_sound(Cursor::new(data));
        if Recipe::from_bytes(data).is_ok() {
            let unpack = |bytes: &[u8]| archive::unpack(Cursor::new(bytes), bytes.len() as u64);
            let (file, arrays) = unpack(data).expect("what was read can be unpacked");
            let (bytes, _) = archive::pack(&file, &arrays).expect("packed");
            let again = Recipe::from_bytes(&bytes).expect("and read again");
            assert_eq!(again.gauges.len(), file.gauges.len());
            assert!(archive::is_sound(Cursor::new(&bytes[..])));
        }
    });
}

/// A manifest, with the arrays of a taught part: it is checked, packed and planned, and the part
/// judged by it.
pub fn json(data: &[u8]) {
    let part = &*PART;
    let Ok(mut file) = serde_json::from_slice::<RecipeFile>(data) else {
        return;
    };
    // Anyone can fill these in correctly.
    file.format.clone_from(&part.file.format);
    file.version = part.file.version;
    file.fingerprint.clone_from(&part.file.fingerprint);
    file.calibration.clone_from(&part.file.calibration);
    let Ok(recipe) = Recipe::check(&file, part.recipe.arrays.clone()) else {
        return;
    };
    let (bytes, _) = archive::pack(&file, &recipe.arrays).expect("packed");
    let recipe = Recipe::from_bytes(&bytes).expect("and read again");
    if let Ok(plan) = Plan::new(recipe, &part.calibration, true) {
        plan.rasters(&part.calibration).expect("rasters");
        part.judge(&plan);
    }
}

/// Features, datum systems and gauges as text, for the recipe of a taught part: what is read is
/// written as the same, and what fits can be planned, and the part judged by it.
pub fn gauges_toml(data: &[u8]) {
    let Ok(text) = str::from_utf8(data) else {
        return;
    };
    let read = bounded(64 * data.len() + (1 << 20), || Gauging::from_toml(text));
    let Ok(gauging) = read else { return };
    let again = Gauging::from_toml(&gauging.to_toml()).expect("what was written can be read");
    assert_eq!(again.to_toml(), gauging.to_toml());
    let part = &*PART;
    if let Ok(taught) = gauging.set(&part.file, part.recipe.arrays.clone())
        && let Ok(plan) = Plan::new(taught.recipe, &part.calibration, true)
    {
        part.judge(&plan);
    }
}

/// A store with the taught recipe, in a folder of its own.
struct Stored {
    folder: TempDir,
    store: Store,
}

thread_local! {
    static STORED: Stored = {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open(folder.path()).expect("a store");
        Stored { folder, store }
    };
}

/// A change from the page: after an accepted one the recipe can be loaded and planned, and the part
/// judged by it.
pub fn edit(data: &[u8]) {
    let part = &*PART;
    let Ok(mut wanted) = serde_json::from_slice::<Edit>(data) else {
        return;
    };
    wanted.fingerprint.clone_from(&part.file.fingerprint);
    STORED.with(|stored| {
        // Written directly and not through the store, which would spend most of the time in syncs.
        fs::write(stored.folder.path().join("0001.recipe"), &part.bytes).expect("put back");
        let fits = |recipe| Ok(Plan::try_out(recipe, &part.calibration)?);
        if edit::edit(&stored.store, 1, wanted, fits).is_ok() {
            let loaded = stored.store.load(1).expect("what was taken can be loaded");
            assert_eq!(loaded.fallback, None);
            let plan = Plan::new(loaded.recipe, &part.calibration, true).expect("and planned");
            part.judge(&plan);
        }
    });
}
