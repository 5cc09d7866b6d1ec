//! The doctor's check of a projector's controller: it shows patterns as they are, is cool enough
//! and reports no fault.

use super::{Check, named};
use crate::station::HOT_PROJECTOR_C;
use hal::projector::{ControllerState, fault, processing};
use serde_json::json;

/// Checks what a controller said of itself.
pub fn examine(state: &ControllerState) -> Check {
    let processed: Vec<&str> = processing::words(state.processing).collect();
    let faults: Vec<&str> = fault::words(state.faults).collect();
    let hot = state
        .temperature_c
        .is_some_and(|celsius| celsius >= HOT_PROJECTOR_C);
    let temperature = state
        .temperature_c
        .map(|celsius| format!("{celsius:.1} °C"));
    let found = format!(
        "a {} at {}, LED current {} steps, picture processing: {}, faults: {}",
        state.device,
        temperature.unwrap_or_else(|| "an unknown temperature".into()),
        state.led_current,
        listed(&processed),
        listed(&faults)
    );
    let remedy = if !faults.is_empty() {
        Some(
            "switch the projector off and on; check its supply, its LED and the cable of the micromirror device",
        )
    } else if !processed.is_empty() {
        Some(
            "light depends on the content of a picture: end the program that sets the controller up besides this one, and open the head again",
        )
    } else if hot {
        Some("cool the projector: clear its fan and vents, or reduce head.projector.led_current")
    } else {
        None
    };
    let measured = json!({
        "device": state.device, "processing": processed, "faults": faults,
        "temperature_c": state.temperature_c, "led_current_steps": state.led_current,
    });
    named("controller", Check::new(found, remedy, measured))
}

fn listed(words: &[&str]) -> String {
    match words {
        [] => "none".into(),
        words => words.join(", "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::head::doctor::Verdict;

    #[test]
    fn what_is_wrong_with_a_controller_is_named_with_its_remedy() {
        let well = ControllerState {
            device: "DLPC3478",
            temperature_c: Some(41.2),
            led_current: 600,
            ..ControllerState::default()
        };
        let check = examine(&well);
        assert_eq!((check.name, check.verdict), ("controller", Verdict::Pass));
        assert!(check.found.contains("41.2 °C"), "{}", check.found);
        let unknown = ControllerState {
            temperature_c: None,
            ..well.clone()
        };
        assert_eq!(examine(&unknown).verdict, Verdict::Pass);
        let adapts = ControllerState {
            processing: processing::CAIC,
            ..well.clone()
        };
        let broken = ControllerState {
            faults: fault::LED,
            ..well.clone()
        };
        let hot = ControllerState {
            temperature_c: Some(HOT_PROJECTOR_C),
            ..well
        };
        for (state, found, remedy) in [
            (adapts, "CAIC", "content"),
            (broken, "LED", "supply"),
            (hot, "70.0 °C", "cool"),
        ] {
            let check = examine(&state);
            assert_eq!(check.verdict, Verdict::Fail);
            assert!(check.found.contains(found), "{}", check.found);
            assert!(check.remedy.contains(remedy), "{}", check.remedy);
        }
    }
}
