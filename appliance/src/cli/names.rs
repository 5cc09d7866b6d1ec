//! Names of outputs: a name whose ending contradicts the content is refused.

use clap::builder::{PathBufValueParser, TypedValueParser};
use std::path::{Path, PathBuf};

/// Endings of the files that this program writes.
const ENDINGS: [&str; 9] = [
    "csv", "json", "npy", "pdf", "ply", "png", "recipe", "svg", "zip",
];

/// A file whose name must have the ending of its content, for example `npy`.
pub fn file(ending: &'static str) -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(move |path| match ends_in(&path, ending) {
        true => Ok(path),
        false => Err(format!("name a file that ends in .{ending}")),
    })
}

/// A folder, whose name must not have the ending of a file.
pub fn folder() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| {
        let file = ENDINGS.into_iter().find(|ending| ends_in(&path, ending));
        match file {
            None => Ok(path),
            Some(ending) => Err(format!(
                "a folder is made under this name: name one that does not end in .{ending}"
            )),
        }
    })
}

fn ends_in(path: &Path, ending: &str) -> bool {
    path.extension()
        .is_some_and(|found| found.eq_ignore_ascii_case(ending))
}
