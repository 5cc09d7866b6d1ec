//! The projector of a head: patterns are loaded, then shown by their index.

use std::time::Duration;

use crate::controller::ControllerState;
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
