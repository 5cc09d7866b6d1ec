//! `fringed-fleet backup`: recipes, calibration and configuration of each head, as files.
//!
//! A recipe that many heads have is one file, named by its fingerprint: `recipes/FINGERPRINT.recipe`.
//! Calibrations and configurations are named by the SHA-256 of their text. `heads/SERIAL.json` says
//! which of them a head has. What is there already is neither fetched nor written again. A head does
//! not send the phase maps of a measured plate: copy `calibration/` of its state folder.

use crate::config::{Fleet, HeadConfig};
use crate::error::{Exit, Failure, Result};
use crate::http::{Client, HttpError, trusting};
use crate::log::{self, Severity};
use rustls::ClientConfig;
use serde::Deserialize;
use serde_json::json;
use sha2::{Digest as _, Sha256};
use std::fs;
use std::io::{Cursor, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
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

/// What of `GET /api/recipes` is read.
#[derive(Deserialize)]
struct Recipes {
    recipes: Vec<Recipe>,
}

#[derive(Deserialize)]
struct Recipe {
    number: u16,
    name: String,
    fingerprint: String,
}

#[derive(Deserialize)]
struct Snapshot {
    identity: Identity,
}

#[derive(Deserialize)]
struct Identity {
    serial: String,
}

impl Backup {
    /// Asks every head.
    ///
    /// # Errors
    /// If the folder cannot be written; if a head could not be asked, after the others were.
    pub fn run(&self) -> Result<()> {
        let config = self.fleet.read()?;
        let heads = config.heads()?.to_vec();
        let tls = config.ca.as_deref().map(trusting).transpose()?;
        for part in ["recipes", "calibrations", "configurations", "heads"] {
            let folder = self.folder.join(part);
            let failed = Exit::CannotCreate.because(format!("create {}", folder.display()));
            fs::create_dir_all(&folder).map_err(failed)?;
        }
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build();
        let runtime = runtime.map_err(Exit::Software.because("start"))?;
        let count = heads.len();
        let (written, failed) = runtime.block_on(all(&self.folder, heads, tls))?;
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

/// Files that were written, and heads that could not be asked.
async fn all(
    folder: &Path,
    heads: Vec<HeadConfig>,
    tls: Option<Arc<ClientConfig>>,
) -> Result<(usize, usize)> {
    let (mut written, mut failed) = (0, 0);
    let mut asking = JoinSet::new();
    let mut heads = heads.into_iter();
    loop {
        while asking.len() < AT_A_TIME
            && let Some(head) = heads.next()
        {
            let client = Client::new(head.url, tls.clone());
            asking.spawn(one(folder.to_path_buf(), client));
        }
        match asking.join_next().await {
            None => return Ok((written, failed)),
            Some(Ok(Ok(count))) => written += count,
            Some(Ok(Err(failure))) if failure.exit == Exit::CannotCreate => return Err(failure),
            Some(Ok(Err(failure))) => {
                log::write(Severity::Warning, &failure.to_string());
                failed += 1;
            }
            Some(Err(error)) => return Exit::Software.fail(error),
        }
    }
}

/// Files that were written of one head.
async fn one(folder: PathBuf, mut client: Client) -> Result<usize> {
    let url = client.url().to_string();
    let snapshot: Snapshot = asked(&mut client, "/api/snapshot").await?;
    let serial = snapshot.identity.serial;
    let safe = |name: &str| {
        !name.is_empty()
            && name.len() <= 64
            && name
                .chars()
                .all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_')
    };
    if !safe(&serial) {
        return Exit::Content.fail(format!("{url}: the serial {serial:?} is no name of a file"));
    }
    let known: Recipes = asked(&mut client, "/api/recipes").await?;
    let mut written = 0;
    let mut rows = Vec::new();
    for recipe in known.recipes {
        let Recipe {
            number,
            name,
            fingerprint,
        } = recipe;
        if !safe(&fingerprint) {
            let words =
                format!("{url}: the fingerprint {fingerprint:?} of recipe {number} is none");
            return Exit::Content.fail(words);
        }
        let file = folder.join("recipes").join(format!("{fingerprint}.recipe"));
        if !file.exists() {
            let path = format!("/api/recipes/{number}/file");
            let content = client.get_whole(&path, MOST_RECIPE).await;
            written += store(&file, &content.map_err(unavailable(&url, &path))?)?;
        }
        rows.push(json!({ "number": number, "name": name, "fingerprint": fingerprint }));
    }
    let path = "/api/diagnostics.zip";
    let packed = client.get_whole(path, MOST_ANSWER).await;
    let packed = packed.map_err(unavailable(&url, path))?;
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
        "serial": serial, "url": url, "configuration": configuration, "calibration": calibration, "recipes": rows,
    });
    let file = folder.join("heads").join(format!("{serial}.json"));
    Ok(written + store(&file, format!("{head:#}\n").as_bytes())?)
}

async fn asked<T: for<'a> Deserialize<'a>>(client: &mut Client, path: &str) -> Result<T> {
    let url = client.url().to_string();
    let answer = client.get_whole(path, MOST_ANSWER).await;
    let answer = answer.map_err(unavailable(&url, path))?;
    serde_json::from_slice(&answer).map_err(Exit::Content.because(format!("{url}{path}")))
}

fn unavailable(url: &str, path: &str) -> impl Fn(HttpError) -> Failure {
    Exit::Unavailable.because(format!("{url}{path}"))
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
