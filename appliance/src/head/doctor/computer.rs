//! The doctor's checks that need no pictures: of the computer (lines whose program ends, power,
//! versions, the sensor's mode) and of the projector's controller.

use super::{Check, named};
use crate::station::{HOT_PROJECTOR_C, Power};
use crate::system::computing::Prompt;
use crate::system::host::{Host, major_minor};
use hal::projector::{ControllerState, fault, processing};
use hal::setup::{LinesSetup, TriggerSetup};
use serde_json::json;

/// The oldest kernel: since 5.7 edges of lines are stamped on the clock of the head
/// (`CLOCK_MONOTONIC`).
const OLDEST_KERNEL: [u16; 2] = [5, 7];
/// The versions of libcamera that the bindings know.
const LIBCAMERA: [[u16; 2]; 2] = [[0, 4], [0, 7]];

/// Checks a computer with these lines; `trigger` is that of a real head, `prompt` what the thread
/// gets that ends its pulses. There are only checks of what is used and known.
pub fn examine(
    host: &Host,
    lines: &LinesSetup,
    trigger: Option<&TriggerSetup>,
    prompt: Prompt,
) -> Vec<Check> {
    let power = host.throttled().map(|bits| power(Power::of(bits, None)));
    let versions = trigger.map(|_| versions(host));
    let sensor = trigger.zip(host.sensor_waits_for_triggers());
    let sensor = sensor.map(|(trigger, waits)| sensor_mode(waits, trigger.wired()));
    let trigger = trigger.filter(|trigger| trigger.line.is_some());
    let pulses = trigger.map(|_| pulses(prompt));
    let outputs = [&lines.busy, &lines.ok, &lines.fault];
    let press = outputs.into_iter().any(Option::is_some);
    let chips = [
        trigger.map(|trigger| &*trigger.chip),
        press.then_some(&*lines.chip),
    ];
    let mut chips: Vec<&str> = chips.into_iter().flatten().collect();
    chips.dedup();
    let released = (!chips.is_empty()).then(|| released(host, &chips));
    let checks = [
        ("lines", released),
        ("pulses", pulses),
        ("power", power),
        ("versions", versions),
        ("sensor", sensor),
    ];
    let checks = checks.into_iter();
    checks
        .filter_map(|(name, check)| Some(named(name, check?)))
        .collect()
}

/// The thread that ends the pulses of the trigger: the exposure lasts as long as a pulse, and
/// decoding uses every other core.
fn pulses(prompt: Prompt) -> Check {
    let Prompt { real_time, core } = prompt;
    let found = format!(
        "the thread that ends the pulses of the trigger gets {} and {}",
        match real_time {
            true => "a real-time priority",
            false => "no real-time priority",
        },
        core.map_or("no core of its own".into(), |core| format!(
            "core {core} for itself"
        ))
    );
    let remedy = match (real_time, core) {
        (false, _) => Some(
            "permit it: LimitRTPRIO=20 in the service, \"fringed - rtprio 20\" in /etc/security/limits.d/fringed.conf for programs that are \
             started by hand; or let the projector's trigger output start the exposures (head.trigger.by_projector)",
        ),
        (true, None) => Some(
            "add isolcpus=3 to /boot/firmware/cmdline.txt and restart the computer; or let the projector's trigger output start the \
             exposures (head.trigger.by_projector)",
        ),
        (true, Some(_)) => None,
    };
    Check::new(
        found,
        remedy,
        json!({ "real_time": real_time, "core": core }),
    )
}

/// A Raspberry Pi's supply and cooling: a computer that slows itself down ends pulses late, and one
/// without voltage loses its card.
fn power(power: Power) -> Check {
    let (now, since) = (power.now(), power.since_start());
    let words = |conditions: &[&str]| match conditions {
        [] => "nothing".to_owned(),
        conditions => conditions.join(", "),
    };
    let found = format!(
        "the firmware reports {}; since the computer's start {}",
        words(&now),
        words(&since)
    );
    let weak = since.contains(&"under-voltage");
    let remedy = if weak {
        Some(
            "use the supply that is made for this model (5.1 V, 5 A for a Raspberry Pi 5) and a short, thick cable",
        )
    } else if !now.is_empty() {
        Some("cool the computer: it slows itself down")
    } else {
        None
    };
    Check::new(found, remedy, json!({ "now": now, "since_start": since }))
}

/// The kernel and libcamera.
fn versions(host: &Host) -> Check {
    let (kernel, libcamera) = (host.kernel(), host.libcamera());
    let shown = |version: &Option<String>| version.clone().unwrap_or_else(|| "not known".into());
    let found = format!("kernel {}, libcamera {}", shown(&kernel), shown(&libcamera));
    let parsed = |version: &Option<String>| major_minor(version.as_deref()?);
    let [oldest, newest] = LIBCAMERA;
    let remedy = if parsed(&kernel).is_some_and(|is| is < OLDEST_KERNEL) {
        Some("use a kernel of 5.7 or newer: older ones stamp the edges of lines on another clock")
    } else if parsed(&libcamera).is_some_and(|is| !(oldest..=newest).contains(&is)) {
        Some("install libcamera 0.4 to 0.7, for which this program is built")
    } else {
        None
    };
    Check::new(
        found,
        remedy,
        json!({ "kernel": kernel, "libcamera": libcamera }),
    )
}

/// Whether the driver of the IMX296 is in the mode that the configuration says.
fn sensor_mode(waits: bool, triggered: bool) -> Check {
    let found = format!(
        "the driver imx296 {} triggers, and {} is configured",
        if waits { "waits for" } else { "takes no" },
        if triggered { "a trigger" } else { "none" }
    );
    let remedy = match (waits, triggered) {
        (false, true) => Some(
            "write \"options imx296 trigger_mode=1\" to /etc/modprobe.d/imx296.conf and restart the computer: without it the camera runs by itself",
        ),
        (true, false) => Some(
            "name head.trigger.line, or set head.trigger.by_projector if the projector triggers the camera, or remove trigger_mode=1 from /etc/modprobe.d/imx296.conf and restart the computer: without triggers there are no frames",
        ),
        _ => None,
    };
    Check::new(
        found,
        remedy,
        json!({ "trigger_mode": waits, "triggered": triggered }),
    )
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

/// Checks what a controller said of itself.
pub fn controller(state: &ControllerState) -> Check {
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
    use crate::head::doctor::CheckVerdict;
    use crate::system::host::tests::root;

    const ALL: Prompt = Prompt {
        real_time: true,
        core: Some(3),
    };
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
        for (parameter, verdict) in [("Y\n", CheckVerdict::Fail), ("N\n", CheckVerdict::Pass)] {
            let root = root(&[(PARAMETER, parameter)]);
            let checks = examine(&Host::at(root.path()), &lines, Some(&trigger), ALL);
            let check = &checks[0];
            assert_eq!((check.name, check.verdict), ("lines", verdict));
            assert!(check.found.contains("pinctrl-rp1"), "{}", check.found);
            assert_eq!(
                check.remedy.contains("strict_gpiod"),
                verdict == CheckVerdict::Fail
            );
        }
        // Another computer, and no lines at all.
        let empty = tempfile::tempdir().unwrap();
        let host = Host::at(empty.path());
        assert_eq!(
            examine(&host, &lines, None, ALL)[0].verdict,
            CheckVerdict::Pass
        );
        assert!(examine(&host, &LinesSetup::default(), None, ALL).is_empty());
    }

    /// The checks of a real head, with a line for its trigger or none, that fail.
    fn failed(files: &[(&str, &str)], line: Option<&str>) -> Vec<Check> {
        let root = root(files);
        let trigger = TriggerSetup {
            line: line.map(ToOwned::to_owned),
            ..TriggerSetup::default()
        };
        let lines = LinesSetup::default();
        let mut checks = examine(&Host::at(root.path()), &lines, Some(&trigger), ALL);
        checks.retain(|check| check.verdict == CheckVerdict::Fail);
        checks
    }

    #[test]
    fn power_versions_and_the_sensors_mode_are_named_when_they_are_wrong() {
        let throttled = "sys/devices/platform/soc/soc:firmware/get_throttled";
        let maps = "proc/self/maps";
        let release = "proc/sys/kernel/osrelease";
        let mode = "sys/module/imx296/parameters/trigger_mode";
        let well = [
            (throttled, "20000"),
            (maps, "7f01 r-xp 0 0 2 /usr/lib/libcamera.so.0.7.0"),
            (release, "6.12.34+rpt-rpi-2712"),
            (mode, "1"),
        ];
        assert_eq!(failed(&well, Some("GPIO17")).len(), 0);
        assert_eq!(failed(&[], Some("GPIO17")).len(), 0, "nothing is known");
        for (file, text, name, word) in [
            (throttled, "50005", "power", "supply"),
            (throttled, "10000", "power", "supply"),
            (throttled, "2", "power", "cool"),
            (
                maps,
                "a /usr/lib/libcamera.so.0.3.2",
                "versions",
                "0.4 to 0.7",
            ),
            (
                maps,
                "a /usr/lib/libcamera.so.0.8",
                "versions",
                "0.4 to 0.7",
            ),
            (release, "5.4.0", "versions", "5.7"),
            (mode, "0", "sensor", "trigger_mode=1"),
        ] {
            let files = well.map(|(path, said)| (path, if path == file { text } else { said }));
            let failed = failed(&files, Some("GPIO17"));
            let [check] = &failed[..] else {
                panic!("{file} {text}: {failed:?}");
            };
            assert_eq!(check.name, name);
            assert!(check.remedy.contains(word), "{}", check.remedy);
        }
        let runs_by_itself = failed(&well, None);
        assert_eq!(runs_by_itself[0].name, "sensor");
    }

    #[test]
    fn pulses_that_ordinary_work_may_delay_are_named_with_what_the_thread_lacks() {
        for (real_time, core, word) in [
            (false, None, "LimitRTPRIO"),
            (false, Some(3), "LimitRTPRIO"),
            (true, None, "isolcpus"),
        ] {
            let check = pulses(Prompt { real_time, core });
            assert_eq!(check.verdict, CheckVerdict::Fail);
            assert!(check.remedy.contains(word), "{}", check.remedy);
            assert!(check.remedy.contains("by_projector"));
        }
        assert_eq!(pulses(ALL).verdict, CheckVerdict::Pass);
    }

    #[test]
    fn what_is_wrong_with_a_controller_is_named_with_its_remedy() {
        let well = ControllerState {
            device: "DLPC3478",
            temperature_c: Some(41.2),
            led_current: 600,
            ..ControllerState::default()
        };
        let check = controller(&well);
        assert_eq!(
            (check.name, check.verdict),
            ("controller", CheckVerdict::Pass)
        );
        assert!(check.found.contains("41.2 °C"), "{}", check.found);
        let unknown = ControllerState {
            temperature_c: None,
            ..well.clone()
        };
        assert_eq!(controller(&unknown).verdict, CheckVerdict::Pass);
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
            let check = controller(&state);
            assert_eq!(check.verdict, CheckVerdict::Fail);
            assert!(check.found.contains(found), "{}", check.found);
            assert!(check.remedy.contains(remedy), "{}", check.remedy);
        }
    }
}
