//! The memory of a camera's buffers: mapped once, lent with a frame, returned when the last clone of the frame is dropped.

use std::os::fd::{AsRawFd, OwnedFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::Sender;

use ::libcamera::framebuffer::{AsFrameBuffer, FrameBufferPlane, OwnedFrameBuffer};
use ::libcamera::framebuffer_map::MemoryMappedFrameBuffer;
use bytes::Bytes;
use filedescriptor::FileDescriptor;

use super::owner::Order;
use crate::error::Error;
use crate::frame::{Memory, Samples};

/// Maps the first `length` bytes of the first plane of a buffer; the mapping lasts as long as the result or a clone of it.
///
/// The mapping has its own descriptors, so it may outlive buffer, camera and library.
///
/// # Errors
/// `Protocol` if the plane is shorter or cannot be mapped.
pub(super) fn map(buffer: &impl AsFrameBuffer, length: usize) -> Result<Bytes, Error> {
    let failed = |cause: String| {
        Error::protocol(
            format!("mapping {length} bytes of a camera's buffer: {cause}"),
            "this is a defect of the camera's driver or a lack of memory: see the system's log",
        )
    };
    let planes = buffer.planes();
    let plane = planes
        .get(0)
        .ok_or_else(|| failed("it has no plane".into()))?;
    let offset = plane.offset().and_then(|offset| u32::try_from(offset).ok());
    let (Some(offset), true, Ok(length)) = (offset, plane.len() >= length, u32::try_from(length))
    else {
        return Err(failed(format!(
            "its first plane is of {} bytes",
            plane.len()
        )));
    };
    let own = || -> Result<OwnedFd, filedescriptor::Error> {
        Ok(FileDescriptor::dup(&plane.fd())?.as_file()?.into())
    };
    let fd = own().map_err(|cause| failed(cause.to_string()))?;
    let given = fd.as_raw_fd();
    let planes = vec![FrameBufferPlane { fd, offset, length }];
    let own = OwnedFrameBuffer::new(planes, None).map_err(|cause| failed(cause.to_string()))?;
    // The crate libcamera 0.7.0 takes the descriptor, gives a duplicate of it to the library, and leaks the original.
    if own.planes().get(0).is_some_and(|plane| plane.fd() != given) {
        let _ = nix::unistd::close(given);
    }
    let mapped = MemoryMappedFrameBuffer::new(own).map_err(|cause| failed(cause.to_string()))?;
    Ok(Bytes::from_owner(FirstPlane(mapped)))
}

struct FirstPlane(MemoryMappedFrameBuffer<OwnedFrameBuffer>);

impl AsRef<[u8]> for FirstPlane {
    fn as_ref(&self) -> &[u8] {
        self.0.data().first().copied().unwrap_or_default()
    }
}

/// A buffer in use: the camera does not write into it while this lives.
#[derive(Debug)]
pub(super) struct Lease {
    index: usize,
    bytes: Bytes,
    wide: bool,
    home: Sender<Order>,
    out: Arc<AtomicUsize>,
}

impl Lease {
    /// Lends buffer `index`, whose memory is `bytes`, holding 16-bit words if `wide`. It is returned to `home`; `out` counts the
    /// buffers in use.
    pub fn new(
        index: usize,
        bytes: Bytes,
        wide: bool,
        home: Sender<Order>,
        out: &Arc<AtomicUsize>,
    ) -> Self {
        out.fetch_add(1, Ordering::Relaxed);
        Self {
            index,
            bytes,
            wide,
            home,
            out: Arc::clone(out),
        }
    }

    /// The bytes of the buffer.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }
}

impl Memory for Lease {
    fn samples(&self) -> Samples<'_> {
        if !self.wide {
            return Samples::Eight(&self.bytes);
        }
        // A mapping starts at a page and a plane at an even offset; otherwise the cast fails, and `Frame::new` refuses the empty frame.
        Samples::Sixteen(bytemuck::try_cast_slice(&self.bytes).unwrap_or_default())
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        self.out.fetch_sub(1, Ordering::Relaxed);
        // Fails if the camera was closed; then there is nowhere to return the buffer to.
        let _ = self.home.send(Order::Free(self.index));
    }
}
