//! The crates on which the workspace depends, with the features for a real head, as cargo resolves
//! them for each platform.

use serde_json::Value;
use std::collections::{HashMap, HashSet};
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::Command;
use tests::shared::root;

/// The processors that the program is built for.
const PLATFORMS: [&str; 2] = ["x86_64-unknown-linux-gnu", "aarch64-unknown-linux-gnu"];

/// A crate from outside the workspace.
pub struct Crate {
    pub name: String,
    pub version: String,
    /// The licence in its manifest.
    pub licence: Option<String>,
    pub authors: Vec<String>,
    /// Its folder on this machine.
    pub folder: PathBuf,
    /// Whether its code is in `fringed`, `fringed-fleet` or `fringed-lab`; the others are only for
    /// building and testing.
    pub shipped: bool,
}

impl fmt::Display for Crate {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{} {}", self.name, self.version)
    }
}

/// All crates, sorted by name; an error if cargo cannot list them.
pub fn all() -> Result<Vec<Crate>, String> {
    let platforms = PLATFORMS.map(|name| ["--filter-platform", name]).concat();
    let output = Command::new(env!("CARGO"))
        .current_dir(root())
        .args(["metadata", "--format-version", "1", "--offline", "--locked"])
        .args(["--features", "appliance/rpi"])
        .args(platforms)
        .output()
        .map_err(|error| error.to_string())?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned());
    }
    let metadata: Value = serde_json::from_slice(&output.stdout).map_err(|e| e.to_string())?;
    let shipped = shipped(&metadata);
    let mut crates: Vec<Crate> = list(&metadata["packages"])
        .filter(|package| !package["source"].is_null())
        .map(|package| Crate {
            name: text(&package["name"]),
            version: text(&package["version"]),
            licence: package["license"].as_str().map(str::to_owned),
            authors: list(&package["authors"]).map(text).collect(),
            folder: Path::new(&text(&package["manifest_path"]))
                .parent()
                .unwrap()
                .to_path_buf(),
            shipped: shipped.contains(&text(&package["id"])),
        })
        .collect();
    crates.sort_by(|a, b| (&a.name, &a.version).cmp(&(&b.name, &b.version)));
    Ok(crates)
}

/// The crates in the programs: those that they reach by normal dependencies, not through build
/// scripts, procedural macros or tests.
fn shipped(metadata: &Value) -> HashSet<String> {
    let is_proc_macro = |package: &Value| {
        let kinds = list(&package["targets"]).flat_map(|target| list(&target["kind"]));
        kinds.into_iter().any(|kind| kind == "proc-macro")
    };
    let proc_macros: HashSet<String> = list(&metadata["packages"])
        .filter(|package| is_proc_macro(package))
        .map(|package| text(&package["id"]))
        .collect();
    let nodes: HashMap<String, &Value> = list(&metadata["resolve"]["nodes"])
        .map(|node| (text(&node["id"]), node))
        .collect();
    let program = |package: &&Value| {
        ["appliance", "fringed-lab"]
            .map(Value::from)
            .contains(&package["name"])
    };
    let mut open: Vec<String> = list(&metadata["packages"])
        .filter(program)
        .map(|package| text(&package["id"]))
        .collect();
    let mut reached = HashSet::new();
    while let Some(id) = open.pop() {
        if proc_macros.contains(&id) || !reached.insert(id.clone()) {
            continue;
        }
        let linked = |dep: &&Value| list(&dep["dep_kinds"]).any(|kind| kind["kind"].is_null());
        let needed = list(&nodes[&id]["deps"]).filter(linked);
        open.extend(needed.map(|dep| text(&dep["pkg"])));
    }
    reached
}

fn list(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

fn text(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_owned()
}
