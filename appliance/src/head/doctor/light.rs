//! The doctor's checks of light: there is some, it is exposed well, fringes are sharp, and light is
//! proportional to grey.

use super::{Check, CheckResult, CheckVerdict, Examination};
use crate::head::examine::{self, SETTLE};
use crate::head::examine::{
    LAMPS_HZ, LEAST_BRIGHT, LEAST_LIT, LONGEST_DARK, Lit, MOST_BY_CONTENT, MOST_SATURATED,
    by_content,
};
use serde_json::json;

/// Grey levels whose response is measured, besides black and white.
const GREYS: [u8; 7] = [32, 64, 96, 128, 160, 192, 224];
/// The pitch whose contrast is judged, projector pixels: teaching starts with it.
const SHARP_PITCH: u32 = 12;
/// Least contrast at that pitch, relative to the coarsest. A blur of σ pixels leaves exp(−2 (π σ /
/// pitch)²): 0.5 is σ = 2.2 px.
const LEAST_CONTRAST: f64 = 0.5;
/// Most that other light may change, ± share of full scale.
const MOST_FLICKER: f64 = 0.01;
/// An exposure is of whole periods to this part of one.
const WHOLE: f64 = 0.02;
/// No longer exposure is proposed.
const MOST_REFRESHES: u32 = 32;
/// Largest deviation of light from proportionality to grey, share of white. A gamma of 1.1 deviates
/// by 0.035.
const MOST_NONLINEAR: f64 = 0.03;

pub(super) fn light(examination: &mut Examination<'_>) -> CheckResult {
    let first = examination.first_light;
    let mut check = lit_enough(examination.lit()?.1);
    if let Some(first) = first {
        let seconds = first.map(|first| first.as_secs_f64());
        check.measured["first_light_s"] = json!(seconds);
        check.found += &match seconds {
            Some(seconds) => format!(", at the latest {seconds:.1} s after its mode was set"),
            None => format!(
                ", not within {} s after its mode was set",
                LONGEST_DARK.as_secs()
            ),
        };
        if check.verdict == CheckVerdict::Pass && first.is_none() {
            let remedy = "the projector needs too long to lock on to its signal: let it stay switched on, and give it the mode that its own description prefers";
            return Ok(Check::new(check.found, Some(remedy), check.measured));
        }
    }
    Ok(check)
}

/// Judges whether the projector lights the picture.
pub fn lit_enough(lit: &Lit) -> Check {
    let share = lit.share();
    let remedy = "switch the projector's lamp on, take off the lens caps, open the apertures, and put a part into view";
    Check::new(
        format!(
            "{:.1} % of the frame is lit by the projector",
            share * 100.0
        ),
        (share < LEAST_LIT).then_some(remedy),
        json!({ "lit_percent": share * 100.0 }),
    )
}

/// The remedy for a projector that adapts to content.
const ADAPTS: &str = "switch off what adapts the projector to the content of a picture (CAIC, dynamic contrast, eco mode): for TI's DLPC3470, DLPC3478 and DLPC3479 write head.projector.controller = \"dlpc347x\"";

pub(super) fn exposure(examination: &mut Examination<'_>) -> CheckResult {
    Ok(exposed(examination.lit()?.1))
}

/// Judges whether white is neither saturated nor dark.
pub fn exposed(lit: &Lit) -> Check {
    let saturated = lit.saturated();
    let bright = lit.bright() / lit.full_scale();
    let measured =
        json!({ "saturated_percent": saturated * 100.0, "white_percent": bright * 100.0 });
    let found = format!(
        "white is {:.0} % of full scale, {:.1} % of the lit pixels are saturated",
        bright * 100.0,
        saturated * 100.0
    );
    let remedy = if saturated > MOST_SATURATED {
        Some(
            "expose less: lower the gain, the lamp or the aperture, or expose fewer whole refreshes",
        )
    } else if bright < LEAST_BRIGHT {
        Some("raise the lamp, open the aperture, or expose more whole refreshes")
    } else {
        None
    };
    Check::new(found, remedy, measured)
}

pub(super) fn contrast(examination: &mut Examination<'_>) -> CheckResult {
    let calibration = examination.calibration;
    let (head, lit) = examination.lit()?;
    let found = examine::contrast(head, calibration, SETTLE, lit)?;
    let measured = json!({
        "modulation_counts": found.modulation_counts, "contrast_by_pitch": examine::by_pitch(&found),
    });
    let mut pitches = found.pitches.iter();
    let sharp = pitches.find(|pitch| pitch.pitch_px == SHARP_PITCH);
    let blurred = sharp.is_none_or(|pitch| pitch.contrast < LEAST_CONTRAST);
    let found = format!(
        "contrast of the coarsest pitch is kept to {}",
        found.words()
    );
    let remedy = format!(
        "focus projector and camera on the part until {SHARP_PITCH} px keep {:.0} %",
        LEAST_CONTRAST * 100.0
    );
    Ok(Check::new(found, blurred.then_some(&*remedy), measured))
}

pub(super) fn content(examination: &mut Examination<'_>) -> CheckResult {
    let (head, lit) = examination.lit()?;
    let Some(off) = by_content(head, SETTLE, lit)? else {
        return Ok(Check::new(
            "too little of the part shows one grey stripe alone to tell how its light depends on its surroundings",
            Some("put a flat, bright part into view, and focus projector and camera on it"),
            json!({}),
        ));
    };
    Ok(alike(off))
}

/// Judges whether the light of a grey is independent of its surroundings; between white stripes it gives
/// more than between black ones by the share `off`.
pub fn alike(off: f64) -> Check {
    Check::new(
        format!(
            "the light of a grey depends on the rest of the picture: between white stripes it differs by {:.1} % from that between black ones",
            off * 100.0
        ),
        (off.abs() > MOST_BY_CONTENT).then_some(ADAPTS),
        json!({ "by_content_percent": off * 100.0 }),
    )
}

pub(super) fn flicker(examination: &mut Examination<'_>) -> CheckResult {
    let (head, lit) = examination.lit()?;
    // A multiple of three refreshes of 60 Hz is one of whole periods of 100 Hz.
    let counts = examine::flicker(head, SETTLE + 1, lit)?;
    let refresh = head.refresh().as_secs_f64();
    let whole = LAMPS_HZ.map(|hz| {
        let least = head.camera_timing().exposure.as_secs_f64() / refresh;
        let mut refreshes = least.round().max(1.0) as u32..MOST_REFRESHES;
        let found = refreshes.find(|count| {
            let periods = f64::from(*count) * refresh * f64::from(hz);
            (periods - periods.round()).abs() < WHOLE
        });
        found.map(|count| {
            let us = f64::from(count) * refresh * 1e6;
            format!("{us:.0} µs with mains of {} Hz", hz / 2)
        })
    });
    let whole: Vec<String> = whole.into_iter().flatten().collect();
    let remedy = format!(
        "keep the light of lamps away from the part, or expose for whole periods of theirs: {}",
        whole.join(", ")
    );
    Ok(Check::new(
        format!("other light than the projector's changes by ± {counts:.1} counts"),
        (counts > MOST_FLICKER * lit.full_scale()).then_some(&*remedy),
        json!({ "flicker_counts": counts }),
    ))
}

pub(super) fn response(examination: &mut Examination<'_>) -> CheckResult {
    // Projected as patterns are: through the inverse of the calibrated response.
    let response = examination.calibration.response.as_ref();
    let asked = GREYS.map(|grey| response.map_or(grey, |response| response.level_for(grey)));
    let (head, lit) = examination.lit()?;
    let lights = examine::lights(head, SETTLE, lit, &asked, &|_| ())?;
    let answers: Vec<(f64, f64)> = GREYS
        .iter()
        .zip(lights)
        .map(|(grey, light)| (f64::from(*grey) / 255.0, light))
        .collect();
    let off = answers
        .iter()
        .map(|(grey, light)| (light - grey).abs())
        .fold(0.0, f64::max);
    // Least squares of ln light = gamma ln grey.
    let (mut products, mut squares) = (0.0, 0.0);
    for (grey, light) in &answers {
        let (x, y) = (grey.ln(), light.max(1e-3).ln());
        (products, squares) = (products + x * y, squares + x * x);
    }
    let gamma = products / squares;
    let measured = json!({ "gamma": gamma, "nonlinear_percent": off * 100.0 });
    let found = format!(
        "light follows grey with exponent {gamma:.2}, off proportion by {:.1} % of white at most",
        off * 100.0
    );
    let remedy = "set the projector's gamma to 1 (a mode without picture improvement), or calibrate its response";
    let nonlinear = (off > MOST_NONLINEAR).then_some(remedy);
    Ok(Check::new(found, nonlinear, measured))
}
