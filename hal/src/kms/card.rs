//! A display card of the kernel: opening it, its properties, the pictures in its memory, and what its
//! errors mean.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use drm::buffer::{Buffer, DrmFourcc};
use drm::control::atomic::AtomicModeReq;
use drm::control::dumbbuffer::DumbBuffer;
use drm::control::{
    Device as ControlDevice, PlaneType, RawResourceHandle, ResourceHandle, framebuffer, property,
};
use drm::{ClientCapability, Device, DriverCapability};
use rustix::fs::OFlags;
use rustix::io::Errno;

use crate::error::{DeviceKind, Error};
use crate::projector::Raster;

/// Where the kernel lists its cards.
const CARDS: &str = "/dev/dri";
/// Pixel format: bytes blue, green, red, unused. Every driver supports it.
pub(super) const FORMAT: DrmFourcc = DrmFourcc::Xrgb8888;
/// Bytes of a pixel.
const PIXEL: usize = 4;

/// A card on which this program may set modes.
#[derive(Debug)]
pub(super) struct Card {
    file: File,
    pub path: PathBuf,
}

impl AsFd for Card {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.file.as_fd()
    }
}

impl Device for Card {}
impl ControlDevice for Card {}

impl Card {
    /// Opens a card with all its planes, for atomic commits. None if it has no display outputs,
    /// such as a 3-D accelerator.
    pub fn open(path: &Path) -> Result<Option<Self>, Error> {
        let attempt = || format!("opening the display card {}", path.display());
        let flags = OFlags::NONBLOCK | OFlags::CLOEXEC;
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags(flags.bits().cast_signed())
            .open(path)
            .map_err(|error| match error.kind() {
                io::ErrorKind::NotFound => Error::unsupported(
                    attempt(),
                    format!("there is no such card; there {}", listed(&paths())),
                ),
                _ => refused(attempt(), &error),
            })?;
        let card = Self {
            file,
            path: path.to_owned(),
        };
        let displays = card
            .resource_handles()
            .is_ok_and(|all| !all.crtcs().is_empty() && !all.connectors().is_empty());
        if !displays {
            return Ok(None);
        }
        card.set_client_capability(ClientCapability::UniversalPlanes, true)
            .and_then(|()| card.set_client_capability(ClientCapability::Atomic, true))
            .map_err(|_| {
                Error::unsupported(
                    format!("{}: atomic mode setting", attempt()),
                    "use a driver that has it, such as vc4-kms-v3d on a Raspberry Pi (not fkms)",
                )
            })?;
        let monotonic = card.get_driver_capability(DriverCapability::MonotonicTimestamp);
        if monotonic.unwrap_or(0) != 1 {
            return Err(Error::unsupported(
                format!("{}: stamping flips by CLOCK_MONOTONIC", attempt()),
                "remove drm.timestamp_monotonic from the kernel's command line",
            ));
        }
        Ok(Some(card))
    }

    /// Makes this program the one that sets modes (DRM master); the console is then not shown. The
    /// remedy names the usual causes of a refusal.
    pub fn own(&self) -> Result<(), Error> {
        self.acquire_master_lock().map_err(|_| {
            Error::unsupported(
                format!(
                    "becoming the program that sets modes on {}",
                    self.path.display()
                ),
                "stop the desktop, display manager or another program that shows something there; another user than root must belong to the group \"video\"",
            )
        })
    }

    /// A duplicate of the descriptor, which is readable when a flip has happened.
    pub fn descriptor(&self) -> Result<OwnedFd, Error> {
        let duplicate = self.as_fd().try_clone_to_owned();
        duplicate.map_err(|error| {
            refused(
                format!("duplicating the descriptor of {}", self.path.display()),
                &error,
            )
        })
    }

    /// The properties of an object.
    pub fn properties<H: ResourceHandle>(&self, of: H) -> Result<Properties, Error> {
        let failed = |error| {
            refused(
                format!("reading the properties of {}", self.path.display()),
                &error,
            )
        };
        let values = self.get_properties(of).map_err(failed)?;
        let mut all = Vec::new();
        for (&handle, &value) in &values {
            let info = self.get_property(handle).map_err(failed)?;
            let name = info.name().to_string_lossy().into_owned();
            all.push(Property { name, info, value });
        }
        Ok(Properties {
            object: of.into(),
            all,
        })
    }
}

/// A property of an object and its current value.
#[derive(Clone, Debug)]
pub(super) struct Property {
    pub name: String,
    pub info: property::Info,
    pub value: u64,
}

/// The properties of a connector, CRTC or plane.
#[derive(Clone, Debug)]
pub(super) struct Properties {
    pub object: RawResourceHandle,
    pub all: Vec<Property>,
}

impl Properties {
    /// The property of this name.
    pub fn named(&self, name: &str) -> Result<property::Handle, Error> {
        let found = self.all.iter().find(|property| property.name == name);
        found.map(|property| property.info.handle()).ok_or_else(|| {
            Error::unsupported(
                format!("setting the display property {name}"),
                "use a driver that has it",
            )
        })
    }

    /// Adds the property of this name with this value to a request.
    pub fn set(&self, request: &mut AtomicModeReq, name: &str, value: u64) -> Result<(), Error> {
        request.add_raw_property(self.object, self.named(name)?, value);
        Ok(())
    }

    /// Whether this is a plane of this type.
    pub fn is(&self, plane: PlaneType) -> bool {
        let kind = self.all.iter().find(|property| property.name == "type");
        kind.is_some_and(|kind| kind.value == u64::from(plane as u32))
    }
}

/// A picture in the card's memory, which is shown without copying.
#[derive(Debug)]
pub(super) struct Canvas {
    buffer: DumbBuffer,
    pub shown_as: framebuffer::Handle,
}

impl Canvas {
    /// A buffer of the card for pictures of this size; its content is undefined.
    pub fn new(card: &Card, (width, height): (u32, u32)) -> Result<Self, Error> {
        let attempt = || format!("making a display buffer of {width}×{height} pixels");
        let buffer = card
            .create_dumb_buffer((width, height), FORMAT, 32)
            .map_err(|error| refused(attempt(), &error))?;
        match card.add_framebuffer(&buffer, 24, 32) {
            Ok(shown_as) => Ok(Self { buffer, shown_as }),
            Err(error) => {
                let _ = card.destroy_dumb_buffer(buffer);
                Err(refused(attempt(), &error))
            }
        }
    }

    /// Draws a raster of the buffer's size.
    pub fn draw(&mut self, card: &Card, raster: &Raster) -> Result<(), Error> {
        let pitch = self.buffer.pitch() as usize;
        let mut memory = card
            .map_dumb_buffer(&mut self.buffer)
            .map_err(|error| refused("writing to a display buffer", &error))?;
        draw(raster, pitch, &mut memory);
        Ok(())
    }

    /// Frees the memory. If the card is gone, this fails and nothing remains to be done.
    pub fn free(&self, card: &Card) {
        let _ = card.destroy_framebuffer(self.shown_as);
        let _ = card.destroy_dumb_buffer(self.buffer);
    }
}

/// Writes grey levels as pixels, `pitch` bytes from row to row.
fn draw(raster: &Raster, pitch: usize, memory: &mut [u8]) {
    let width = raster.width() as usize;
    // Whole rows are copied from ordinary memory, as single bytes may be slow to write to the
    // card's.
    let mut line = vec![0; width * PIXEL];
    for (row, into) in raster
        .pixels()
        .chunks_exact(width)
        .zip(memory.chunks_mut(pitch))
    {
        for (grey, pixel) in row.iter().zip(line.chunks_exact_mut(PIXEL)) {
            pixel[..3].fill(*grey);
        }
        into[..line.len()].copy_from_slice(&line);
    }
}

/// All cards, sorted as text (card10 before card2).
pub(super) fn paths() -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(CARDS) else {
        return Vec::new();
    };
    let is_card = |path: &PathBuf| {
        path.file_name()
            .is_some_and(|name| name.to_string_lossy().starts_with("card"))
    };
    let mut all: Vec<PathBuf> = entries
        .flatten()
        .map(|entry| entry.path())
        .filter(is_card)
        .collect();
    all.sort();
    all
}

/// A list for a message that begins with "there": "is a, b", or "are none".
pub(super) fn listed(things: &[impl AsRef<Path>]) -> String {
    if things.is_empty() {
        return "are none".into();
    }
    let names: Vec<String> = things
        .iter()
        .map(|thing| thing.as_ref().display().to_string())
        .collect();
    format!("is {}", names.join(", "))
}

/// The error for a call that the kernel refused.
pub(super) fn refused(attempt: impl Into<String>, why: &io::Error) -> Error {
    let attempt = attempt.into();
    match Errno::from_io_error(why) {
        Some(Errno::NODEV | Errno::NXIO | Errno::IO) => {
            Error::disconnected(DeviceKind::Projector, attempt)
        }
        Some(Errno::ACCESS | Errno::PERM) => Error::unsupported(
            attempt,
            "let the user belong to the group \"video\", and stop other programs that show something there",
        ),
        Some(Errno::BUSY) => Error::protocol(
            attempt,
            "the flip before it has not happened yet: wait for it first",
        ),
        Some(Errno::NOMEM | Errno::NOSPC) => Error::unsupported(
            attempt,
            "there is not enough memory for display buffers: give more (on a Raspberry Pi \"dtoverlay=vc4-kms-v3d,cma-512\")",
        ),
        _ => Error::unsupported(attempt, format!("the kernel says: {why}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_raster_is_drawn_grey_for_grey_whatever_lies_between_the_rows() {
        let raster = Raster::new(3, 2, vec![0, 1, 2, 253, 254, 255]).unwrap();
        for padding in [0, 4, 52] {
            let pitch = 3 * PIXEL + padding;
            let mut memory = vec![0xEE; 2 * pitch];
            draw(&raster, pitch, &mut memory);
            for (index, grey) in raster.pixels().iter().enumerate() {
                let at = index / 3 * pitch + index % 3 * PIXEL;
                assert_eq!(
                    memory[at..at + PIXEL],
                    [*grey, *grey, *grey, 0],
                    "pixel {index}, {padding} between"
                );
            }
            assert!(
                memory[3 * PIXEL..pitch].iter().all(|byte| *byte == 0xEE),
                "only pixels are written"
            );
        }
    }
}
