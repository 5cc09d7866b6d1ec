//! The doctor's checks of the computer, which need no head: what becomes of lines whose program ends.

use super::{Check, named};
use crate::system::host::Host;
use hal::setup::{LinesSetup, TriggerSetup};
use serde_json::json;

/// Checks a computer with these lines; `trigger` is that of a real head. There are only checks of what is used.
pub fn examine(host: &Host, lines: &LinesSetup, trigger: Option<&TriggerSetup>) -> Vec<Check> {
    let trigger = trigger.filter(|trigger| trigger.line.is_some());
    let outputs = [&lines.busy, &lines.ok, &lines.fault];
    let press = outputs.into_iter().any(Option::is_some);
    let chips = [
        trigger.map(|trigger| &*trigger.chip),
        press.then_some(&*lines.chip),
    ];
    let mut chips: Vec<&str> = chips.into_iter().flatten().collect();
    chips.dedup();
    let released = (!chips.is_empty()).then(|| named("lines", released(host, &chips)));
    released.into_iter().collect()
}

/// Whether lines become inputs when their program ends.
fn released(host: &Host, chips: &[&str]) -> Check {
    let kept: Vec<_> = chips
        .iter()
        .map(|chip| (*chip, host.keeps_released_outputs(chip)))
        .collect();
    let words = kept.iter().map(|(chip, kept)| match kept {
        Some(true) => format!("{chip} keeps the level of a line whose program has ended"),
        Some(false) => format!("{chip} makes a line whose program has ended an input"),
        None => format!("what {chip} does with a line whose program has ended is not known"),
    });
    let found = words.collect::<Vec<_>>().join("; ");
    let unsafe_lines = kept.iter().any(|(_, kept)| *kept == Some(true));
    let remedy = unsafe_lines.then_some(
        "add dtparam=strict_gpiod to /boot/firmware/config.txt and restart the computer: else the fault line may go on saying \"no fault\" after a crash",
    );
    let measured = kept
        .iter()
        .map(|(chip, kept)| json!({ "chip": chip, "keeps_level": kept }));
    let measured = json!({ "chips": measured.collect::<Vec<_>>() });
    Check::new(found, remedy, measured)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::head::doctor::Verdict;
    use crate::system::host::tests::root;

    const PARAMETER: &str = "sys/module/pinctrl_rp1/parameters/persist_gpio_outputs";

    #[test]
    fn lines_that_keep_their_level_after_a_kill_are_named_with_the_remedy() {
        let lines = LinesSetup {
            fault: Some("GPIO5".into()),
            ..LinesSetup::default()
        };
        let trigger = TriggerSetup {
            line: Some("GPIO17".into()),
            ..TriggerSetup::default()
        };
        for (parameter, verdict) in [("Y\n", Verdict::Fail), ("N\n", Verdict::Pass)] {
            let root = root(&[(PARAMETER, parameter)]);
            let checks = examine(&Host::at(root.path()), &lines, Some(&trigger));
            let [check] = &checks[..] else {
                panic!("{checks:?}");
            };
            assert_eq!((check.name, check.verdict), ("lines", verdict));
            assert!(check.found.contains("pinctrl-rp1"), "{}", check.found);
            assert_eq!(
                check.remedy.contains("strict_gpiod"),
                verdict == Verdict::Fail
            );
        }
        // Another computer, and no lines at all.
        let empty = tempfile::tempdir().unwrap();
        let host = Host::at(empty.path());
        assert_eq!(examine(&host, &lines, None)[0].verdict, Verdict::Pass);
        let unused = TriggerSetup::default();
        assert!(examine(&host, &LinesSetup::default(), Some(&unused)).is_empty());
    }
}
