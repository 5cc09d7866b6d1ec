//! `fleet.toml`: which heads there are, and where their results go. A key is described in
//! docs/fleet.md, whose table the tests compare with the structs.

use crate::error::{Exit, Result};
use crate::http::{Url, trusting};
use rustls::ClientConfig;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// The file that is read if it is there and no other is named.
const FILE: &str = "fleet.toml";
/// The most heads.
const MOST_HEADS: usize = 100_000;

/// The file.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    store: Option<String>,
    poll_s: Option<f64>,
    state_s: Option<f64>,
    keep_days: Option<u32>,
    ca: Option<PathBuf>,
    #[serde(default)]
    heads: Vec<WrittenHeads>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenHeads {
    url: String,
    #[serde(default)]
    line: String,
    serial: Option<String>,
}

/// A head that is asked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HeadConfig {
    /// Where it answers.
    pub url: Url,
    /// The production line.
    pub line: String,
    /// The serial that it must have.
    pub serial: Option<String>,
}

/// What is checked.
#[derive(Clone, Debug)]
pub struct Config {
    /// URL of the store, if one is named.
    pub store: Option<String>,
    /// Pause between two questions for results.
    pub poll: Duration,
    /// Pause between two questions for the state.
    pub state: Duration,
    /// How long results are kept; `None`: never deleted.
    pub keep: Option<Duration>,
    /// Whom connections trust, with https.
    pub tls: Option<Arc<ClientConfig>>,
    /// The heads, each address once.
    pub heads: Vec<HeadConfig>,
}

/// Where the configuration comes from: options of several commands.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct Fleet {
    /// Configuration; without it and without --heads, fleet.toml if it is there.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Address of a head, or of several: http://10.0.0.{1..30}:8080 (repeatable). Instead of those
    /// of the configuration.
    #[arg(long, value_name = "URL")]
    heads: Vec<String>,
    /// Where results are: sqlite:FILE or http://HOST:PORT/DATABASE. Takes precedence.
    #[arg(long, value_name = "URL")]
    store: Option<String>,
}

impl Fleet {
    /// Reads and checks the configuration.
    ///
    /// # Errors
    /// If the file is missing or wrong, or an option is.
    pub fn read(&self) -> Result<Config> {
        let file = self.config.as_deref();
        let usual = Some(Path::new(FILE)).filter(|file| self.heads.is_empty() && file.exists());
        let mut written = match file.or(usual) {
            Some(file) => {
                let missing = Exit::Missing.because(format!("read {}", file.display()));
                let text = fs::read_to_string(file).map_err(missing)?;
                let wrong = Exit::Configuration.because(file.display());
                toml::from_str(&text).map_err(wrong)?
            }
            None => Written::default(),
        };
        if !self.heads.is_empty() {
            let asked = self.heads.iter().map(|url| WrittenHeads {
                url: url.clone(),
                ..WrittenHeads::default()
            });
            written.heads = asked.collect();
        }
        let store = self.store.clone().or(written.store.take());
        checked(written, store)
    }
}

fn checked(written: Written, store: Option<String>) -> Result<Config> {
    let seconds = |key: &str, value: f64, least: f64| match (least..=3600.0).contains(&value) {
        true => Ok(Duration::from_secs_f64(value)),
        false => Exit::Configuration.fail(format!("{key} = {value}: write {least} to 3600")),
    };
    let poll = seconds("poll_s", written.poll_s.unwrap_or(1.0), 0.1)?;
    let state = seconds("state_s", written.state_s.unwrap_or(10.0), 1.0)?;
    let keep = match written.keep_days {
        Some(days) if !(1..=36_500).contains(&days) => {
            return Exit::Configuration.fail(format!("keep_days = {days}: write 1 to 36500"));
        }
        days => days.map(|days| Duration::from_secs(86_400 * u64::from(days))),
    };
    let mut heads = Vec::new();
    let mut known = BTreeSet::new();
    for row in written.heads {
        let wrong = Exit::Configuration.because(format!("heads.url = {:?}", row.url));
        let urls = expanded(&row.url, MOST_HEADS).map_err(&wrong)?;
        if row.serial.is_some() && urls.len() > 1 {
            let words = format!("{}: a serial is of one head: give each a table", row.url);
            return Exit::Configuration.fail(words);
        }
        for text in urls {
            let url: Url = text.parse().map_err(&wrong)?;
            if !known.insert(text) {
                return Exit::Configuration.fail(format!("{url} is there twice: delete one"));
            }
            heads.push(HeadConfig {
                url,
                line: row.line.clone(),
                serial: row.serial.clone(),
            });
        }
    }
    if heads.len() > MOST_HEADS {
        let words = format!("{} heads: one collector takes {MOST_HEADS}", heads.len());
        return Exit::Configuration.fail(words);
    }
    Ok(Config {
        store,
        poll,
        state,
        keep,
        tls: written.ca.as_deref().map(trusting).transpose()?,
        heads,
    })
}

/// Every text that `text` stands for, at most `most`: `{0001..0030}` stands for 30 numbers with four
/// digits.
///
/// # Errors
/// If a range is wrong or there are too many, in words.
fn expanded(text: &str, most: usize) -> Result<Vec<String>, String> {
    let mut all = vec![String::new()];
    let mut rest = text;
    while let Some((before, behind)) = rest.split_once('{') {
        let (range, after) = behind.split_once('}').ok_or("close the range with }")?;
        let wrong = || format!("{{{range}}}: write a range as {{01..12}}");
        let (first, last) = range.split_once("..").ok_or_else(wrong)?;
        let number = |text: &str| text.parse::<u32>().map_err(|_| wrong());
        let (from, to) = (number(first)?, number(last)?);
        let count = to.checked_sub(from).ok_or_else(wrong)? as usize + 1;
        if count.saturating_mul(all.len()) > most {
            return Err(format!("it stands for more than {most}"));
        }
        let width = first.len();
        let longer = |start: &String| {
            let start = format!("{start}{before}");
            (from..=to).map(move |number| format!("{start}{number:0width$}"))
        };
        all = all.iter().flat_map(longer).collect();
        rest = after;
    }
    for text in &mut all {
        text.push_str(rest);
    }
    Ok(all)
}

impl Config {
    /// The URL of the store.
    ///
    /// # Errors
    /// If none is named.
    pub fn store(&self) -> Result<&str> {
        match &self.store {
            Some(store) => Ok(store),
            None => Exit::Usage.fail("no store is named: add --store sqlite:plant.db"),
        }
    }

    /// The heads, at least one.
    ///
    /// # Errors
    /// If no heads are named.
    pub fn heads(&self) -> Result<&[HeadConfig]> {
        if self.heads.is_empty() {
            let words = "no heads are named: add --heads URL, or write fleet.toml";
            return Exit::Usage.fail(words);
        }
        Ok(&self.heads)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Config> {
        let wrong = Exit::Configuration.because("text");
        checked(toml::from_str(text).map_err(wrong)?, None)
    }

    #[test]
    fn a_range_stands_for_addresses_with_as_many_digits() {
        let urls = |text| expanded(text, 1000);
        assert_eq!(urls("http://a/").unwrap(), ["http://a/"]);
        let three = ["x/08/", "x/09/", "x/10/"];
        assert_eq!(urls("x/{08..10}/").unwrap(), three);
        assert_eq!(urls("{1..2}.{3..4}").unwrap(), ["1.3", "1.4", "2.3", "2.4"]);
        for wrong in ["{1..", "{a..b}", "{3..1}", "{1-3}", "{0..1000}"] {
            assert!(urls(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_table_has_every_key_and_no_other() {
        let document = include_str!("../../../../docs/fleet.md");
        let (_, section) = document.split_once("\n## Keys of fleet.toml\n").unwrap();
        let (section, _) = section.split_once("\n## ").unwrap();
        let documented = section.lines().filter_map(|row| row.strip_prefix("| `"));
        let documented: Vec<_> = documented.filter_map(|row| row.split('`').next()).collect();
        // What the error about an unknown key lists is what the code knows.
        let known = |text: &str| {
            let error = toml::from_str::<Written>(text).unwrap_err().to_string();
            let list = error.split("expected one of ").nth(1).unwrap().to_owned();
            list.split('`')
                .skip(1)
                .step_by(2)
                .map(str::to_owned)
                .collect::<Vec<_>>()
        };
        let mut keys = known("unknown = 1");
        let inner = known("[[heads]]\nunknown = 1");
        keys.extend(inner.iter().map(|key| format!("heads.{key}")));
        assert_eq!(documented, keys);
    }

    #[test]
    fn a_wrong_configuration_is_refused_by_its_key() {
        let head = "[[heads]]\nurl = \"http://a/{1..2}\"\n";
        assert_eq!(read(head).unwrap().heads.len(), 2);
        for (text, named) in [
            ("poll_s = 0.01", "poll_s"),
            ("state_s = nan", "state_s"),
            ("keep_days = 0", "keep_days"),
            ("pol_s = 1", "pol_s"),
            ("[[heads]]\nurl = \"ftp://a\"", "ftp://a"),
            (&*format!("{head}serial = \"x\""), "serial"),
            (&*format!("{head}{head}"), "twice"),
        ] {
            let failure = read(text).unwrap_err();
            assert_eq!(failure.exit, Exit::Configuration);
            assert!(failure.message.contains(named), "{failure}");
        }
    }

    #[test]
    fn the_example_is_a_configuration() {
        let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/fleet/fleet.toml");
        let config = read(&fs::read_to_string(example).unwrap()).unwrap();
        assert!(config.heads.len() > 5);
    }
}
