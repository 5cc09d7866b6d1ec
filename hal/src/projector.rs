//! The projector of a head: patterns are loaded, then shown by their index; and the condition of its
//! controller, as far as a head can ask for it.

use std::time::Duration;

use crate::error::Error;
use crate::units::Timestamp;

/// A grey picture for the projector, row by row, 0 (black) to 255 (white).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Raster {
    width: u32,
    height: u32,
    pixels: Vec<u8>,
}

impl Raster {
    /// A raster of `width` × `height` grey levels.
    ///
    /// # Errors
    /// `Unsupported` if it has no pixels or `pixels` holds another number than width × height.
    pub fn new(width: u32, height: u32, pixels: Vec<u8>) -> Result<Self, Error> {
        let wanted = u64::from(width) * u64::from(height);
        if wanted == 0 || pixels.len() as u64 != wanted {
            return Err(Error::unsupported(
                format!(
                    "a raster of {width}×{height} with {} grey levels",
                    pixels.len()
                ),
                format!("give {wanted} grey levels and at least one"),
            ));
        }
        Ok(Self {
            width,
            height,
            pixels,
        })
    }

    /// A raster of one grey level everywhere.
    ///
    /// # Errors
    /// `Unsupported` if it has no pixels.
    pub fn uniform(width: u32, height: u32, level: u8) -> Result<Self, Error> {
        Self::new(width, height, vec![level; width as usize * height as usize])
    }

    /// Columns.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Grey levels, row by row.
    #[must_use]
    pub fn pixels(&self) -> &[u8] {
        &self.pixels
    }
}

/// The refresh with which the projector changed to a queued pattern.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Flip {
    /// When that refresh began. The pattern's light follows after the head's
    /// [`crate::head::Timing::flip_to_light`].
    pub timestamp: Timestamp,
    /// The projector's own count of refreshes; a larger increase than planned means missed
    /// refreshes.
    pub count: u64,
}

/// What a projector's controller says of itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ControllerState {
    /// Its name.
    pub device: &'static str,
    /// What it still does to pictures, as bits of [`processing`]; 0 = it shows patterns as they
    /// are.
    pub processing: u16,
    /// Its faults, as bits of [`fault`].
    pub faults: u16,
    /// Its temperature, °C; `None` if it is not known.
    pub temperature_c: Option<f64>,
    /// The current of the LED that is on, in steps of its driver (10 bits).
    pub led_current: u16,
}

/// Bits of [`ControllerState::processing`].
pub mod processing {
    /// It shows video, colour after colour, and not patterns.
    pub const VIDEO: u16 = 1 << 0;
    /// It adapts gain and LED currents to the content of the whole picture.
    pub const CAIC: u16 = 1 << 1;
    /// It boosts the brightness of dark areas.
    pub const LABB: u16 = 1 << 2;
    /// It sharpens edges.
    pub const SHARPNESS: u16 = 1 << 3;

    /// The words of the bits that are set.
    pub fn words(bits: u16) -> impl Iterator<Item = &'static str> {
        super::set(
            bits,
            &[
                "video mode",
                "adaptive brightness (CAIC)",
                "area brightness boost (LABB)",
                "sharpening",
            ],
        )
    }
}

/// Bits of [`ControllerState::faults`].
pub mod fault {
    /// The micromirror device or its interface.
    pub const DMD: u16 = 1 << 0;
    /// An LED.
    pub const LED: u16 = 1 << 1;
    /// The sequence of bit planes.
    pub const SEQUENCE: u16 = 1 << 2;
    /// The supply voltage is low.
    pub const SUPPLY: u16 = 1 << 3;
    /// Times of patterns or triggers are not supported.
    pub const PATTERN_TIMING: u16 = 1 << 4;
    /// The firmware is for another product.
    pub const CONFIGURATION: u16 = 1 << 5;
    /// The controller's watchdog expired.
    pub const WATCHDOG: u16 = 1 << 6;
    /// The flash memory.
    pub const FLASH: u16 = 1 << 7;

    /// The words of the bits that are set.
    pub fn words(bits: u16) -> impl Iterator<Item = &'static str> {
        super::set(
            bits,
            &[
                "micromirror device",
                "LED",
                "sequence",
                "low supply voltage",
                "timing of patterns",
                "product configuration",
                "watchdog",
                "flash memory",
            ],
        )
    }
}

/// A projector that holds patterns and shows one of them at a time.
///
/// A flip is queued without waiting and happens with the next refresh; its time and count are
/// reported afterwards. At most one flip can be queued at a time.
pub trait Projector: Send {
    /// Columns and rows.
    fn size(&self) -> (u32, u32);

    /// Time from one refresh to the next.
    fn refresh(&self) -> Duration;

    /// Checks that the projector is still connected, without disturbing it. A back-end whose driver
    /// cannot tell returns `Ok`.
    ///
    /// # Errors
    /// `Disconnected` if it is gone.
    fn present(&self) -> Result<(), Error> {
        Ok(())
    }

    /// Whether light may come seconds after it was opened: opening sets the mode, and a projector
    /// has to lock on to its signal.
    fn starts_dark(&self) -> bool {
        false
    }

    /// What the projector's controller said of itself when it was last asked; `None` if there is
    /// none to ask.
    fn controller(&self) -> Option<ControllerState> {
        None
    }

    /// Replaces the patterns behind the first `kept`; nothing is shown until [`Projector::queue`].
    ///
    /// # Errors
    /// `Unsupported` if a raster does not have the projector's size or the projector shows nothing
    /// but what was recorded, `Protocol` if fewer than `kept` patterns are loaded.
    fn load_behind(&mut self, kept: usize, rasters: Vec<Raster>) -> Result<(), Error>;

    /// Replaces all patterns.
    ///
    /// # Errors
    /// `Unsupported` if a raster does not have the projector's size.
    fn load(&mut self, rasters: Vec<Raster>) -> Result<(), Error> {
        self.load_behind(0, rasters)
    }

    /// Queues pattern `index` for the next refresh and returns at once.
    ///
    /// # Errors
    /// `Protocol` if no such pattern is loaded or another one is still queued.
    fn queue(&mut self, index: usize) -> Result<(), Error>;

    /// The flip that has happened since the last call, if any; there is one for each queued
    /// pattern. Does not wait.
    ///
    /// # Errors
    /// `Disconnected` if the projector is gone.
    fn poll_flip(&mut self) -> Result<Option<Flip>, Error>;

    /// Shows black; a flip that is still queued is discarded and never reported.
    ///
    /// # Errors
    /// The device's error.
    fn blank(&mut self) -> Result<(), Error>;
}

/// Checks that the patterns which are to stay are among the `loaded` ones.
///
/// # Errors
/// `Protocol` if they are not.
pub(crate) fn all_kept(kept: usize, loaded: usize) -> Result<(), Error> {
    match kept <= loaded {
        true => Ok(()),
        false => Err(Error::protocol(
            format!("loading patterns behind the first {kept} of {loaded}"),
            "load the first ones before",
        )),
    }
}

/// Checks that all rasters have the projector's size (width, height).
///
/// # Errors
/// `Unsupported`, naming the first raster of another size.
pub(crate) fn all_of_size(rasters: &[Raster], (width, height): (u32, u32)) -> Result<(), Error> {
    let wrong = |raster: &&Raster| (raster.width(), raster.height()) != (width, height);
    let Some((index, raster)) = rasters.iter().enumerate().find(|(_, raster)| wrong(raster)) else {
        return Ok(());
    };
    Err(Error::unsupported(
        format!(
            "loading raster {index} of {}×{}",
            raster.width(),
            raster.height()
        ),
        format!("make it {width}×{height}, the projector's size"),
    ))
}

/// The words of the bits that are set.
fn set(bits: u16, words: &'static [&'static str]) -> impl Iterator<Item = &'static str> {
    let words = words.iter().enumerate();
    words.filter_map(move |(bit, word)| (bits >> bit & 1 == 1).then_some(*word))
}
