//! Light as real projectors make it, on the simulated head: it comes late.

use appliance::config::{Backend, HeadConfig};
use appliance::head::examine::{Lit, SETTLE};
use appliance::production::backend::{self, Opened};
use hal::error::DeviceKind;
use std::path::Path;
use tests::small_head::SMALL_HEAD as HEAD;

/// Opens a small head with these keys, as every command does that measures.
fn open(folder: &Path, keys: &str) -> (HeadConfig, Opened) {
    let scenario = folder.join("scenario.toml");
    std::fs::write(&scenario, format!("{HEAD}{keys}")).unwrap();
    let config = HeadConfig {
        backend: Backend::Sim,
        scenario: Some(scenario),
        ..HeadConfig::default()
    };
    let opened = backend::open(&config, &|_| ()).unwrap();
    (config, opened)
}

#[test]
fn light_that_comes_seconds_after_the_mode_was_set_is_waited_for_also_when_a_lost_head_is_back() {
    let folder = tempfile::tempdir().unwrap();
    let (config, mut opened) = open(folder.path(), "[timing]\nfirst_light_us = 3000000\n");
    let lit = |opened: &mut Opened| Lit::take(&mut opened.head, SETTLE).unwrap().share();
    assert_eq!((opened.dark.clone(), lit(&mut opened)), (None, 1.0));
    let stage = opened.stage.clone().unwrap();
    stage.unplug(DeviceKind::Projector);
    stage.plug(DeviceKind::Projector);
    opened.reopen(&config).unwrap();
    assert_eq!((opened.dark.clone(), lit(&mut opened)), (None, 1.0));
}

#[test]
fn light_that_does_not_come_is_said_and_the_head_is_open_all_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let (_, opened) = open(folder.path(), "[timing]\nfirst_light_us = 60000000\n");
    let said = opened.dark.unwrap();
    assert!(said.contains("within 15 s") && said.contains("power"), "{said}");
    // A fixture without a part is no reason to wait, where opening sets no mode.
    let (_, opened) = open(folder.path(), "[light]\ndiffuse = 0.0\n");
    assert_eq!(opened.dark, None);
}
