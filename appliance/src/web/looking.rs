//! Scenes of the page to look at: `cargo test -p appliance looking -- --ignored` serves one per port until it is ended.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::*;
use crate::station::result::flag;
use crate::station::*;

const FIRST_PORT: u16 = 18_081;

/// One scene for each port: what happened before one looks.
const SCENES: [fn(&StationHandle); 8] = [
    |handle| measured(handle, 0.0),
    |handle| measured(handle, 0.35),
    |handle| measured(handle, f64::NAN),
    |handle| ready(handle),
    |handle| {
        measured(handle, 0.0);
        trigger(handle, 78);
    },
    |handle| {
        measured(handle, 0.0);
        handle.event(Event::Faulted {
            error_code: 101,
            cause: "the camera did not answer for 2000 ms while 12 frames were expected".into(),
            remedy:
                "check the camera's cable; the station recovers by itself when the camera is back"
                    .into(),
        });
    },
    |handle| {
        ready(handle);
        handle.event(Event::Request(Request::Teach { number: 12 }));
        let words = "level 2 of 3: averaging 16 sequences".into();
        handle.event(Event::Progress {
            job: JobId(2),
            fraction: 0.42,
            words,
        });
    },
    |handle| measured(handle, 0.0),
];

fn ready(handle: &StationHandle) {
    handle.event(Event::Started);
    handle.event(Event::Request(Request::Load(RecipeKey::Number(12))));
    let recipe = ActiveRecipe {
        number: 12,
        crc: 0x9F3C_21D8,
        name: "seat bracket, left".into(),
    };
    handle.event(Event::RecipeLoaded {
        job: JobId(1),
        recipe,
    });
    handle.event(Event::Condition(Condition {
        calibration_valid: true,
        ..Default::default()
    }));
}

fn trigger(handle: &StationHandle, part: u32) {
    let write = ControlWrite {
        token: Some(u16::try_from(part).unwrap()),
        part_id: Masked::<u32>::all(part),
        press_stroke: Masked::<u32>::all(20_417),
        ..Default::default()
    };
    handle
        .write(&mut ConnectionEdges::default(), write)
        .unwrap();
}

fn measured(handle: &StationHandle, dent_mm: f64) {
    ready(handle);
    trigger(handle, 77);
    let limit = |low, high| (Some(low), Some(high));
    let gauges = [
        GaugeValue::judged(
            "dome height",
            Unit::Length,
            Some(4.9873 + dent_mm).filter(|v| v.is_finite()),
            Some(0.0021),
            limit(4.9, 5.1),
        ),
        GaugeValue::judged(
            "deviation RMS",
            Unit::Length,
            Some(0.0187 + dent_mm.abs() / 9.0).filter(|v| v.is_finite()),
            Some(0.0008),
            (None, Some(0.05)),
        ),
        GaugeValue::judged(
            "flange angle",
            Unit::Angle,
            Some(0.243),
            Some(0.004),
            limit(-0.25, 0.25),
        ),
        GaugeValue::judged(
            "coverage",
            Unit::Share,
            Some(0.9871),
            Some(0.0005),
            (Some(0.95), None),
        ),
        GaugeValue::judged(
            "bead volume",
            Unit::Volume,
            Some(41.37),
            Some(0.2),
            limit(38.0, 45.0),
        ),
    ];
    let stages = [
        ("expose", 182_000),
        ("demodulate", 21_400),
        ("unwrap", 9_800),
        ("triangulate", 17_300),
        ("gauges", 6_100),
    ];
    let invalid = dent_mm.is_nan();
    let inspection = Inspection {
        judged: if invalid { Verdict::Invalid } else { Verdict::Pass },
        reason: invalid.then(|| "2 of 5 gauges could not be measured: coverage of region \"dome\" is 61 %, 90 % are needed".into()),
        gauges: gauges.into_iter().collect(),
        valid_points: 231_874,
        coverage_permille: if invalid { 871 } else { 987 },
        temperature_c: Some(31.4),
        height_noise_mm: 0.012,
        fitness_permille: 994,
        flags: flag::SIMULATED | flag::FULL_SEQUENCE,
        stages: stages.into_iter().map(|(name, us)| StageTime { name, us }).collect(),
        ..Default::default()
    };
    let job = JobId(2);
    handle.event(Event::ExposureDone { job });
    handle.event(Event::Finished {
        job,
        inspection: Arc::new(inspection),
    });
}

/// A smooth colourful hill with a scale at its side.
fn picture() -> Option<Vec<u8>> {
    let (width, height) = (560_u32, 420_u32);
    let mut pixels = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let (u, v) = (f64::from(x) / 520.0 - 0.5, f64::from(y) / 420.0 - 0.5);
            let inside = u.abs() < 0.42 && v.abs() < 0.4 && (u - 0.25).hypot(v + 0.2) > 0.06;
            let h = if x >= 530 {
                0.5 - v
            } else {
                (-(u * u + v * v) * 9.0).exp()
            };
            let shade =
                |centre: f64| ((1.0 - (h - centre).abs() * 2.2).clamp(0.0, 1.0) * 255.0) as u8;
            pixels.extend(if inside || x >= 530 {
                [shade(0.85), shade(0.5), shade(0.15)]
            } else {
                [24, 28, 32]
            });
        }
    }
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder
        .write_header()
        .ok()?
        .write_image_data(&pixels)
        .ok()?;
    Some(png)
}

#[tokio::test]
#[ignore = "serves until it is ended: for looking at the page"]
async fn serve_one_scene_per_port() {
    for (scene, prepare) in SCENES.into_iter().enumerate() {
        let identity = Identity {
            vendor: "fringed".into(),
            product: "fringe projection sensor".into(),
            serial: "SN-0001".into(),
            version: "0.1.0".into(),
        };
        let limits = Limits {
            acquiring: Micros::from_millis(9_000_000),
            ..Limits::default()
        };
        let settings = Settings {
            next_seq: 1041,
            boot_id: 7,
            teach_allowed: false,
            identity: Arc::new(identity),
            limits,
        };
        let handle =
            StationHandle::new(Station::new(settings, Micros(0)), Instant::now(), |_| None);
        handle.event(Event::Tick {
            utc_us: system_utc_us(),
        });
        prepare(&handle);
        tokio::spawn(tick(handle.clone(), system_utc_us, std::future::pending()));
        let hangs = scene == 7;
        let alive = handle.clone();
        let beats = async move {
            let mut interval = tokio::time::interval(Duration::from_millis(200));
            loop {
                interval.tick().await;
                alive.event(Event::Alive);
            }
        };
        if !hangs {
            tokio::spawn(beats);
        }
        let port = FIRST_PORT + u16::try_from(scene).unwrap();
        let listener = bind(([127, 0, 0, 1], port).into()).await.unwrap();
        tokio::spawn(serve(
            listener,
            Site::new(handle, Arc::new(picture), Vec::new()),
            std::future::pending(),
        ));
    }
    std::future::pending::<()>().await;
}
