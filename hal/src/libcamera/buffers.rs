//! The memory of a camera's buffers: where it is from, and how it is read.
//!
//! A camera's driver allocates buffers that the processor does not cache, and reading them takes
//! many times as long. So they are taken from a heap of cached memory where there is one, and each
//! reading is framed by the calls that keep the cache right (`DMA_BUF_IOCTL_SYNC`; rpicam-apps does
//! the same, in `core/dma_heaps.cpp` and `core/buffer_sync.cpp`).

use std::os::fd::{AsRawFd, OwnedFd};

use ::libcamera::framebuffer::{AsFrameBuffer, FrameBufferPlane, OwnedFrameBuffer};
use dma_buf::{DmaBuf, MappedDmaBuf};
use dma_heap::{Heap, HeapKind};
use filedescriptor::FileDescriptor;

use crate::error::Error;
use crate::frame::Pixels;

/// The heap of cached memory that cameras can write to, by the name that Raspberry Pi OS gives it:
/// the system's heap on a Pi 5, the contiguous one on a Pi 4 and older.
pub(super) const CACHED: &str = "/dev/dma_heap/vidbuf_cached";

/// The first plane of a buffer, mapped for reading.
///
/// The mapping has a descriptor of its own, so it may outlive buffer, camera and library.
pub(super) struct Mapped {
    memory: MappedDmaBuf,
    /// The bytes of the plane in it.
    from: usize,
    length: usize,
}

impl Mapped {
    /// Maps the first `length` bytes of the first plane of a buffer.
    ///
    /// # Errors
    /// `Protocol` if the plane is shorter or cannot be mapped.
    pub fn of(buffer: &impl AsFrameBuffer, length: usize) -> Result<Self, Error> {
        let planes = buffer.planes();
        let plane = planes
            .get(0)
            .ok_or_else(|| unmapped(length, "it has no plane"))?;
        let (Some(from), true) = (plane.offset(), plane.len() >= length) else {
            let words = format!("its first plane is of {} bytes", plane.len());
            return Err(unmapped(length, words));
        };
        let own = || -> Result<OwnedFd, filedescriptor::Error> {
            Ok(FileDescriptor::dup(&plane.fd())?.as_file()?.into())
        };
        let fd = own().map_err(|cause| unmapped(length, cause))?;
        Self::new(fd, from, length)
    }

    fn new(fd: OwnedFd, from: usize, length: usize) -> Result<Self, Error> {
        let memory = DmaBuf::from(fd).memory_map();
        Ok(Self {
            memory: memory.map_err(|cause| unmapped(length, cause))?,
            from,
            length,
        })
    }

    /// Reads the plane with `copy`, which writes to `pixels`, while the processor may access it.
    ///
    /// # Errors
    /// `Protocol` if the kernel refuses the access.
    pub fn read(
        &self,
        pixels: &mut Pixels,
        copy: &dyn Fn(&[u8], &mut Pixels),
    ) -> Result<(), Error> {
        let plane = self.from..self.from + self.length;
        let read = |memory: &[u8], pixels: Option<&mut Pixels>| {
            if let (Some(bytes), Some(pixels)) = (memory.get(plane.clone()), pixels) {
                copy(bytes, pixels);
            }
            Ok(())
        };
        let read = self.memory.read(read, Some(pixels));
        read.map_err(|cause| {
            Error::protocol(
                format!("reading a camera's buffer: {cause}"),
                "see the system's log",
            )
        })
    }
}

/// Takes a buffer of `size` bytes from the heap of cached memory, and maps its first `length`
/// bytes; `None` if there is no such heap.
///
/// # Errors
/// `Unsupported` if it has no memory left; `Protocol` if the buffer cannot be used.
pub(super) fn cached(
    size: usize,
    length: usize,
) -> Result<Option<(OwnedFrameBuffer, Mapped)>, Error> {
    let Ok(heap) = Heap::new(HeapKind::Custom(CACHED.into())) else {
        return Ok(None);
    };
    let fd = heap.allocate(size).map_err(|cause| {
        Error::unsupported(
            format!("taking a camera's buffer of {size} bytes from {CACHED}: {cause}"),
            "give more memory to buffers (on a Raspberry Pi 4 \"dtoverlay=vc4-kms-v3d,cma-512\")",
        )
    })?;
    let lent = fd.try_clone().map_err(|cause| unmapped(length, cause))?;
    let given = lent.as_raw_fd();
    let plane = FrameBufferPlane {
        fd: lent,
        offset: 0,
        length: u32::try_from(size).unwrap_or(u32::MAX),
    };
    let buffer =
        OwnedFrameBuffer::new(vec![plane], None).map_err(|cause| unmapped(length, cause))?;
    // The crate libcamera 0.7.0 takes the descriptor, gives a duplicate of it to the library, and
    // leaks the original.
    if buffer
        .planes()
        .get(0)
        .is_some_and(|plane| plane.fd() != given)
    {
        let _ = nix::unistd::close(given);
    }
    Ok(Some((buffer, Mapped::new(fd, 0, length)?)))
}

fn unmapped(length: usize, cause: impl std::fmt::Display) -> Error {
    Error::protocol(
        format!("mapping {length} bytes of a camera's buffer: {cause}"),
        "this is a defect of the camera's driver or a lack of memory: see the system's log",
    )
}
