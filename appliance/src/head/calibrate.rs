//! Measures a calibration: time stamps, pace, light, flip-to-light delay, grey response, noise, contrast and reference plane, in this order, since
//! each measurement uses the results of those before it.

use super::calibration::Calibration;
use super::calibration::file::{
    CalibrationFile, CameraFile, FORMAT, LevelFile, MapFile, NoiseFile, ProjectorFile,
    ReferenceFile, TimingFile, VERSION, inverted,
};
use super::calibration::geometry::GeometryFile;
use super::calibration::place::Place;
use super::examine::{
    Delay, LEAST_BRIGHT, LEAST_LIT, Lit, MOST_BY_CONTENT, MOST_SATURATED, PLATE_PITCH, SETTLE,
    Spaced, Stamps, by_content, contrast, noise, pace, plate, response,
};
use super::seam;
use crate::error::{Exit, Failure};
use algo::geometry::Vector;
use algo::pipeline::Plate;
use hal::head::{Head, Timing};
use std::time::Duration;

/// Most rounds of the delay: 100 s, where stamps jitter or the camera has few pixels.
const ROUNDS: u32 = 24;
/// A measured delay below this is refused: light does not come before its flip.
const LEAST_DELAY_S: f64 = -200e-6;
/// Refreshes that light gets to settle beyond its delay.
const BEYOND: u32 = 2;
/// Longest wait for a flip or a frame beyond the plan.
const TIMEOUT: Duration = Duration::from_secs(5);
/// Largest RMS distance of the models from the measured plane, projector pixels: a millimetre of height, with devices 27° apart
/// 600 mm away.
const MOST_OFF_PX: f64 = 2.0;
/// A response that differs from the previous one by less than this many levels replaces nothing, so recipes stay valid.
const SAME_RESPONSE: f64 = 1.0;

/// What a calibration starts from.
#[derive(Debug)]
pub struct Basis {
    /// Sizes and models; noise and response are measured.
    pub calibration: Calibration,
    /// Where the models come from.
    pub models_from: String,
    /// The response of the previous calibration.
    pub response: Option<Vec<f64>>,
    /// How the models were made, where they come from poses of a board.
    pub geometry: Option<GeometryFile>,
    /// Temperature of the head.
    pub temperature_c: Option<f64>,
    /// Whether a flat plate lies in the plane z = 0.
    pub plate: bool,
}

/// A calibration, ready to be written.
#[derive(Debug)]
pub struct Made {
    /// The file.
    pub file: CalibrationFile,
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// Names and bytes of the reference phase maps.
    pub maps: Vec<(String, Vec<u8>)>,
    /// Remarks for the user.
    pub notes: Vec<String>,
}

/// A scene in front of the head, or settings of the head, that do not allow a calibration.
fn scene(words: impl Into<String>) -> Failure {
    Failure::new(Exit::Unavailable, words)
}

/// Models that are those of another head.
fn models(words: impl Into<String>) -> Failure {
    Failure::new(Exit::Content, words)
}

/// Measures a calibration. `progress` gets the share done and what is measured next. Afterwards the head's timing is the calibrated one.
///
/// # Errors
/// Of a device; if too little light comes back, or too much, or there is no flat plate (69); if the models do not fit it (65).
pub fn make(head: &mut Head, basis: Basis, progress: &dyn Fn(f64, &str)) -> Result<Made, Failure> {
    let mut calibration = basis.calibration;
    let mut notes = Vec::new();
    progress(0.0, "camera stamps");
    let stamps = Stamps::measure(head)?;
    head.set_timing(Timing {
        flip_to_light: Duration::ZERO,
        ..stamps.timing(head.timing())
    });
    progress(0.02, "pace of the camera");
    let pace = proven(&pace(head)?, &mut notes);
    head.set_timing(Timing {
        hold: pace.unwrap_or(head.timing().hold),
        ..head.timing()
    });
    progress(0.05, "light");
    let lit = Lit::take(head, SETTLE)?;
    bright_enough(&lit)?;
    progress(0.1, "flip-to-light delay");
    let delay = Delay::measure(head, &lit, ROUNDS)?
        .filter(|delay| delay.seconds >= LEAST_DELAY_S)
        .ok_or_else(|| {
            scene("measure the flip-to-light delay: light does not follow the flips: `fringed doctor` says more")
        })?;
    head.set_timing(Timing {
        flip_to_light: delay.duration(),
        ..head.timing()
    });
    let refreshes = delay
        .duration()
        .as_nanos()
        .div_ceil(head.refresh().as_nanos().max(1));
    let settle = u32::try_from(refreshes).unwrap_or(SETTLE) + BEYOND;
    progress(0.18, "light by content");
    alike(by_content(head, settle, &lit)?)?;
    let share = |share: f64| progress(0.2 + 0.4 * share, "grey response");
    let mut greys = response(head, settle, &lit, &share)?.to_vec();
    if let Some(before) = basis.response.filter(|before| same(before, &greys)) {
        notes.push(
            "the grey response equals the previous one within noise: that one is kept, and recipes stay valid"
                .into(),
        );
        greys = before;
    }
    calibration.response = inverted(&greys).map_err(scene)?;
    progress(0.6, "noise");
    let noise = noise(head, settle, &lit)?;
    calibration.noise_counts = noise.counts;
    progress(0.65, "contrast");
    let contrast = contrast(head, &calibration, settle, &lit)?;
    let mut maps = Vec::new();
    let reference = if basis.plate {
        progress(0.75, "reference plane, vertical fringes");
        let vertical = plate(head, &calibration, true, TIMEOUT)?;
        progress(0.88, "reference plane, horizontal fringes");
        let horizontal = plate(head, &calibration, false, TIMEOUT)?;
        Some(reference(&calibration, &vertical, &horizontal, &mut maps)?)
    } else {
        notes.push("no plate was measured: the reference plane is that of the models".into());
        None
    };
    progress(1.0, "calibrated");
    let (width, height, bit_depth) = calibration.frames();
    let (columns, rows) = calibration.raster();
    let file = CalibrationFile {
        format: FORMAT.into(),
        version: VERSION,
        fingerprint: String::new(),
        checksum: String::new(),
        made_by: concat!("fringed ", env!("CARGO_PKG_VERSION")).into(),
        made_at_unix_s: crate::system::clock::utc_us().unwrap_or(0) / 1_000_000,
        temperature_c: basis.temperature_c,
        models_from: basis.models_from,
        camera: CameraFile {
            width,
            height,
            bit_depth,
            model: seam::device_model(&calibration.camera),
        },
        projector: ProjectorFile {
            width: columns,
            height: rows,
            model: seam::device_model(&calibration.projector),
        },
        timing: Some(TimingFile {
            flip_to_light_ns: nanoseconds(delay.duration()),
            sigma_ns: (delay.error * 1e9).ceil() as u64,
            stamp: stamps.stamp,
            stamp_late_ns: stamps.late.map(nanoseconds),
            readout_ns: nanoseconds(stamps.readout),
            refreshes: pace,
        }),
        noise: Some(NoiseFile {
            counts: noise.counts,
            read_counts: noise.read_counts,
            shot: noise.shot,
            levels: noise
                .points
                .iter()
                .map(|point| LevelFile {
                    level: point.level,
                    counts: point.counts,
                })
                .collect(),
        }),
        response: Some(greys),
        contrast: Some(contrast),
        reference,
        geometry: basis.geometry,
    };
    let (file, bytes) = file.sealed().map_err(scene)?;
    Ok(Made {
        file,
        bytes,
        maps,
        notes,
    })
}

/// The refreshes per pattern at which no trigger is lost, if there are any; otherwise patterns are shown as long as before.
fn proven(tried: &[Spaced], notes: &mut Vec<String>) -> Option<u32> {
    let last = tried.last()?;
    if last.none_lost() {
        return Some(last.refreshes);
    }
    notes.push(format!(
        "triggers are lost however far apart they are ({}), so the pace of the camera is not known: check the wire of the trigger, then calibrate anew",
        last.words()
    ));
    None
}

fn nanoseconds(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

fn same(before: &[f64], now: &[f64]) -> bool {
    let near = |(a, b): (&f64, &f64)| (a - b).abs() < SAME_RESPONSE;
    before.len() == now.len() && before.iter().zip(now).all(near)
}

fn bright_enough(lit: &Lit) -> Result<(), Failure> {
    let (share, bright) = (lit.share(), lit.bright() / lit.full_scale());
    let words = if share < LEAST_LIT {
        format!(
            "{:.1} % of the picture is lit: switch the lamp on, open the apertures",
            share * 100.0
        )
    } else if lit.saturated() > MOST_SATURATED {
        format!(
            "{:.0} % of the lit pixels are saturated: expose less",
            lit.saturated() * 100.0
        )
    } else if bright < LEAST_BRIGHT {
        format!(
            "white is {:.0} % of full scale: expose more",
            bright * 100.0
        )
    } else {
        return Ok(());
    };
    Err(scene(format!(
        "calibrate: {words}; `fringed doctor` says more"
    )))
}

/// Refuses a projector whose light depends on the content of a picture: no response holds for it.
fn alike(by_content: Option<f64>) -> Result<(), Failure> {
    match by_content {
        Some(off) if off.abs() > MOST_BY_CONTENT => Err(scene(format!(
            "calibrate: the light of a grey depends on the rest of the picture, by {:.1} %: `fringed doctor` says what to switch off",
            off * 100.0
        ))),
        _ => Ok(()),
    }
}

/// The description of the reference phase maps; their bytes go to `maps`.
fn reference(
    calibration: &Calibration,
    vertical: &Plate,
    horizontal: &Plate,
    maps: &mut Vec<(String, Vec<u8>)>,
) -> Result<ReferenceFile, Failure> {
    let models_off_px = models_off(calibration, vertical, horizontal).map_err(models)?;
    if !(models_off_px <= MOST_OFF_PX) {
        return Err(models(format!(
            "the models are off the measured plate by {models_off_px:.1} projector pixels, more than {MOST_OFF_PX}: put the \
             plate into the plane z = 0 of the models, or import the models of this head"
        )));
    }
    let (width, height) = (calibration.camera.width(), calibration.camera.height());
    let mut map = |name: &str, plate: &Plate| {
        let bytes = hal::npy::write(width, &plate.map(width, height));
        let (file, sha256) = Place::name_of_map(name, &bytes);
        maps.push((file.clone(), bytes));
        MapFile {
            file,
            sha256,
            residual_turns: plate.residual_turns,
            noise_turns: plate.noise_turns,
            filled: plate.filled,
        }
    };
    Ok(ReferenceFile {
        pitch_px: PLATE_PITCH,
        models_off_px,
        vertical: map("reference_vertical", vertical),
        horizontal: map("reference_horizontal", horizontal),
    })
}

/// RMS distance between the projector points that the models predict and those measured, over a grid of camera pixels, projector pixels.
fn models_off(
    calibration: &Calibration,
    vertical: &Plate,
    horizontal: &Plate,
) -> Result<f64, String> {
    const GRID: u32 = 16;
    let (camera, projector) = (&calibration.camera, &calibration.projector);
    let (width, height, _) = calibration.frames();
    let centre = camera.centre();
    let (mut squares, mut points) = (0.0, 0.0);
    for at in 0..GRID * GRID {
        let place =
            |at: u32, pixels: u32| (f64::from(at) + 0.5) / f64::from(GRID) * f64::from(pixels);
        let u = place(at % GRID, width);
        let v = place(at / GRID, height);
        let on_plane = camera
            .ray(u, v)
            .map(|ray| centre + ray * (-centre.z / ray.z));
        let predicted = on_plane.and_then(|point: Vector| projector.project(point));
        let Some((xi, eta)) = predicted else { continue };
        let off = (
            xi - PLATE_PITCH * vertical.turns(u, v),
            eta - PLATE_PITCH * horizontal.turns(u, v),
        );
        squares += off.0 * off.0 + off.1 * off.1;
        points += 1.0;
    }
    if points < f64::from(GRID * GRID) / 2.0 {
        return Err(
            "the models do not see the plane z = 0: import models of this head, with +z towards it"
                .into(),
        );
    }
    Ok((squares / points).sqrt())
}
