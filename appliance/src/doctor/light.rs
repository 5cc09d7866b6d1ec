//! The doctor's steps about light: there at all, exposed well, sharp at several pitches, and in proportion to grey.
//!
//! Contrast is the modulation B of four shifts by a quarter of a turn, B = ½ √((I₀ − I₂)² + (I₁ − I₃)²) (Creath 1988), relative to
//! that of the coarsest pitch, so neither brightness nor the projector's response changes it.

use super::{Finding, PATIENCE};
use crate::calibration::Calibration;
use crate::plan::rasters;
use algo::pattern::PhaseFunction;
use hal::error::Error;
use hal::frame::{Frame, Samples};
use hal::head::{DynHead, Showing};
use hal::projector::Raster;
use serde_json::{Value, json};

/// The patterns that the doctor loads first.
pub(super) const BLACK: usize = 0;
pub(super) const WHITE: usize = 1;
/// Grey levels whose response is measured, besides black and white.
const GREYS: [u8; 7] = [32, 64, 96, 128, 160, 192, 224];
/// Pitches whose contrast is measured, projector pixels, the coarsest first: the others are relative to it.
const PITCHES: [u32; 6] = [64, 32, 24, 16, 12, 8];
/// The pitch that must be sharp: teaching starts with it.
const SHARP_PITCH: u32 = 12;
/// Least contrast at that pitch, relative to the coarsest. A blur of σ pixels leaves exp(−2 (π σ / pitch)²): 0.5 is σ = 2.2 px.
const LEAST_CONTRAST: f64 = 0.5;
/// Quarter turns of a pitch.
const SHIFTS: usize = 4;
/// After so many refreshes the light of a flip has come and stays.
const SETTLE: u32 = 12;
/// A pixel is lit if white is this share of full scale above black.
const LIT: f64 = 0.05;
/// Share of the picture that must be lit.
const LEAST_LIT: f64 = 0.01;
/// Share of the lit pixels that may be saturated: glints.
const MOST_SATURATED: f64 = 0.01;
/// Median of white over the lit pixels, share of full scale: below, noise is a large part of the signal.
const LEAST_BRIGHT: f64 = 0.2;
/// Grey may answer off proportion by this share of white. Of gamma 1.1 it is 0.035.
const MOST_NONLINEAR: f64 = 0.03;

/// Pictures of the part under all patterns, in counts.
pub(super) struct Pictures {
    /// In the order of the patterns.
    pictures: Vec<Vec<f32>>,
    /// Pixels that the projector lights.
    lit: Vec<usize>,
    full_scale: f64,
}

/// The samples of a frame without padding.
fn counts(frame: &Frame) -> Vec<f32> {
    let format = frame.format();
    let (width, stride) = (format.width as usize, format.stride);
    match frame.samples() {
        Samples::Eight(all) => rows(all, width, stride),
        Samples::Sixteen(all) => rows(all, width, stride),
    }
}

fn rows<T: Copy + Into<f32>>(all: &[T], width: usize, stride: usize) -> Vec<f32> {
    let rows = all.chunks(stride).flat_map(|row| row.iter().take(width));
    rows.map(|sample| (*sample).into()).collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

impl Pictures {
    /// Shows every pattern long enough to have settled, and takes a picture of each.
    ///
    /// # Errors
    /// Of a device, or `Timeout` if the picture of a pattern did not come.
    pub fn take(head: &mut DynHead, calibration: &Calibration) -> Result<Self, Error> {
        let patterns = patterns(head.projector_size(), calibration)?;
        let count = patterns.len();
        head.load(patterns)?;
        let (camera, refresh) = (head.camera_timing(), head.refresh());
        // Wherever a camera that runs by itself stands, one whole exposure fits behind the settled light.
        let room = (camera.exposure + camera.period)
            .as_nanos()
            .div_ceil(refresh.as_nanos().max(1));
        let refreshes = SETTLE + 1 + u32::try_from(room).unwrap_or(u32::MAX - SETTLE - 1);
        let showing = |index| Showing {
            index,
            refreshes,
            settle: SETTLE,
        };
        let showings: Vec<Showing> = (0..count).map(showing).collect();
        let seen = head.watch(&showings, PATIENCE, &mut |frame| frame.clone())?;
        let picture = |at: usize| {
            let from = seen.flips.get(at)?.timestamp + refresh * SETTLE;
            let until = seen.flips.get(at + 1).map(|next| next.timestamp);
            let inside =
                |start| start >= from && until.is_none_or(|until| start + camera.exposure <= until);
            seen.frames
                .iter()
                .find(|frame| inside(frame.start))
                .map(|frame| counts(&frame.measured))
        };
        let mut pictures = Vec::with_capacity(count);
        for at in 0..count {
            pictures.push(picture(at).ok_or_else(|| {
                Error::timeout(
                    format!("taking a picture of pattern {at}"),
                    PATIENCE,
                    "check the cables of camera and projector",
                )
            })?);
        }
        let full_scale = f64::from(head.camera_format().full_scale());
        let pairs = pictures[BLACK].iter().zip(&pictures[WHITE]).enumerate();
        let lit = pairs
            .filter(|(_, (black, white))| f64::from(**white - **black) > LIT * full_scale)
            .map(|(at, _)| at)
            .collect();
        Ok(Self {
            pictures,
            lit,
            full_scale,
        })
    }

    /// Mean over the lit pixels of one picture.
    fn mean(&self, picture: &[f32]) -> f64 {
        let sum: f64 = self.lit.iter().map(|at| f64::from(picture[*at])).sum();
        sum / self.lit.len().max(1) as f64
    }

    /// How white a frame is, 0 as under black, 1 as under white.
    pub fn share_of_white(&self, frame: &Frame) -> f64 {
        self.share(self.mean(&counts(frame)))
    }

    fn share(&self, mean: f64) -> f64 {
        let (black, white) = (
            self.mean(&self.pictures[BLACK]),
            self.mean(&self.pictures[WHITE]),
        );
        (mean - black) / (white - black)
    }

    pub fn light(&self) -> Finding {
        let share = self.lit.len() as f64 / self.pictures[WHITE].len().max(1) as f64;
        let measured = json!({ "lit_percent": share * 100.0 });
        let found = format!(
            "{:.1} % of the picture is lit by the projector",
            share * 100.0
        );
        if share < LEAST_LIT {
            return Finding::fail(
                found,
                "switch the projector's lamp on, take off the lens caps, open the apertures, and put a part into view",
                measured,
            );
        }
        Finding::pass(found, measured)
    }

    pub fn exposure(&self) -> Finding {
        let white = || {
            self.lit
                .iter()
                .map(|at| f64::from(self.pictures[WHITE][*at]))
        };
        let saturated = white().filter(|count| *count >= self.full_scale).count() as f64
            / self.lit.len().max(1) as f64;
        let bright = median(white().collect()) / self.full_scale;
        let measured =
            json!({ "saturated_percent": saturated * 100.0, "white_percent": bright * 100.0 });
        let found = format!(
            "white is {:.0} % of full scale, {:.1} % of the lit pixels are saturated",
            bright * 100.0,
            saturated * 100.0
        );
        if saturated > MOST_SATURATED {
            return Finding::fail(
                found,
                "lower the gain, the lamp or the aperture, or expose fewer whole refreshes",
                measured,
            );
        }
        if bright < LEAST_BRIGHT {
            return Finding::fail(
                found,
                "raise the lamp, open the aperture, or expose more whole refreshes",
                measured,
            );
        }
        Finding::pass(found, measured)
    }

    /// Median modulation over the lit pixels of the pitch that stands at this place.
    fn modulation(&self, place: usize) -> f64 {
        let first = 2 + GREYS.len() + place * SHIFTS;
        let shot = |shift: usize, at: usize| f64::from(self.pictures[first + shift][at]);
        let one =
            |at: &usize| (shot(0, *at) - shot(2, *at)).hypot(shot(1, *at) - shot(3, *at)) / 2.0;
        median(self.lit.iter().map(one).collect())
    }

    pub fn contrast(&self) -> Finding {
        let coarsest = self.modulation(0);
        let relative: Vec<(u32, f64)> = (0..PITCHES.len())
            .map(|at| (PITCHES[at], self.modulation(at) / coarsest.max(1e-9)))
            .collect();
        let by_pitch: serde_json::Map<String, Value> = relative
            .iter()
            .map(|(pitch, contrast)| (pitch.to_string(), json!(contrast)))
            .collect();
        let measured = json!({ "modulation_counts": coarsest, "contrast_by_pitch": by_pitch });
        let listed: Vec<String> = relative
            .iter()
            .map(|(pitch, contrast)| format!("{:.0} % at {pitch} px", contrast * 100.0))
            .collect();
        let found = format!(
            "contrast of the coarsest pitch is kept to {}",
            listed.join(", ")
        );
        let sharp = relative.iter().find(|(pitch, _)| *pitch == SHARP_PITCH);
        if sharp.is_none_or(|(_, contrast)| *contrast < LEAST_CONTRAST) {
            return Finding::fail(
                found,
                format!(
                    "focus projector and camera on the part until {SHARP_PITCH} px keep {:.0} %",
                    LEAST_CONTRAST * 100.0
                ),
                measured,
            );
        }
        Finding::pass(found, measured)
    }

    pub fn response(&self) -> Finding {
        let answers: Vec<(f64, f64)> = GREYS
            .iter()
            .enumerate()
            .map(|(at, grey)| {
                (
                    f64::from(*grey) / 255.0,
                    self.share(self.mean(&self.pictures[2 + at])),
                )
            })
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
        if off > MOST_NONLINEAR {
            return Finding::fail(
                found,
                "set the projector's gamma to 1 (a mode without picture improvement), or calibrate its response",
                measured,
            );
        }
        Finding::pass(found, measured)
    }
}

/// Black, white, greys, and the shifts of each pitch.
fn patterns((columns, rows): (u32, u32), calibration: &Calibration) -> Result<Vec<Raster>, Error> {
    let mut all = Vec::with_capacity(2 + GREYS.len() + PITCHES.len() * SHIFTS);
    for grey in [0, u8::MAX].into_iter().chain(GREYS) {
        all.push(Raster::uniform(columns, rows, grey)?);
    }
    for pitch in PITCHES {
        let fringes = f64::from(columns) / f64::from(pitch);
        let function =
            PhaseFunction::vertical(columns as usize, rows as usize, fringes).map_err(|error| {
                Error::unsupported(
                    format!("a pitch of {pitch} px: {error}, which"),
                    "use a projector of more pixels",
                )
            })?;
        let shifts = (0..SHIFTS).map(|shift| (1.0, shift as f64 / SHIFTS as f64));
        all.extend(rasters(&function, shifts, calibration)?);
    }
    Ok(all)
}
