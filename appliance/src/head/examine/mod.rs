//! Measurements of a head: the doctor judges them, calibration stores them.
//!
//! Pictures are taken long after each flip ([`Lit`], [`pictures`]), so their measurements need no
//! timing. The measurements of time itself need no calibration: what the camera's stamps mark
//! ([`Stamps`]), how soon it can be triggered again ([`pace`]), and when the light of a flip comes
//! ([`Delay`]).

mod camera;
mod clipping;
mod crossed;
mod delay;
mod light;

pub use camera::{MOST_LATE, Spaced, Stamps, pace};
pub use clipping::{Clips, clipping};
pub use crossed::{
    CrossedFringes, DRIFT_REMEDY, MOST_DRIFT_PX, PLATE_PITCH, ReferencePlane, plate,
};
pub use delay::Delay;
pub use light::{
    LAMPS_HZ, MOST_BY_CONTENT, PITCHES, by_content, by_pitch, contrast, flicker, lights, noise,
    response,
};

use hal::camera::Starts;
use hal::error::Error;
use hal::frame::Frame;
use hal::head::{Head, Showing, Watched};
use hal::projector::Raster;
use std::cell::Cell;
use std::time::Duration;

/// Longest wait for flips and frames beyond their planned time.
pub const PATIENCE: Duration = Duration::from_millis(500);
/// Least share of the picture that must be lit.
pub const LEAST_LIT: f64 = 0.01;
/// Largest share of the lit pixels that may be saturated, by glints.
pub const MOST_SATURATED: f64 = 0.01;
/// Least median of white over the lit pixels, share of full scale: below it, noise is a large part
/// of the signal.
pub const LEAST_BRIGHT: f64 = 0.2;
/// Refreshes after which the light of a flip has come and is stable, on any head that can be used.
pub const SETTLE: u32 = 12;
/// Patterns that are loaded at a time: a projector's memory holds a sequence, not 256 greys.
const BATCH: usize = 8;
/// How often a batch is taken before giving up: a lost frame or a pulse of the wrong length loses a
/// picture.
const ATTEMPTS: u32 = 3;
/// A pixel is lit if white is this share of full scale above black.
const LIT: f64 = 0.05;
/// Longest wait for the first light. Projectors lock within a few seconds; without a part in front
/// of the head, no light comes back at all.
pub const LONGEST_DARK: Duration = Duration::from_secs(15);

/// The pixels that the projector lights, and their samples of black and white.
#[derive(Clone, Debug)]
pub struct Lit {
    /// Row-major indices of the lit pixels.
    places: Vec<usize>,
    /// The pictures of black and white, counts.
    black: Vec<f32>,
    white: Vec<f32>,
    black_mean: f64,
    white_mean: f64,
    full_scale: f64,
}

impl Lit {
    /// Takes pictures of black and white.
    ///
    /// # Errors
    /// As [`pictures`].
    pub fn take(head: &mut Head, settle: u32) -> Result<Self, Error> {
        let mut taken = Vec::with_capacity(2);
        pictures(
            head,
            settle,
            greys(head.projector_size(), [0, 255]),
            &mut |counts| {
                taken.push(counts);
            },
        )?;
        let white = taken.pop().unwrap_or_default();
        let black = taken.pop().unwrap_or_default();
        let full_scale = f64::from(head.camera_format().full_scale());
        let pairs = black.iter().zip(&white).enumerate();
        let places = pairs
            .filter(|(_, (black, white))| f64::from(**white - **black) > LIT * full_scale)
            .map(|(at, _)| at)
            .collect();
        let mut lit = Self {
            places,
            black,
            white,
            black_mean: 0.0,
            white_mean: 0.0,
            full_scale,
        };
        (lit.black_mean, lit.white_mean) = (lit.mean(&lit.black), lit.mean(&lit.white));
        Ok(lit)
    }

    /// Row-major indices of the lit pixels.
    pub fn places(&self) -> &[usize] {
        &self.places
    }

    /// Share of the picture that is lit.
    pub fn share(&self) -> f64 {
        self.places.len() as f64 / self.white.len().max(1) as f64
    }

    /// Samples of the lit pixels under white, counts.
    pub fn white(&self) -> impl Iterator<Item = f64> {
        self.places.iter().map(|at| f64::from(self.white[*at]))
    }

    /// Share of the lit pixels that are saturated under white.
    pub fn saturated(&self) -> f64 {
        let saturated = self.white().filter(|count| *count >= self.full_scale);
        saturated.count() as f64 / self.places.len().max(1) as f64
    }

    /// Median of white over the lit pixels, counts.
    pub fn bright(&self) -> f64 {
        median(self.white().collect())
    }

    /// Expected sample of each pixel under a light between black (0) and white (1), counts,
    /// row-major.
    pub fn levels(&self, share: f64) -> impl Iterator<Item = f64> {
        let pairs = self.black.iter().zip(&self.white);
        pairs.map(move |(black, white)| {
            f64::from(*black) + share * (f64::from(*white) - f64::from(*black))
        })
    }

    /// The largest sample.
    pub fn full_scale(&self) -> f64 {
        self.full_scale
    }

    /// Mean over the lit pixels of a picture of this size, counts.
    pub fn mean(&self, picture: &[f32]) -> f64 {
        let sum: f64 = self.places.iter().map(|at| f64::from(picture[*at])).sum();
        sum / self.places.len().max(1) as f64
    }

    /// The light of a mean over the lit pixels: 0 is that of black, 1 that of white.
    pub fn share_of_white(&self, mean: f64) -> f64 {
        (mean - self.black_mean) / (self.white_mean - self.black_mean)
    }
}

/// How many refreshes of the projector a time takes, rounded up.
pub fn refreshes(head: &Head, time: Duration) -> u32 {
    let whole = time.as_nanos().div_ceil(head.refresh().as_nanos().max(1));
    u32::try_from(whole).unwrap_or(u32::MAX)
}

/// Shows each pattern, waits `settle` refreshes for its light, and hands a picture of it to `keep`,
/// in order, in counts.
///
/// # Errors
/// The error of a device, or `Timeout` if the picture of a pattern did not come.
pub fn pictures(
    head: &mut Head,
    settle: u32,
    patterns: impl IntoIterator<Item = Result<Raster, Error>>,
    keep: &mut dyn FnMut(Vec<f32>),
) -> Result<(), Error> {
    let mut patterns = patterns.into_iter();
    loop {
        let batch = patterns
            .by_ref()
            .take(BATCH)
            .collect::<Result<Vec<_>, _>>()?;
        if batch.is_empty() {
            return Ok(());
        }
        take(head, (settle, 1), batch, keep)?;
    }
}

/// Pictures of patterns, of so many exposures each.
fn take(
    head: &mut Head,
    (settle, exposures): (u32, u32),
    patterns: Vec<Raster>,
    keep: &mut dyn FnMut(Vec<f32>),
) -> Result<(), Error> {
    let count = patterns.len();
    head.load(patterns)?;
    head.expose(exposures)?;
    let showings: Vec<Showing> = (0..count).map(|at| showing(head, at, settle)).collect();
    for _ in 0..ATTEMPTS {
        let seen = head.watch(&showings, PATIENCE, &mut |frame| frame.clone())?;
        let picture = |at: usize| settled(head, &seen, at, settle);
        let taken: Option<Vec<_>> = (0..count).map(picture).collect();
        if let Some(taken) = taken {
            taken.into_iter().for_each(|frame| keep(frame.counts()));
            return Ok(());
        }
    }
    Err(Error::timeout(
        "taking a picture of a pattern",
        PATIENCE,
        "check the cables of camera and projector, and the load of the computer",
    ))
}

/// One picture of a loaded pattern; none if the frame was lost. It ends as soon as the frame of a
/// triggered camera has arrived.
///
/// # Errors
/// The error of a device.
pub fn picture(head: &mut Head, index: usize, settle: u32) -> Result<Option<Frame>, Error> {
    // A camera that runs by itself has frames of before the light has settled.
    let triggered = head.camera_timing().starts == Starts::OnTrigger;
    let there = Cell::new(false);
    let showings = [showing(head, index, settle)];
    let mut measure = |frame: &Frame| {
        there.set(true);
        frame.clone()
    };
    let still = || !(triggered && there.get());
    let seen = head.watch_while(&showings, PATIENCE, &mut measure, &still)?;
    Ok(settled(head, &seen, 0, settle).cloned())
}

/// A pattern, shown long enough for one whole exposure of settled light, whatever the phase of a
/// free-running camera.
fn showing(head: &Head, index: usize, settle: u32) -> Showing {
    let camera = head.camera_timing();
    let room = refreshes(head, camera.exposure + camera.period);
    Showing {
        index,
        refreshes: settle + 1 + room.min(u32::MAX / 64),
        settle,
    }
}

/// The first frame that was exposed whole to the settled light of a showing.
fn settled<'a>(head: &Head, seen: &'a Watched<Frame>, at: usize, settle: u32) -> Option<&'a Frame> {
    let exposure = head.camera_timing().exposure;
    let from = seen.flips.get(at)?.timestamp + head.refresh() * settle;
    let until = seen.flips.get(at + 1).map(|next| next.timestamp);
    let inside = |start| start >= from && until.is_none_or(|until| start + exposure <= until);
    let fits = |start| inside(start) && !seen.spoiled_near(start);
    let frame = seen.frames.iter().find(|frame| fits(frame.start))?;
    Some(&frame.measured)
}

/// Loads black and white, in this order.
///
/// # Errors
/// The error of the projector.
pub fn load_black_and_white(head: &mut Head) -> Result<(), Error> {
    let patterns = greys(head.projector_size(), [0, u8::MAX]);
    head.load(patterns.collect::<Result<_, _>>()?)
}

/// Rasters of one grey level each.
pub(super) fn greys(
    (columns, rows): (u32, u32),
    levels: impl IntoIterator<Item = u8>,
) -> impl Iterator<Item = Result<Raster, Error>> {
    let levels = levels.into_iter();
    levels.map(move |level| Raster::uniform(columns, rows, level))
}

/// The median; 0 of nothing.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Shows black and white until they differ, and returns how long that took; `None` if they are
/// still the same after [`LONGEST_DARK`].
///
/// # Errors
/// The error of a device, or if no frame comes.
pub fn first_light(head: &mut Head) -> Result<Option<Duration>, Error> {
    let begun = head.now();
    loop {
        let share = Lit::take(head, SETTLE)?.share();
        let waited = head.now().since(begun);
        if share >= LEAST_LIT {
            return Ok(Some(waited));
        }
        if waited >= LONGEST_DARK {
            return Ok(None);
        }
    }
}
