//! Every configuration key with its unit, range, default and meaning.

mod devices;

use std::fmt::Write as _;

/// One key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key {
    /// `section.key`.
    pub name: &'static str,
    /// Its unit, or its type.
    pub unit: &'static str,
    /// What may be written.
    pub range: &'static str,
    /// What holds if it is not written.
    pub default: &'static str,
    /// What it does.
    pub meaning: &'static str,
}

/// All keys but those of the devices; a test compares them with the structs.
const KEYS: [Key; 20] = [
    Key {
        name: "state",
        unit: "folder",
        range: "any that can be written",
        default: "the platform's state folder",
        meaning: "recipes, result counter, serial; `--state` takes precedence",
    },
    Key {
        name: "threads",
        unit: "threads",
        range: "0 to 256",
        default: "0",
        meaning: "computing threads, 0 = one per core; `--threads` takes precedence",
    },
    Key {
        name: "station.recipe",
        unit: "number",
        range: "1 to 9999",
        default: "1",
        meaning: "the recipe that is loaded at the start; on a simulated head without it, it is taught",
    },
    Key {
        name: "station.teach_allowed",
        unit: "true or false",
        range: "true, false",
        default: "false",
        meaning: "whether the PLC may teach (CONTROL bit 7)",
    },
    Key {
        name: "station.plc_timeout_s",
        unit: "s",
        range: "1 to 3600",
        default: "5",
        meaning: "PLC_HEARTBEAT may stand still for this long before the warning plc_lost",
    },
    Key {
        name: "modbus.listen",
        unit: "address:port",
        range: "any of this machine",
        default: "127.0.0.1:1502",
        meaning: "where Modbus TCP is served; `--modbus` takes precedence",
    },
    Key {
        name: "modbus.word_order",
        unit: "word",
        range: "normal (ABCD), swapped (CDAB)",
        default: "normal",
        meaning: "order of the words of 32- and 64-bit values",
    },
    Key {
        name: "modbus.strict_unit_id",
        unit: "unit id",
        range: "0 to 255",
        default: "any",
        meaning: "answer only to this unit id, exception 0x0B to others",
    },
    Key {
        name: "modbus.connections",
        unit: "connections",
        range: "2 to 64",
        default: "8",
        meaning: "the most at a time; one of them is reserved for a client that may write",
    },
    Key {
        name: "modbus.readers",
        unit: "networks",
        range: "addresses with their prefix, as in 10.1.2.0/24",
        default: "[127.0.0.0/8, ::1/128, 10.0.0.0/8, 172.16.0.0/12, 192.168.0.0/16, 169.254.0.0/16, fc00::/7, fe80::/10]",
        meaning: "networks from which Modbus connections are accepted: this machine and private networks",
    },
    Key {
        name: "modbus.writers",
        unit: "networks",
        range: "addresses with their prefix, as in 10.1.2.7/32",
        default: "[127.0.0.0/8, ::1/128]",
        meaning: "networks whose clients may write, and so trigger; others get exception 1. List the PLC here",
    },
    Key {
        name: "http.listen",
        unit: "address:port",
        range: "any of this machine",
        default: "127.0.0.1:8080",
        meaning: "where the page is served; `--http` takes precedence",
    },
    Key {
        name: "http.hosts",
        unit: "names",
        range: "host names",
        default: "[]",
        meaning: "names by which the page may be asked for, beside IP addresses and localhost",
    },
    Key {
        name: "http.proxies",
        unit: "networks",
        range: "addresses with their prefix, as in 127.0.0.1/32",
        default: "[]",
        meaning: "proxies in front of the page, each of which stands for many clients: any other address has at most 16 of the page's 64 connections",
    },
    Key {
        name: "head.backend",
        unit: "word",
        range: "sim, replay, rpi",
        default: "sim",
        meaning: "which head: simulated light, recordings, or the camera, the projector and the trigger line of the keys below",
    },
    Key {
        name: "head.scenario",
        unit: "file",
        range: "a scenario in TOML",
        default: "the default sheet-metal part",
        meaning: "what the simulated head sees",
    },
    Key {
        name: "head.recordings",
        unit: "folders",
        range: "recordings of one head",
        default: "[]",
        meaning: "what the replay head plays, in turn; required with backend = \"replay\"",
    },
    Key {
        name: "head.calibration",
        unit: "file",
        range: "a calibration.json",
        default: "calibration/calibration.json in the state folder",
        meaning: "the calibration of the head; `fringed calibrate` writes it, and keeps the previous one beside it",
    },
    Key {
        name: "history.results",
        unit: "results",
        range: "1 to 10000000",
        default: "100000",
        meaning: "the most results in the history; the oldest are deleted first",
    },
    Key {
        name: "history.recordings_mib",
        unit: "MiB",
        range: "0 to 4294967295",
        default: "1024",
        meaning: "the most storage for frames of parts that did not pass; the oldest are deleted first; 0 = none are kept",
    },
];

/// Every key.
pub fn keys() -> impl Iterator<Item = &'static Key> {
    KEYS.iter().chain(&devices::KEYS)
}

/// All keys as a table in Markdown, as `docs/configuration.md` has it.
pub fn table() -> String {
    let mut table =
        String::from("| key | unit | range | default | meaning |\n|---|---|---|---|---|\n");
    for key in keys() {
        let Key {
            name,
            unit,
            range,
            default,
            meaning,
        } = key;
        // Writing to a string cannot fail.
        let _ = writeln!(
            table,
            "| `{name}` | {unit} | {range} | {default} | {meaning} |"
        );
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Config, HeadConfig, ModbusConfig};
    use hal::setup::{CameraSetup, LinesSetup, ProjectorSetup, TriggerSetup};
    use std::collections::BTreeMap;

    /// A configuration in which nothing is left out.
    fn full() -> Config {
        let word = || Some("word".to_owned());
        Config {
            state: Some("state".into()),
            modbus: ModbusConfig {
                strict_unit_id: Some(1),
                ..ModbusConfig::default()
            },
            head: HeadConfig {
                scenario: Some("scenario".into()),
                camera: CameraSetup {
                    id: word(),
                    width: Some(1),
                    height: Some(1),
                    ..CameraSetup::default()
                },
                projector: ProjectorSetup {
                    card: Some("card".into()),
                    connector: word(),
                    width: Some(1),
                    height: Some(1),
                    refresh_hz: Some(1.0),
                },
                trigger: TriggerSetup {
                    line: word(),
                    ..TriggerSetup::default()
                },
                calibration: Some("calibration.json".into()),
                ..HeadConfig::default()
            },
            lines: LinesSetup {
                start: word(),
                busy: word(),
                ok: word(),
                fault: word(),
                ..LinesSetup::default()
            },
            ..Config::default()
        }
    }

    fn flat(config: &Config) -> BTreeMap<String, String> {
        let mut keys = BTreeMap::new();
        gather("", &toml::Value::try_from(config).unwrap(), &mut keys);
        keys
    }

    /// Every value below `value` under its whole name.
    fn gather(name: &str, value: &toml::Value, keys: &mut BTreeMap<String, String>) {
        let toml::Value::Table(values) = value else {
            keys.insert(name.to_owned(), value.to_string().replace('"', ""));
            return;
        };
        for (key, value) in values {
            let name = [name, key].join(".");
            gather(name.trim_start_matches('.'), value, keys);
        }
    }

    #[test]
    fn the_table_has_every_key_of_the_code_and_no_other() {
        let mut documented: Vec<_> = keys().map(|key| key.name.to_owned()).collect();
        documented.sort();
        assert_eq!(documented, flat(&full()).into_keys().collect::<Vec<_>>());
    }

    #[test]
    fn the_documented_defaults_are_the_code_s() {
        let defaults = flat(&Config::default());
        for key in keys() {
            // What has no default value in the code is described in words.
            if let Some(value) = defaults.get(key.name) {
                assert_eq!(key.default, value, "{}", key.name);
            }
        }
    }

    #[test]
    fn the_documentation_holds_the_table() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/configuration.md");
        let text = std::fs::read_to_string(path).unwrap();
        assert!(
            text.contains(&table()),
            "put the output of `fringed config keys` into docs/configuration.md"
        );
    }
}
