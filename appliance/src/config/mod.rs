//! The configuration: one TOML file, every key optional.
//!
//! A key is described in docs/configuration.md, whose table the program contains.

mod devices;
mod keys;

pub use keys::{Key, keys, table};

use crate::error::{Exit, Failure, Result};
use crate::head::calibration::place::IN_STATE;
use crate::head::commission::Commissioning;
use crate::head::exposing::Exposing;
use crate::head::placed::Placed;
use crate::station::control::MAX_RECIPE;
use hal::bounded;
use hal::bounds::{Bound, Fields, Longest, MAX_PATH, OutOfBounds, clipped, length, shortened};
use hal::setup::{CameraSetup, LinesSetup, ProjectorSetup, TriggerSetup};
use ipnet::IpNet;
use serde::{Deserialize, Serialize};
use std::fs;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};

/// Most Modbus connections at a time, unless configured.
const CONNECTIONS: u16 = 8;
/// This machine.
const LOOPBACK: [&str; 2] = ["127.0.0.0/8", "::1/128"];
/// Private and link-local networks: RFC 1918, 3927, 4193 and 4291.
const PRIVATE: [&str; 6] = [
    "10.0.0.0/8",
    "172.16.0.0/12",
    "192.168.0.0/16",
    "169.254.0.0/16",
    "fc00::/7",
    "fe80::/10",
];

bounded! {
    /// The whole configuration. The defaults need no file: a simulated head on this machine.
    pub struct Config: Default {
        /// State folder; none = the platform's.
        pub state: Option<PathBuf> = Longest(MAX_PATH),
        /// Computing threads; 0 = one per core.
        pub threads: usize = 0..=256,
        /// The station.
        pub station: StationConfig = Fields,
        /// Modbus TCP, for the PLC.
        pub modbus: ModbusConfig = Fields,
        /// The page, for the technician.
        pub http: HttpConfig = Fields,
        /// Who may look, and the record of changes.
        pub access: AccessConfig = Fields,
        /// The devices.
        pub head: HeadConfig = Fields,
        /// Digital lines: start, busy, ok and fault.
        pub lines: LinesSetup = Fields,
        /// What is kept of results.
        pub history: HistoryConfig = Fields,
    }
}

/// The most results that a history can be told to keep.
pub const MAX_RESULTS: u32 = 10_000_000;

bounded! {
    /// What is kept of results; the oldest are deleted first.
    pub struct HistoryConfig: Default {
        /// The most results.
        pub results: u32 = 1..=MAX_RESULTS => 100_000,
        /// The most MiB of recordings of parts; 0 = none are kept.
        pub recordings_mib: u32 => 1024,
        /// Of so many parts that pass the frames of the first are kept; 0 = of none.
        pub good_every: u32 => 1000,
    }

    /// The station.
    pub struct StationConfig: Default {
        /// The recipe that is loaded at the start.
        pub recipe: u16 = 1..=MAX_RECIPE => 1,
        /// Whether the PLC may teach.
        pub teach_allowed: bool,
        /// PLC_HEARTBEAT may stand still for this long, s.
        pub plc_timeout_s: u32 = 1..=3600 => 5,
        /// Cycles between two checks of the geometry; 0 = never.
        pub geometry_check_cycles: u32 = 0..=1_000_000 => 200,
    }

    /// Modbus TCP.
    pub struct ModbusConfig: Default {
        /// Address and port.
        #[serde(deserialize_with = "listen")]
        pub listen: SocketAddr => SocketAddr::from((Ipv4Addr::LOCALHOST, 1502)),
        /// Order of the words of 32- and 64-bit values.
        pub word_order: WordOrder,
        /// Answer only to this unit id.
        pub strict_unit_id: Option<u8>,
        /// The most connections at a time.
        pub connections: u16 = 2..=64 => CONNECTIONS,
        /// Networks whose clients may read.
        pub readers: Vec<IpNet> => networks(&[&LOOPBACK[..], &PRIVATE].concat()),
        /// Networks whose clients may write.
        pub writers: Vec<IpNet> => networks(&LOOPBACK),
    }
}

/// Order of the words of 32- and 64-bit values; the bytes of a word are always big-endian.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WordOrder {
    /// High word first (ABCD).
    #[default]
    Normal,
    /// Low word first (CDAB).
    Swapped,
}

/// Reads an address with its port; the parser's own message does not say that the port is missing.
fn listen<'a, D: serde::Deserializer<'a>>(source: D) -> Result<SocketAddr, D::Error> {
    let text = String::deserialize(source)?;
    text.parse().map_err(|_| {
        serde::de::Error::custom(format!(
            "listen = {:?} is no address with a port: write both, as 127.0.0.1:8080",
            clipped(&text)
        ))
    })
}

bounded! {
    /// The page.
    pub struct HttpConfig: Default {
        /// Address and port.
        #[serde(deserialize_with = "listen")]
        pub listen: SocketAddr => SocketAddr::from((Ipv4Addr::LOCALHOST, 8080)),
        /// Host names of the page, besides IP addresses and localhost.
        pub hosts: Vec<String> = Longest(MAX_HOST),
        /// Networks of proxies in front of the page.
        pub proxies: Vec<IpNet>,
    }

    /// Who may look, and the record of changes.
    pub struct AccessConfig: Default {
        /// Who may look at the page.
        pub looking: Looking,
        /// Networks of programs that collect results or watch the station without a login.
        pub collectors: Vec<IpNet>,
        /// The most MiB of the record of changes.
        pub record_mib: u32 = 1..=1024 => 16,
    }

    /// The devices.
    pub struct HeadConfig: Default {
        /// Which kind of head.
        pub backend: Backend,
        /// Scenario file of the simulated head; none = the default part.
        pub scenario: Option<PathBuf> = Longest(MAX_PATH),
        /// Recordings that the replay head plays.
        pub recordings: Vec<PathBuf> = Longest(MAX_PATH),
        /// The camera of the head `rpi`.
        pub camera: CameraSetup = Fields,
        /// The projector of the head `rpi`.
        pub projector: ProjectorSetup = Fields,
        /// The camera's trigger line of the head `rpi`.
        pub trigger: TriggerSetup = Fields,
        /// The head's `calibration.json`; none = in the state folder.
        pub calibration: Option<PathBuf> = Longest(MAX_PATH),
        /// The part in front of the simulated head instead of the scenario's, from the command
        /// line.
        #[serde(skip)]
        pub part: Option<Placed>,
        /// Exposure and gain that were kept on the page.
        #[serde(skip)]
        pub exposing: Option<Exposing>,
    }
}

/// Who may look at the page.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Looking {
    /// Everybody who reaches it.
    #[default]
    Anyone,
    /// Users who have signed in, and `access.collectors`.
    SignedIn,
}

/// The kinds of head.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Backend {
    /// Simulated light.
    #[default]
    Sim,
    /// Recordings.
    Replay,
    /// A camera through libcamera, a projector on a display connector, a trigger on a GPIO line.
    Rpi,
}

/// Most networks, hosts or recordings.
const MAX_LISTED: usize = 1024;
/// Longest name of a host (RFC 1035, section 2.3.4).
const MAX_HOST: usize = 255;

fn networks(all: &[&str]) -> Vec<IpNet> {
    all.iter().filter_map(|net| net.parse().ok()).collect()
}

/// A configuration whose values do not fit each other or their bounds.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ConfigError {
    /// A value is out of its bounds, which the words name with the key.
    #[error(transparent)]
    Bounds(#[from] OutOfBounds),
    /// A device has a width or a height alone.
    #[error("{section}.width and {section}.height: write both or neither")]
    HalfSize {
        /// The device's section.
        section: &'static str,
    },
    /// The trigger's pulse is longer than the exposure.
    #[error(
        "head.trigger.pulse_us = {pulse_us}: write at most head.camera.exposure_us = {exposure_us}: a camera that exposes while the pulse \
         lasts would expose longer than it is said to"
    )]
    LongPulse {
        /// The pulse, µs.
        pulse_us: u32,
        /// The exposure, µs.
        exposure_us: u32,
    },
    /// The camera is triggered by a line and by the projector.
    #[error(
        "head.trigger.line and head.trigger.by_projector: write one of them: a camera has one trigger input"
    )]
    TwoTriggers,
    /// Two lines have one name.
    #[error("{} and {} are both \"{line}\": give each its own line", keys[0], keys[1])]
    SharedLine {
        /// The keys that name it.
        keys: [&'static str; 2],
        /// The line.
        line: String,
    },
    /// A replay head without recordings.
    #[error("head.recordings is empty: the replay head needs at least one folder")]
    NoRecordings,
}

impl Config {
    /// Reads and checks a file. Paths in it are relative to its folder.
    ///
    /// # Errors
    /// If it does not exist (66), is not TOML, has an unknown key or a value out of range (78); the
    /// message names the file, the key and the remedy.
    pub fn read(path: &Path) -> Result<Self> {
        let place = path.display();
        let text = fs::read_to_string(path).map_err(|error| {
            let exit = match error.kind() {
                std::io::ErrorKind::NotFound => Exit::Missing,
                _ => Exit::Configuration,
            };
            let remedy = format!("{error}: name a TOML file with --config");
            Failure::because(exit, format!("read configuration {place}"), remedy)
        })?;
        let wrong = |error: String| {
            let error = shortened(&error);
            let words = format!(
                "read configuration {place}: {error}; `fringed config keys` lists every key"
            );
            Failure::new(Exit::Configuration, words)
        };
        let mut config: Self = toml::from_str(&text).map_err(|error| wrong(error.to_string()))?;
        config.check().map_err(|error| wrong(error.to_string()))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let head = &mut config.head;
        let paths = head.scenario.iter_mut().chain(&mut head.recordings);
        let paths = paths.chain(&mut head.calibration);
        for path in paths.chain(&mut config.state) {
            *path = folder.join(&*path);
        }
        Ok(config)
    }

    /// The devices, with the calibration in this state folder unless another one is configured.
    pub fn head_in(&self, state: &Path) -> HeadConfig {
        let mut head = self.head.clone();
        head.calibration.get_or_insert_with(|| state.join(IN_STATE));
        let kept = Commissioning::kept_exposing(state);
        // Exposure and gain of another camera are of no use.
        if let Some(kept) = kept.filter(|kept| kept.check(head.least_gain()).is_ok()) {
            head.expose(kept);
        }
        head
    }

    /// Checks the ranges that the types do not express.
    ///
    /// # Errors
    /// Naming the key and its range.
    pub fn check(&self) -> Result<(), ConfigError> {
        Fields.check("", self)?;
        let modbus = &self.modbus;
        for (key, count) in [
            ("modbus.readers", modbus.readers.len()),
            ("modbus.writers", modbus.writers.len()),
            ("http.hosts", self.http.hosts.len()),
            ("access.collectors", self.access.collectors.len()),
            ("head.recordings", self.head.recordings.len()),
        ] {
            length(key, count, 0, MAX_LISTED)?;
        }
        devices::check(self)?;
        if self.head.backend == Backend::Replay && self.head.recordings.is_empty() {
            return Err(ConfigError::NoRecordings);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Config> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fringed.toml");
        fs::write(&path, text).unwrap();
        Config::read(&path)
    }

    #[test]
    fn an_empty_file_is_the_default() {
        assert_eq!(read("").unwrap(), Config::default());
    }

    #[test]
    fn an_unknown_key_and_a_value_out_of_range_are_refused_by_name() {
        for (text, word) in [
            ("threats = 2", "threats"),
            ("[modbus]\nport = 5", "port"),
            ("[station]\nrecipe = 0", "station.recipe"),
            ("[modbus]\nconnections = 1", "modbus.connections"),
            ("[head]\nbackend = \"replay\"", "head.recordings"),
            ("[modbus]\nlisten = \"nowhere\"", "listen"),
            (
                "[http]\nlisten = \"192.168.1.5\"",
                "write both, as 127.0.0.1:8080",
            ),
            ("[head.camera]\nexposure_us = 0", "head.camera.exposure_us"),
            ("[head.camera]\nperiod_us = 9", "head.camera.period_us"),
            ("[head.camera]\ngain = nan", "head.camera.gain"),
            ("[head.camera]\nwidth = 9", "head.camera.height"),
            ("[head.projector]\nrefresh_hz = 0", "refresh_hz"),
            ("[head.trigger]\npulse_us = 0", "head.trigger.pulse_us"),
            (
                "[head.trigger]\nline = \"A\"\npulse_us = 16668",
                "at most head.camera.exposure_us = 16667",
            ),
            ("[lines]\nok = \"A\"\nbusy = \"A\"", "lines.ok"),
            ("[lines]\nnok = \"A\"", "nok"),
            ("= 5", "TOML"),
        ] {
            let failure = read(text).unwrap_err();
            assert_eq!(failure.exit, Exit::Configuration);
            assert!(failure.to_string().contains(word), "{failure}");
            assert!(failure.to_string().contains("fringed.toml"), "{failure}");
        }
    }

    #[test]
    fn paths_are_relative_to_the_file() {
        let config = read("[head]\nscenario = \"parts/cone.toml\"").unwrap();
        let scenario = config.head.scenario.unwrap();
        assert!(scenario.is_absolute() && scenario.ends_with("parts/cone.toml"));
    }

    /// A page or file of the documentation.
    fn document(name: &str) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("../docs")
            .join(name)
    }

    #[test]
    fn the_example_of_the_reference_head_is_right_and_wired_as_documented() {
        let config = Config::read(&document("fringed.toml")).unwrap();
        assert_eq!(config.head.backend, Backend::Rpi);
        let (trigger, lines) = (&config.head.trigger, &config.lines);
        let wiring = fs::read_to_string(document("hardware.md")).unwrap();
        for (signal, line) in [
            ("camera trigger", &trigger.line),
            ("start", &lines.start),
            ("busy", &lines.busy),
            ("ok", &lines.ok),
            ("fault", &lines.fault),
        ] {
            let row = format!("| {signal} | {} |", line.as_deref().unwrap());
            assert!(wiring.contains(&row), "no wire for {row}");
        }
        // The camera exposes 14.26 µs longer than its pulse, and the configured exposure is that
        // time.
        let exposed = f64::from(trigger.pulse_us) + 14.26;
        assert!((exposed - f64::from(config.head.camera.exposure_us)).abs() < 1.0);
    }
}
