//! Every configuration key with its unit, range, default and meaning.

use serde::Serialize;

/// The document with the table of all keys; tests compare its rows with the structs.
const DOCUMENT: &str = include_str!("../../../docs/configuration.md");

/// One key.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
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

/// The lines of the table of all keys, in Markdown.
pub fn table() -> impl Iterator<Item = &'static str> {
    DOCUMENT.lines().filter(|line| line.starts_with('|'))
}

/// Every key: the rows of [`table`].
pub fn keys() -> impl Iterator<Item = Key> {
    table().filter_map(|row| {
        let row = row.strip_prefix("| `")?.strip_suffix(" |")?;
        let (name, row) = row.split_once("` | ")?;
        let mut cells = row.split(" | ");
        Some(Key {
            name,
            unit: cells.next()?,
            range: cells.next()?,
            default: cells.next()?,
            meaning: cells.next()?,
        })
    })
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
                    led_current: Some(1),
                    ..ProjectorSetup::default()
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

    /// What [`Config::check`] says if one key is `value`; `None` if it accepts the value, or if the
    /// type of the key does not.
    fn refusal(key: &str, value: f64) -> Option<String> {
        let (section, name) = key.rsplit_once('.').unwrap_or_default();
        // A width and a height are written both or neither.
        let other = match name {
            "width" => "height = 1",
            "height" => "width = 1",
            _ => "",
        };
        let name = if name.is_empty() { key } else { name };
        let header = match section {
            "" => String::new(),
            section => format!("[{section}]"),
        };
        let file = format!("{header}\n{name} = {value}\n{other}");
        let refused = toml::from_str::<Config>(&file).ok()?.check().err();
        refused.map(|error| error.to_string())
    }

    #[test]
    fn the_documented_ranges_are_the_code_s() {
        let mut compared = 0;
        for key in keys() {
            let range = key.range.split(',').next().unwrap();
            let Some((low, high)) = range.split_once(" to ") else {
                continue;
            };
            let [low, high] = [low, high].map(|bound| bound.parse::<f64>().ok());
            for (bound, beyond) in [(low, -1.0), (high, 1.0)] {
                let Some(bound) = bound else { continue };
                let name = key.name;
                // A value that is written out of its type's range is refused by the parser, so that
                // nothing is compared with it.
                let Some(words) = refusal(name, bound + beyond) else {
                    let all = [0.0, f64::from(u8::MAX), f64::from(u32::MAX)];
                    assert!(all.contains(&bound), "{name} takes {}", bound + beyond);
                    continue;
                };
                let said = words.strip_prefix(name).and_then(|words| {
                    let (low, high) = words.split_once(": write ")?.1.split_once(" to ")?;
                    let end = if beyond < 0.0 { low } else { high };
                    end.parse::<f64>().ok()
                });
                assert_eq!(said, Some(bound), "{words}");
                // No key may be refused for its bound; other keys may not fit it.
                let refused = refusal(name, bound).unwrap_or_default();
                assert!(!refused.starts_with(&format!("{name} is ")), "{refused}");
                compared += 1;
            }
        }
        assert!(compared > 25, "{compared}");
    }
}
