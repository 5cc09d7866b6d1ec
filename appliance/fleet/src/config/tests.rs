//! Keys, ranges and what is refused.

use super::*;

fn read(text: &str) -> Result<Config> {
    let wrong = Exit::Configuration.because("text");
    checked(toml::from_str(text).map_err(wrong)?, None)
}

#[test]
fn a_range_stands_for_addresses_with_as_many_digits() {
    let urls = |text| range::expanded(text, 1000);
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
