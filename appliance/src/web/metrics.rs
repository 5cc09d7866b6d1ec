//! `/metrics`: the station in numbers, as OpenMetrics text.

use std::fmt::Write as _;

use axum::extract::State;
use axum::http::header;
use axum::response::IntoResponse;

use super::site::Site;
use crate::station::snapshot::status;

const KIND: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

pub(super) async fn metrics(State(site): State<Site>) -> impl IntoResponse {
    ([(header::CONTENT_TYPE, KIND)], text(&site))
}

/// The text: families one after the other, each with its type and what it means.
pub(super) fn text(site: &Site) -> String {
    let now = site.station.snapshot();
    let mut out = Text(String::new());
    let truth = |yes: bool| f64::from(u8::from(yes));
    let identity = &now.identity;
    out.family("fringed_build", "info", "This device.");
    let labels = [
        ("version", &*identity.version),
        ("serial", &*identity.serial),
    ];
    out.sample("fringed_build_info", &labels, 1.0);
    for (name, value, meaning) in [
        (
            "fringed_ready",
            truth(now.is(status::READY)),
            "1 if a trigger would be accepted.",
        ),
        (
            "fringed_fault",
            truth(now.fault.is_some()),
            "1 while there is a fault.",
        ),
        (
            "fringed_measuring_task_alive",
            truth(now.worker_alive),
            "1 while the measuring task meets its deadlines.",
        ),
        ("fringed_state", f64::from(now.state), "Register 104."),
        (
            "fringed_error_code",
            f64::from(now.error_code),
            "Register 102.",
        ),
        (
            "fringed_reject_reason",
            f64::from(now.reject_reason),
            "Register 120: why the last rejected request was rejected.",
        ),
        (
            "fringed_buffered_results",
            f64::from(now.buffered),
            "Results that wait for RESULT_ACK.",
        ),
        (
            "fringed_uptime_seconds",
            f64::from(now.uptime_s),
            "Time since the start.",
        ),
    ] {
        out.family(name, "gauge", meaning);
        out.sample(name, &[], value);
    }
    let counts = site.tally.counts();
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
    for (name, value, meaning) in [
        (
            "fringed_triggers",
            now.triggers,
            "Accepted triggers since the start.",
        ),
        (
            "fringed_missed_triggers",
            now.missed,
            "Rejected triggers since the start.",
        ),
    ] {
        out.family(name, "counter", meaning);
        out.sample(&format!("{name}_total"), &[], f64::from(value));
    }
    let Some(result) = now.result.as_deref() else {
        return out.end();
    };
    let found = &result.inspection;
    out.family("fringed_cycle_seconds", "gauge", "Times of the last cycle.");
    for (part, us) in [("exposure", result.exposure_us), ("total", result.total_us)] {
        out.sample(
            "fringed_cycle_seconds",
            &[("part", part)],
            f64::from(us) / 1e6,
        );
    }
    out.family(
        "fringed_stage_seconds",
        "gauge",
        "Wall times of the last cycle's stages.",
    );
    for time in result.stages().iter() {
        out.sample(
            "fringed_stage_seconds",
            &[("stage", time.stage.name())],
            f64::from(time.us) / 1e6,
        );
    }
    out.family(
        "fringed_processing_cpu_seconds",
        "gauge",
        "Processor time of the last cycle's processing on all computing threads.",
    );
    out.sample(
        "fringed_processing_cpu_seconds",
        &[],
        f64::from(found.cpu_us) / 1e6,
    );
    out.family(
        "fringed_coverage_ratio",
        "gauge",
        "Share of the regions that the last cycle resolved.",
    );
    out.sample(
        "fringed_coverage_ratio",
        &[],
        f64::from(found.coverage_permille) / 1e3,
    );
    out.family(
        "fringed_pattern_fitness_ratio",
        "gauge",
        "1 = the pattern fits the part as taught.",
    );
    out.sample(
        "fringed_pattern_fitness_ratio",
        &[],
        f64::from(found.fitness_permille) / 1e3,
    );
    out.family(
        "fringed_height_noise_meters",
        "gauge",
        "Height noise of the last cycle, 1 sigma.",
    );
    out.sample(
        "fringed_height_noise_meters",
        &[],
        found.height_noise_mm / 1e3,
    );
    out.family(
        "fringed_gauge",
        "gauge",
        "Values of the last cycle in the unit of the label; NaN if not measured.",
    );
    for gauge in &found.gauges {
        let value = gauge.value.filter(|_| gauge.decision.valid);
        let labels = [("gauge", &*gauge.name), ("unit", gauge.unit.symbol())];
        out.sample("fringed_gauge", &labels, value.unwrap_or(f64::NAN));
    }
    out.end()
}

struct Text(String);

impl Text {
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
