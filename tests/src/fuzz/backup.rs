//! The target for backups: a ZIP from elsewhere, and members of one that is right in all else.

use super::bounded;
use super::part::PART;
use crate::archives::{Entry, zip};
use crate::files::sha256;
use appliance::backup::checking::check;
use serde_json::json;
use std::fs::{self, File};

/// Members of a good backup, of which the first byte of an input selects one.
const MEMBERS: [&str; 8] = [
    "access/users.json",
    "access/changes.jsonl",
    "calibration/calibration.json",
    "commissioning.json",
    "drift.json",
    "history.db",
    "studies/1.json",
    "result-seq",
];

/// A backup that is checked: whatever it is, nothing is written beside its folder, and memory is
/// bounded by its size.
pub fn archive(data: &[u8]) {
    let Some((&first, rest)) = data.split_first() else {
        return;
    };
    let bytes = match MEMBERS.get(usize::from(first)) {
        Some(name) => with_member(name, rest),
        None => rest.to_vec(),
    };
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("backup.zip");
    fs::write(&file, &bytes).expect("written");
    let into = folder.path().join("into");
    let checked = bounded(16 * bytes.len() + (64 << 20), || {
        check(File::open(&file).expect("opened"), &into)
    });
    if let Ok(checked) = checked {
        let all = checked.manifest.members.iter();
        assert!(all.clone().all(|member| into.join(&member.name).is_file()));
    }
    let beside = fs::read_dir(folder.path()).expect("the folder").count();
    assert!(beside <= 2, "{beside} files beside the archive");
}

/// A backup with one member, and a recipe, whose manifest is right.
fn with_member(name: &str, content: &[u8]) -> Vec<u8> {
    let members = [(name, content), ("recipes/0001.recipe", &*PART.bytes)];
    let listed = members.map(|(name, content)| {
        json!({ "name": name, "bytes": content.len(), "sha256": sha256(content) })
    });
    let manifest = json!({
        "format": "fringed-backup", "version": 1, "versions": {}, "made_by": "a test",
        "made_at_unix_s": 0, "serial": "AB12CD34", "members": listed,
    });
    let mut entries: Vec<Entry> = members
        .iter()
        .map(|(name, content)| Entry::new(name, *content))
        .collect();
    entries.push(Entry::new("manifest.json", manifest.to_string()));
    zip(&entries)
}
