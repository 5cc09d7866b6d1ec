//! `/metrics`: counters and values of the station, as OpenMetrics text.

use std::fmt::Write as _;
use std::sync::atomic::Ordering::Relaxed;

use axum::http::header;
use axum::response::IntoResponse;

use super::site::Site;
use crate::station::snapshot::{status, warning};
use crate::station::{Health, Power, ResultRecord};

const KIND: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

pub(super) async fn metrics(site: Site) -> impl IntoResponse {
    ([(header::CONTENT_TYPE, KIND)], text(&site))
}

/// The text: one family of samples after the other, each with its type and meaning.
pub(super) fn text(site: &Site) -> String {
    let now = site.station.snapshot();
    let mut out = Exposition(String::new());
    let truth = |yes: bool| f64::from(u8::from(yes));
    let identity = &now.identity;
    out.family("fringed_build", "info", "This device.");
    let labels = [
        ("version", &*identity.version),
        ("serial", &*identity.serial),
    ];
    out.sample("fringed_build_info", &labels, 1.0);
    let ready = truth(now.is(status::READY));
    out.gauge("fringed_ready", ready, "1 if a trigger would be accepted.");
    let fault = truth(now.fault.is_some());
    out.gauge("fringed_fault", fault, "1 while there is a fault.");
    out.gauge(
        "fringed_measuring_task_alive",
        truth(now.worker_alive),
        "1 while the measuring task meets its deadlines.",
    );
    out.gauge("fringed_state", now.state, "Register 104.");
    out.gauge("fringed_error_code", now.error_code, "Register 102.");
    out.gauge(
        "fringed_reject_reason",
        now.reject_reason,
        "Register 120: why the last rejected request was rejected.",
    );
    out.gauge(
        "fringed_buffered_results",
        now.buffered,
        "Results that wait for RESULT_ACK.",
    );
    out.gauge(
        "fringed_uptime_seconds",
        now.uptime_s,
        "Time since the start.",
    );
    let asked_s = site.collected_at_s.load(Relaxed);
    out.gauge(
        "fringed_results_unasked_seconds",
        now.uptime_s.saturating_sub(asked_s),
        "Time since a program asked for results, or since the start.",
    );
    let name = "fringed_warning";
    out.family(
        name,
        "gauge",
        "1 for each warning that is on: bits of register 103.",
    );
    for (bit, warning) in warning::NAMES.iter().enumerate() {
        let is_on = truth(now.warnings >> bit & 1 != 0);
        out.sample(name, &[("warning", &*warning.to_lowercase())], is_on);
    }
    out.health(&now.health);
    out.wear(&now.health);
    let counts = now.counts;
    out.family(
        "fringed_results",
        "counter",
        "Results since the start, by verdict.",
    );
    for (verdict, count) in [
        ("PASS", counts.pass),
        ("FAIL", counts.fail),
        ("INVALID", counts.invalid),
    ] {
        out.sample(
            "fringed_results_total",
            &[("verdict", verdict)],
            count as f64,
        );
    }
    out.counter(
        "fringed_triggers",
        now.triggers,
        "Accepted triggers since the start.",
    );
    out.counter(
        "fringed_missed_triggers",
        now.missed,
        "Rejected triggers since the start.",
    );
    if let Some(result) = now.result.as_deref() {
        out.result(result);
    }
    out.end()
}

struct Exposition(String);

impl Exposition {
    /// Temperatures, power and the projector's controller; what is not known is left out.
    fn health(&mut self, health: &Health) {
        let (system, projector) = (&health.system, &health.projector);
        let name = "fringed_temperature_celsius";
        self.family(name, "gauge", "Temperatures by part.");
        for (part, celsius) in [
            ("processor", system.cpu_temperature_c),
            ("camera", health.camera_temperature_c),
            ("projector", projector.temperature_c),
        ] {
            if let Some(celsius) = celsius {
                self.sample(name, &[("part", part)], celsius);
            }
        }
        for (name, value, meaning) in [
            (
                "fringed_power",
                system.power.map(Power::bits),
                "Register 630: under-voltage and throttling.",
            ),
            (
                "fringed_projector_fault",
                projector.faults,
                "Register 631: faults of the projector's controller.",
            ),
            (
                "fringed_led_current_steps",
                projector.led_current,
                "Current of the projector's LED, steps of its driver.",
            ),
        ] {
            if let Some(value) = value {
                self.gauge(name, value, meaning);
            }
        }
        if let Some(drift) = health.drift {
            let meaning = "Distance of projector points from their epipolar lines at the last check, RMS, projector pixels.";
            self.gauge("fringed_drift_pixels", drift.rms_px, meaning);
        }
    }

    /// What fills up, gets lost or is started again.
    fn wear(&mut self, health: &Health) {
        let (system, pace) = (&health.system, &health.pace);
        const MIB: u64 = 1 << 20;
        for (name, mib, meaning) in [
            (
                "fringed_free_storage_bytes",
                system.free_storage_mib,
                "Room in the state folder.",
            ),
            (
                "fringed_free_memory_bytes",
                system.free_memory_mib,
                "Memory that a program could still get.",
            ),
        ] {
            if let Some(mib) = mib {
                self.gauge(name, (mib * MIB) as f64, meaning);
            }
        }
        for (name, count, meaning) in [
            (
                "fringed_starts",
                system.boots,
                "Starts with this state folder.",
            ),
            (
                "fringed_unclean_starts",
                system.unclean_boots,
                "Starts after a crash, a kill or a loss of power.",
            ),
            (
                "fringed_dropped_frames",
                pace.dropped,
                "Frames that the camera did not deliver, since the start.",
            ),
            (
                "fringed_missed_flips",
                pace.missed_flips,
                "Refreshes that the projector missed, since the start.",
            ),
            (
                "fringed_storage_errors",
                health.storage_errors,
                "Writes that failed, since the start.",
            ),
        ] {
            self.counter(name, count, meaning);
        }
    }

    /// The metrics of the last cycle.
    fn result(&mut self, result: &ResultRecord) {
        let seconds = |us: u32| f64::from(us) / 1e6;
        let share = |permille: u16| f64::from(permille) / 1e3;
        let found = &result.inspection;
        let name = "fringed_cycle_seconds";
        self.family(name, "gauge", "Times of the last cycle.");
        self.sample(name, &[("part", "exposure")], seconds(result.exposure_us));
        self.sample(name, &[("part", "total")], seconds(result.total_us));
        let name = "fringed_stage_seconds";
        self.family(name, "gauge", "Wall times of the last cycle's stages.");
        for time in result.stages().iter() {
            self.sample(name, &[("stage", time.stage.name())], seconds(time.us));
        }
        self.gauge(
            "fringed_processing_cpu_seconds",
            seconds(found.cpu_us),
            "Processor time of the last cycle's processing on all computing threads.",
        );
        self.gauge(
            "fringed_coverage_ratio",
            share(found.coverage_permille),
            "Coverage of the last cycle: share of the surface compared with golden that is resolved.",
        );
        self.gauge(
            "fringed_pattern_fitness_ratio",
            share(found.fitness_permille),
            "1 = the pattern fits the part as taught.",
        );
        self.gauge(
            "fringed_height_noise_meters",
            found.height_noise_mm / 1e3,
            "Height noise of the last cycle, 1 sigma.",
        );
        let name = "fringed_gauge";
        let meaning = "Values of the last cycle in the unit of the label; NaN if not measured.";
        self.family(name, "gauge", meaning);
        for gauge in &found.gauges {
            let value = gauge.value.filter(|_| gauge.decision.valid);
            let slot = gauge.slot.to_string();
            let unit = gauge.unit.symbol();
            let labels = [("gauge", &*gauge.name), ("unit", unit), ("slot", &slot)];
            self.sample(name, &labels, value.unwrap_or(f64::NAN));
        }
    }

    /// A family of one gauge without labels.
    fn gauge(&mut self, name: &str, value: impl Into<f64>, meaning: &str) {
        self.family(name, "gauge", meaning);
        self.sample(name, &[], value.into());
    }

    /// A family of one counter without labels.
    fn counter(&mut self, name: &str, count: u32, meaning: &str) {
        self.family(name, "counter", meaning);
        self.sample(&format!("{name}_total"), &[], f64::from(count));
    }

    fn family(&mut self, name: &str, kind: &str, meaning: &str) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.0, "# TYPE {name} {kind}\n# HELP {name} {meaning}");
    }

    fn sample(&mut self, name: &str, labels: &[(&str, &str)], value: f64) {
        let escaped = |text: &str| {
            text.replace('\\', "\\\\")
                .replace('"', "\\\"")
                .replace('\n', "\\n")
        };
        let labels: Vec<String> = labels
            .iter()
            .map(|(label, text)| format!("{label}=\"{}\"", escaped(text)))
            .collect();
        let labels = match labels.is_empty() {
            true => String::new(),
            false => format!("{{{}}}", labels.join(",")),
        };
        let _ = writeln!(self.0, "{name}{labels} {value}");
    }

    fn end(mut self) -> String {
        self.0.push_str("# EOF\n");
        self.0
    }
}
