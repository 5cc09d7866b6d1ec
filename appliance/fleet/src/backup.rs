//! `fringed-fleet backup`: recipes, calibration and configuration of each head, as files.
//!
//! A recipe that many heads have is one file, named by its fingerprint: `recipes/FINGERPRINT.recipe`.
//! Calibrations and configurations are named by the SHA-256 of their text. `heads/SERIAL.json` says
//! which of them a head has. What is there already is neither fetched nor written again. A head does
//! not send the phase maps of a measured plate: copy `calibration/` of its state folder.

use crate::config::Fleet;
use crate::error::{Exit, Result};
use crate::http::Client;
use crate::log::{self, Severity};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};
use std::fs;
use std::io::{Cursor, Read as _, Write as _};
use std::path::{Path, PathBuf};
use tokio::task::JoinSet;
use zip::ZipArchive;
use zip::result::ZipError;

/// The most bytes of a recipe's file, as of one that a head takes.
const MOST_RECIPE: usize = 256 << 20;
/// The most bytes of other answers.
const MOST_ANSWER: usize = 32 << 20;
/// Heads that are asked at a time.
const AT_A_TIME: usize = 8;

/// Write recipes, calibration and configuration of each head as files.
#[derive(Debug, clap::Args)]
pub struct Backup {
    /// Folder of the files; made if it does not exist.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    #[command(flatten)]
    fleet: Fleet,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// The keys of a recipe in `GET /api/recipes` that are read.
#[derive(Deserialize, Serialize)]
struct Recipe {
    number: u16,
    name: String,
    fingerprint: String,
}

impl Backup {
    /// Asks every head.
    ///
    /// # Errors
    /// If the folder cannot be written; if a head could not be asked, after the others were.
    pub async fn run(&self) -> Result<()> {
        let config = self.fleet.read()?;
        let count = config.heads()?.len();
        for part in ["recipes", "calibrations", "configurations", "heads"] {
            let folder = self.folder.join(part);
            let failed = Exit::CannotCreate.because(format!("create {}", folder.display()));
            fs::create_dir_all(&folder).map_err(failed)?;
        }
        let (mut written, mut failed) = (0, 0);
        let mut asking = JoinSet::new();
        let mut heads = config.heads.into_iter();
        loop {
            while asking.len() < AT_A_TIME
                && let Some(head) = heads.next()
            {
                let client = Client::new(head.url, config.tls.clone());
                asking.spawn(one(self.folder.clone(), client));
            }
            match asking.join_next().await {
                None => break,
                Some(Ok(Ok(count))) => written += count,
                Some(Ok(Err(failure))) if failure.exit == Exit::CannotCreate => {
                    return Err(failure);
                }
                Some(Ok(Err(failure))) => {
                    log::write(Severity::Warning, failure);
                    failed += 1;
                }
                Some(Err(error)) => return Exit::Software.fail(error),
            }
        }
        match self.json {
            true => say!(
                "{}",
                json!({ "heads": count, "failed": failed, "files_written": written })
            ),
            false => say!("{count} heads, {failed} of them not asked, {written} files written"),
        }
        match failed {
            0 => Ok(()),
            _ => Exit::Unavailable.fail(format!("{failed} heads could not be asked: see above")),
        }
    }
}

/// Files that were written of one head.
async fn one(folder: PathBuf, mut client: Client) -> Result<usize> {
    let url = client.url().to_string();
    let wrong = |what: String| Exit::Content.fail(format!("{url}: {what} is no name of a file"));
    let snapshot: Value = asked(&mut client, "/api/snapshot").await?;
    let serial = snapshot["identity"]["serial"].as_str().unwrap_or_default();
    if !is_name(serial) {
        return wrong(format!("the serial {serial:?}"));
    }
    let mut known: Value = asked(&mut client, "/api/recipes").await?;
    let malformed = Exit::Content.because(format!("{url}/api/recipes"));
    let recipes: Vec<Recipe> =
        serde_json::from_value(known["recipes"].take()).map_err(malformed)?;
    let mut written = 0;
    for recipe in &recipes {
        let (number, fingerprint) = (recipe.number, &recipe.fingerprint);
        if !is_name(fingerprint) {
            return wrong(format!(
                "the fingerprint {fingerprint:?} of recipe {number}"
            ));
        }
        let file = folder.join("recipes").join(format!("{fingerprint}.recipe"));
        if !file.exists() {
            let path = format!("/api/recipes/{number}/file");
            written += store(&file, &fetched(&mut client, &path, MOST_RECIPE).await?)?;
        }
    }
    let path = "/api/diagnostics.zip";
    let packed = fetched(&mut client, path, MOST_ANSWER).await?;
    let mut kept = |part: &str, name: &str, extension: &str| -> Result<Option<String>> {
        let wrong = Exit::Content.because(format!("{url}{path}"));
        let Some(content) = member(&packed, name).map_err(wrong)? else {
            return Ok(None);
        };
        let digest = Sha256::digest(&content);
        let digest: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
        let file = folder.join(part).join(format!("{digest}.{extension}"));
        written += store(&file, &content)?;
        Ok(Some(digest))
    };
    let configuration = kept("configurations", "fringed.toml", "toml")?;
    // A head without a calibration has none.
    let calibration = kept("calibrations", "calibration.json", "json")?;
    let head = json!({
        "serial": serial, "url": url, "configuration": configuration, "calibration": calibration, "recipes": recipes,
    });
    let file = folder.join("heads").join(format!("{serial}.json"));
    Ok(written + store(&file, format!("{head:#}\n").as_bytes())?)
}

/// Whether a head may name a file so.
fn is_name(text: &str) -> bool {
    let allowed = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    (1..=64).contains(&text.len()) && text.chars().all(allowed)
}

async fn asked(client: &mut Client, path: &str) -> Result<Value> {
    let answer = fetched(client, path, MOST_ANSWER).await?;
    let wrong = Exit::Content.because(format!("{}{path}", client.url()));
    serde_json::from_slice(&answer).map_err(wrong)
}

async fn fetched(client: &mut Client, path: &str, most: usize) -> Result<Vec<u8>> {
    let failed = Exit::Unavailable.because(format!("{}{path}", client.url()));
    client.whole(path, None, most).await.map_err(failed)
}

/// A file of a ZIP, if it is there.
fn member(packed: &[u8], name: &str) -> Result<Option<Vec<u8>>, ZipError> {
    let mut zip = ZipArchive::new(Cursor::new(packed))?;
    let file = match zip.by_name(name) {
        Err(ZipError::FileNotFound) => return Ok(None),
        file => file?,
    };
    let mut content = Vec::new();
    file.take(MOST_ANSWER as u64).read_to_end(&mut content)?;
    Ok(Some(content))
}

/// Writes a file that is whole whatever happens: 1, or 0 if it has this content already.
fn store(file: &Path, content: &[u8]) -> Result<usize> {
    if fs::read(file).is_ok_and(|present| present == content) {
        return Ok(0);
    }
    let partial = file.with_extension("partial");
    let written = fs::File::create(&partial).and_then(|mut to| {
        to.write_all(content)?;
        to.sync_all()?;
        fs::rename(&partial, file)
    });
    let failed = Exit::CannotCreate.because(format!("write {}", file.display()));
    written.map_err(failed).map(|()| 1)
}
