//! The step `timing`: measures what does not depend on the geometry of a head: time stamps, pace,
//! flip-to-light delay, grey response, noise and contrast.

use super::{StepOutcome, Subject};
use crate::error::{Exit, Failure, Result};
use crate::head::calibration::file::{
    CalibrationFile, ContrastFile, LevelFile, NoiseFile, TimingFile,
};
use crate::head::calibration::{Calibration, inverted};
use crate::head::doctor::light::{alike, exposed, lit_enough};
use crate::head::doctor::{Check, CheckVerdict};
use crate::head::examine::{
    Clips, Delay, Lit, SETTLE, Spaced, Stamps, by_content, by_pitch, clipping, contrast, noise,
    pace, refreshes, response,
};
use algo::frame::SampleNoise;
use hal::head::{Head, Stamp, Timing};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::time::Duration;

/// Most rounds of the delay: 100 s, where stamps jitter or the camera has few pixels.
const ROUNDS: u32 = 24;
/// A measured delay below this is refused: light does not come before its flip.
const LEAST_DELAY_S: f64 = -200e-6;
/// Refreshes that light gets to settle beyond its delay.
const BEYOND: u32 = 2;
/// A response that differs from the previous one by less than this many levels replaces nothing, so
/// recipes stay valid.
const SAME_RESPONSE: f64 = 1.0;

/// What is measured on a head and does not depend on its geometry.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Characteristics {
    /// Flips, light and stamps.
    pub timing: TimingFile,
    /// The camera's noise.
    pub noise: NoiseFile,
    /// The light of each of the 256 grey levels, 0 for black, 255 for white.
    pub response: Vec<f64>,
    /// Contrast of fringes against their pitch.
    pub contrast: ContrastFile,
}

impl Characteristics {
    /// The characteristics in a calibration, if it has all of them.
    pub fn of(file: &CalibrationFile) -> Option<Self> {
        Some(Self {
            timing: file.timing.clone()?,
            noise: file.noise.clone()?,
            response: file.response.clone()?,
            contrast: file.contrast.clone()?,
        })
    }

    /// Gives a calibration the response, the noise and the contrast.
    ///
    /// # Errors
    /// The response cannot be inverted.
    pub fn adopt(&self, calibration: &mut Calibration) -> Result<()> {
        calibration.response = inverted(&self.response)?;
        calibration.noise_counts = self.noise.counts;
        calibration.noise = self.noise.by_signal();
        calibration.exposing = self.noise.exposing;
        calibration.contrast = Some(self.contrast.clone());
        Ok(())
    }
}

/// Refuses a head that does not pass a check of the doctor.
fn passed(check: Check) -> Result<()> {
    let Check { found, remedy, .. } = check;
    match check.verdict {
        CheckVerdict::Pass => Ok(()),
        _ => Err(Failure::because(
            Exit::Unavailable,
            format!("calibrate: {found}"),
            remedy,
        )),
    }
}

/// Measures what does not depend on the geometry, and gives it to head and calibration, which says
/// what the camera is set to. The response `before` is kept where the new one equals it within
/// noise.
///
/// # Errors
/// The error of a device; if too little light comes back, or too much (69).
fn characterise(subject: &mut Subject<'_>, before: Option<Vec<f64>>) -> Result<Characteristics> {
    let (head, calibration) = (&mut *subject.head, &mut *subject.calibration);
    let (notes, progress) = (&mut subject.notes, subject.progress);
    // Patterns are shown as they are until their response is known.
    calibration.response = None;
    progress(0.0, "camera stamps");
    let stamps = Stamps::measure(head)?;
    head.set_timing(Timing {
        flip_to_light: Duration::ZERO,
        ..stamps.timing(head.timing())
    });
    progress(0.02, "pace of the camera");
    let pace = proven(&pace(head)?, notes);
    head.set_timing(Timing {
        hold: pace.unwrap_or(head.timing().hold),
        ..head.timing()
    });
    progress(0.04, "where the camera clips");
    // Measured on samples as they are.
    head.set_clipping(None);
    let clips_from = match clipping(head)? {
        Clips::From(sample) => Some(sample),
        Clips::AtFullScale => None,
        Clips::Unknown(why) => {
            notes.push(format!(
                "where the camera clips is not measured, and taken to be full scale: {why}"
            ));
            None
        }
    };
    head.set_clipping(clips_from);
    progress(0.05, "light");
    let lit = Lit::take(head, SETTLE)?;
    passed(lit_enough(&lit))?;
    passed(exposed(&lit))?;
    progress(0.1, "flip-to-light delay");
    let share = |share: f64| progress(0.1 + 0.28 * share, "flip-to-light delay");
    let delay = Delay::measure(head, &lit, ROUNDS, &share)?
        .filter(|delay| delay.seconds >= LEAST_DELAY_S)
        .ok_or_else(|| {
            Failure::because(
                Exit::Unavailable,
                "measure the flip-to-light delay",
                "light does not follow the flips: `fringed doctor` says more",
            )
        })?;
    head.set_timing(Timing {
        flip_to_light: delay.duration(),
        ..head.timing()
    });
    let settle = settled(head);
    progress(0.38, "light by content");
    if let Some(off) = by_content(head, settle, &lit)? {
        // No response holds for a projector whose light depends on the content of a picture.
        passed(alike(off))?;
    }
    let share = |share: f64| progress(0.4 + 0.4 * share, "grey response");
    let mut greys = response(head, settle, &lit, &share)?.to_vec();
    if let Some(before) = before.filter(|before| same(before, &greys)) {
        notes.push(
            "the grey response equals the previous one within noise: that one is kept, and recipes stay valid"
                .into(),
        );
        greys = before;
    }
    calibration.response = inverted(&greys).map_err(Exit::Unavailable.failure())?;
    progress(0.8, "noise");
    let noise = noise(head, settle, &lit)?;
    calibration.noise_counts = noise.counts;
    calibration.noise = SampleNoise::new(noise.read_counts, noise.shot);
    progress(0.9, "contrast");
    let contrast = contrast(head, calibration, settle, &lit)?;
    Ok(Characteristics {
        timing: TimingFile {
            flip_to_light_ns: nanoseconds(delay.duration()),
            sigma_ns: (delay.error * 1e9).ceil() as u64,
            stamp: stamps.stamp,
            stamp_late_ns: stamps.late.map(nanoseconds),
            readout_ns: nanoseconds(stamps.readout),
            refreshes: pace,
        },
        noise: NoiseFile {
            counts: noise.counts,
            read_counts: noise.read_counts,
            shot: noise.shot,
            clips_from,
            levels: noise
                .points
                .iter()
                .map(|point| LevelFile {
                    level: point.level,
                    counts: point.counts,
                })
                .collect(),
            exposing: calibration.exposing,
        },
        response: greys,
        contrast,
    })
}

/// The largest deviation of a response from proportionality to grey, levels.
pub fn off_proportion(response: &[f64]) -> f64 {
    let levels = response.iter().enumerate();
    levels.fold(0.0, |most, (grey, light)| {
        (light - grey as f64).abs().max(most)
    })
}

/// Refreshes after a flip when its light has come and settled, by the head's timing.
pub fn settled(head: &Head) -> u32 {
    refreshes(head, head.timing().flip_to_light).saturating_add(BEYOND)
}

/// The refreshes per pattern at which no trigger is lost, if there are any; otherwise patterns are
/// shown as long as before.
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

impl Characteristics {
    /// What was found, each with its name.
    pub fn words(&self) -> Vec<(&'static str, String)> {
        let (timing, noise) = (&self.timing, &self.noise);
        let marks = match timing.stamp {
            Stamp::ExposureStart => "start of the exposure",
            Stamp::ExposureEnd => "end of the exposure",
            Stamp::ReadoutEnd => "end of the readout",
        };
        let late = timing.stamp_late_ns;
        let late = late.map_or(String::new(), |ns| format!(", {} µs late", ns / 1000));
        let mut found = vec![("stamps", format!("the camera's mark the {marks}{late}"))];
        found.extend(timing.refreshes.map(|refreshes| {
            let words = format!("no trigger is lost with a pattern in {refreshes} refreshes");
            ("pace", words)
        }));
        let delay = format!(
            "light comes {:.3} ms after its flip (1 σ {:.2} µs)",
            timing.flip_to_light_ns as f64 * 1e-6,
            timing.sigma_ns as f64 * 1e-3
        );
        let response = format!(
            "off proportion by {:.1} of 255 levels at most; patterns are corrected for it",
            off_proportion(&self.response)
        );
        let noise = format!(
            "{:.2} counts at half of white; {:.2} in the dark, and {:.4} counts² per count of light",
            noise.counts, noise.read_counts, noise.shot
        );
        found.extend(self.noise.clips_from.map(|from| {
            let words = format!(
                "the camera clips or bends at {from} counts: samples from there on are left out"
            );
            ("clipping", words)
        }));
        found.extend([
            ("delay", delay),
            ("response", response),
            ("noise", noise),
            ("contrast", self.contrast.words()),
        ]);
        found
    }
}

/// Measures what does not depend on the geometry, and replaces what was measured before by it.
pub(super) fn measure(
    subject: &mut Subject<'_>,
    known: &mut Option<Characteristics>,
) -> Result<Option<StepOutcome>> {
    let response = known.as_ref().map(|known| known.response.clone());
    let before = || subject.before.as_ref()?.response.clone();
    let response = response.or_else(before);
    let measured = characterise(subject, response)?;
    let figures = json!({
        "delay_ms": measured.timing.flip_to_light_ns as f64 * 1e-6, "stamp": measured.timing.stamp,
        "nonlinear_percent": off_proportion(&measured.response) / 2.55,
        "noise_counts": measured.noise.counts, "contrast": by_pitch(&measured.contrast),
    });
    let words = measured.words().into_iter();
    let said = words.map(|(name, found)| format!("{name}: {found}"));
    let outcome = StepOutcome::passed(said, figures);
    *known = Some(measured);
    Ok(Some(outcome))
}
