//! A head whose devices are closed: it keeps their properties, and every call fails with
//! `Disconnected`.
//!
//! A device can be open only once, so a lost head must be closed before it can be opened again.

use std::time::Duration;

use super::Head;
use crate::camera::{Camera, CameraTiming, Encoding};
use crate::clock::Monotonic;
use crate::error::{DeviceKind, Error};
use crate::frame::{Frame, FrameFormat};
use crate::projector::{Flip, Projector, Raster};
use crate::trigger::NoTrigger;

/// The properties of the devices that were closed.
#[derive(Clone, Debug)]
struct Closed {
    format: FrameFormat,
    encoding: Encoding,
    timing: CameraTiming,
    size: (u32, u32),
    refresh: Duration,
}

impl Head {
    /// A closed head with the properties of this one.
    pub fn closed(&self) -> Self {
        let like = Closed {
            format: self.camera_format(),
            encoding: self.encoding(),
            timing: self.camera_timing(),
            size: self.projector_size(),
            refresh: self.refresh(),
        };
        let mut closed = Self::new(
            Box::new(like.clone()),
            Box::new(like),
            Box::new(NoTrigger),
            Box::new(Monotonic::default()),
            self.timing(),
        );
        // The camera's timing is that of so many exposures.
        closed.devices.exposures = self.devices.exposures;
        closed
    }
}

fn gone<T>(device: DeviceKind) -> Result<T, Error> {
    Err(Error::disconnected(device, "using a head that is closed"))
}

impl Camera for Closed {
    fn format(&self) -> FrameFormat {
        self.format
    }

    fn encoding(&self) -> Encoding {
        self.encoding.clone()
    }

    fn timing(&self) -> CameraTiming {
        self.timing
    }

    fn present(&self) -> Result<(), Error> {
        gone(DeviceKind::Camera)
    }

    fn start(&mut self) -> Result<(), Error> {
        gone(DeviceKind::Camera)
    }

    fn poll_frame(&mut self) -> Result<Option<Frame>, Error> {
        gone(DeviceKind::Camera)
    }

    fn stop(&mut self) -> Result<(), Error> {
        Ok(())
    }
}

impl Projector for Closed {
    fn size(&self) -> (u32, u32) {
        self.size
    }

    fn refresh(&self) -> Duration {
        self.refresh
    }

    fn present(&self) -> Result<(), Error> {
        gone(DeviceKind::Projector)
    }

    fn load_behind(&mut self, _: usize, _: Vec<Raster>) -> Result<(), Error> {
        gone(DeviceKind::Projector)
    }

    fn queue(&mut self, _: usize) -> Result<(), Error> {
        gone(DeviceKind::Projector)
    }

    fn poll_flip(&mut self) -> Result<Option<Flip>, Error> {
        gone(DeviceKind::Projector)
    }

    fn blank(&mut self) -> Result<(), Error> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::error::ErrorKind;
    use crate::head::tests::{labelled, plain};
    use std::time::Duration;

    #[test]
    fn a_closed_head_is_what_it_was_like_and_measures_nothing() {
        let head = labelled(plain(), 1);
        let mut closed = head.closed();
        assert_eq!(
            (closed.camera_format(), closed.projector_size()),
            (head.camera_format(), head.projector_size())
        );
        assert_eq!(closed.timing(), head.timing());
        let answers = [
            closed.present(),
            closed.load(Vec::new()),
            closed
                .acquire(&[0], Duration::ZERO, &mut |_, _| ())
                .map(|_| ()),
        ];
        for answer in answers {
            assert_eq!(answer.unwrap_err().kind(), ErrorKind::Disconnected);
        }
    }
}
