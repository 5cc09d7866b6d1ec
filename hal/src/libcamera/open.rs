//! Opening a camera: find it by its id, acquire it, negotiate a format, configure it, allocate and
//! map its buffers.
//!
//! A camera's driver allocates buffers that the processor does not cache, and reading them takes
//! many times as long. So they are taken from a heap of cached memory where there is one, and each
//! reading is framed by the calls that keep the cache right (`DMA_BUF_IOCTL_SYNC`; rpicam-apps does
//! the same, in `core/dma_heaps.cpp` and `core/buffer_sync.cpp`).

use std::io;
use std::os::fd::{AsRawFd, OwnedFd};

use ::libcamera::camera::{ActiveCamera, Camera, CameraConfiguration};
use ::libcamera::camera_manager::CameraManager;
use ::libcamera::control::{ControlEntry, ControlInfo};
use ::libcamera::controls;
use ::libcamera::framebuffer::{AsFrameBuffer, FrameBufferPlane, OwnedFrameBuffer};
use ::libcamera::framebuffer_allocator::FrameBufferAllocator;
use ::libcamera::geometry::Size;
use ::libcamera::pixel_format::PixelFormat;
use ::libcamera::request::Request;
use ::libcamera::stream::{Stream, StreamRole};
use dma_buf::{DmaBuf, MappedDmaBuf};
use dma_heap::{Heap, HeapKind};
use filedescriptor::FileDescriptor;

use super::Settings;
use super::layout::{Granted, Readable, Reading, choose, sensor_bits, worth_asking};
use crate::error::{DeviceKind, Error};
use crate::frame::{FrameFormat, Pixels};

/// The heap of cached memory that cameras can write to, by the name that Raspberry Pi OS gives it:
/// the system's heap on a Pi 5, the contiguous one on a Pi 4 and older.
const CACHED: &str = "/dev/dma_heap/vidbuf_cached";

/// The format and buffers of a configured camera.
#[derive(Clone, Copy, Debug)]
pub(super) struct Configured {
    pub readable: Readable,
    pub format: FrameFormat,
    /// Rows of the sensor's pictures.
    pub rows: u32,
    /// Bytes from the start of one row of a buffer to the next.
    pub stride: usize,
    /// Buffers that the camera has.
    pub buffers: usize,
    /// Whether the processor caches them.
    pub cached: bool,
}

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
    fn of(buffer: &impl AsFrameBuffer, length: usize) -> Result<Self, Error> {
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

/// A request and the memory of its buffer.
pub(super) struct Slot {
    /// None while the library has it.
    pub request: Option<Request>,
    pub memory: Mapped,
}

/// A configured camera. Its parts must be dropped in this order, and the camera manager after them.
pub(super) struct Opened {
    pub slots: Vec<Slot>,
    pub stream: Stream,
    _allocator: FrameBufferAllocator,
    pub camera: ActiveCamera<'static>,
    pub id: String,
    pub configured: Configured,
}

/// What to do where the library lists no camera. A module of image algorithms (IPA) that is not
/// signed with the library's key runs in a process of its own, in user and network namespaces of
/// its own (libcamera, `Process::isolate`); where these are forbidden, its cameras are missing.
const NO_CAMERA: &str = "libcamera finds no camera at all: check cable and overlay, and that this user may open /dev/media* (group `video`). \
     If libcamera's messages say \"Failed to start proxy worker process\" (before 0.6: \"Failed to unshare execution context\"), its algorithms (IPA modules) are not signed for it and need \
     namespaces, which RestrictNamespaces= of the service forbids: install libcamera and libcamera-ipa of one source";

/// The error for a call that the library refused.
pub(super) fn refused(id: &str, attempt: &str, cause: &io::Error) -> Error {
    let attempt = format!("{attempt} the camera `{id}`");
    match cause.kind() {
        io::ErrorKind::ResourceBusy => Error::protocol(
            format!("{attempt}: another program uses it"),
            "stop that program",
        ),
        io::ErrorKind::PermissionDenied => Error::protocol(
            format!("{attempt}: {cause}"),
            "add the user of this program to the group `video`",
        ),
        io::ErrorKind::OutOfMemory => Error::unsupported(
            attempt,
            "there is not enough memory for its buffers: give more (on a Raspberry Pi \"dtoverlay=vc4-kms-v3d,cma-512\")",
        ),
        _ if cause.raw_os_error() == Some(rustix::io::Errno::NODEV.raw_os_error()) => {
            Error::disconnected(DeviceKind::Camera, attempt)
        }
        _ => Error::protocol(
            format!("{attempt}: {cause}"),
            "see libcamera's messages on the standard error output",
        ),
    }
}

/// Opens the camera with these settings.
///
/// # Errors
/// `Disconnected` if there is no camera, or none of that id; `Unsupported` if there are several and
/// no id is given, if the camera does not support the settings, or if there is no memory for
/// buffers; `Protocol` if it is in use or the library fails.
pub(super) fn open(manager: &CameraManager, settings: &Settings) -> Result<Opened, Error> {
    let found = find(manager, settings.id.as_deref())?;
    let id = found.id();
    let mut camera = found
        .acquire()
        .map_err(|cause| refused(id, "acquiring", &cause))?;
    if settings.controlled {
        must_be_settable(&camera, id, settings)?;
    }
    let (mut configuration, readable) = agree(&camera, id, settings)?;
    camera
        .configure(&mut configuration)
        .map_err(|cause| refused(id, "configuring", &cause))?;
    let granted = configuration.get(0).ok_or_else(|| no_stream(id))?;
    let size = (granted.get_size().width, granted.get_size().height);
    let stride = granted.get_stride() as usize;
    let (format, length) = readable.frames(size, stride)?;
    let stream = granted.stream().ok_or_else(|| no_stream(id))?;

    let mut allocator = FrameBufferAllocator::new(&camera);
    let mut slots = Vec::new();
    // A buffer from the heap has one plane.
    if readable.reading != Reading::Luma {
        let size = granted.get_frame_size() as usize;
        for index in 0..granted.get_buffer_count() as usize {
            let Some((buffer, memory)) = cached_buffer(size, length)? else {
                break;
            };
            slots.push(slot(&mut camera, id, index, buffer, memory, &stream)?);
        }
    }
    let cached = !slots.is_empty();
    if !cached {
        let allocated = allocator
            .alloc(&stream)
            .map_err(|cause| refused(id, "allocating buffers of", &cause))?;
        for (index, buffer) in allocated.into_iter().enumerate() {
            let memory = Mapped::of(&buffer, length)?;
            slots.push(slot(&mut camera, id, index, buffer, memory, &stream)?);
        }
    }
    let configured = Configured {
        readable,
        format,
        rows: size.1,
        stride,
        buffers: slots.len(),
        cached,
    };
    Ok(Opened {
        slots,
        stream,
        _allocator: allocator,
        camera,
        id: id.to_owned(),
        configured,
    })
}

fn slot(
    camera: &mut ActiveCamera<'static>,
    id: &str,
    index: usize,
    buffer: impl AsFrameBuffer + 'static,
    memory: Mapped,
    stream: &Stream,
) -> Result<Slot, Error> {
    let mut request = camera
        .create_request(Some(index as u64))
        .ok_or_else(|| no_stream(id))?;
    request
        .add_buffer(stream, buffer)
        .map_err(|cause| refused(id, "adding a buffer of", &cause))?;
    Ok(Slot {
        request: Some(request),
        memory,
    })
}

/// Takes a buffer of `size` bytes from the heap of cached memory, and maps its first `length`
/// bytes; `None` if there is no such heap.
///
/// # Errors
/// `Unsupported` if it has no memory left; `Protocol` if the buffer cannot be used.
fn cached_buffer(size: usize, length: usize) -> Result<Option<(OwnedFrameBuffer, Mapped)>, Error> {
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

/// The camera of this id, or the only one.
fn find(manager: &CameraManager, id: Option<&str>) -> Result<Camera<'static>, Error> {
    let cameras = manager.cameras();
    let mut all: Vec<Camera<'static>> =
        cameras.iter().filter_map(|c| manager.get(c.id())).collect();
    let there: Vec<String> = all
        .iter()
        .map(|camera| format!("`{}`", camera.id()))
        .collect();
    let there = there.join(", ");
    if let Some(at) = all
        .iter()
        .position(|camera| id.is_none_or(|id| id == camera.id()))
    {
        if id.is_none() && all.len() > 1 {
            return Err(Error::unsupported(
                format!("choosing among the cameras {there}"),
                "set head.camera.id to one of them",
            ));
        }
        return Ok(all.swap_remove(at));
    }
    Err(Error::Disconnected {
        device: DeviceKind::Camera,
        attempt: id.map_or("opening a camera".into(), |id| {
            format!("opening the camera `{id}`")
        }),
        remedy: if all.is_empty() {
            NO_CAMERA.into()
        } else {
            format!("check its cable, or set head.camera.id to one that is there: {there}")
        },
    })
}

fn no_stream(id: &str) -> Error {
    Error::protocol(
        format!("configuring the camera `{id}`: the library gave no stream"),
        "see libcamera's messages on the standard error output",
    )
}

/// Checks that exposure, gain and frame length can be set, and that the sensor has the gain: the
/// library takes the nearest that it has.
fn must_be_settable(camera: &Camera<'_>, id: &str, settings: &Settings) -> Result<(), Error> {
    let all = camera.controls();
    let missing: Vec<&str> = [
        ("exposure", controls::ExposureTime::ID),
        ("gain", controls::AnalogueGain::ID),
        ("frame period", controls::FrameDurationLimits::ID),
    ]
    .into_iter()
    .filter_map(|(name, control)| all.find(control).is_err().then_some(name))
    .collect();
    if missing.is_empty() {
        return match all.find(controls::AnalogueGain::ID).map(limits) {
            Ok(Some((least, most))) => settings.exposing.check_gain(id, least, most),
            _ => Ok(()),
        };
    }
    Err(Error::unsupported(
        format!("setting the {} of the camera `{id}`", missing.join(", ")),
        "use a camera that has these controls: nothing can be measured with an unknown exposure",
    ))
}

/// The least and the largest value of a control; none where the camera states none.
fn limits(control: &ControlInfo) -> Option<(f32, f32)> {
    let (least, most) = (control.min().try_into(), control.max().try_into());
    least
        .ok()
        .zip(most.ok())
        .filter(|(least, most)| least < most)
}

/// Asks for every format that has the wanted samples ([`Reading`]), and returns the configuration
/// of the best one that was granted.
fn agree(
    camera: &Camera<'_>,
    id: &str,
    settings: &Settings,
) -> Result<(CameraConfiguration, Readable), Error> {
    let mut offers = Vec::new();
    for role in [StreamRole::Raw, StreamRole::VideoRecording] {
        let raw = matches!(role, StreamRole::Raw);
        for asked in worth_asking(settings.reading).filter(|f| (f.reading == Reading::Raw) == raw) {
            // A camera need not have both roles.
            let Some(configuration) = camera.generate_configuration(&[role]) else {
                break;
            };
            let format = PixelFormat::parse(asked.name);
            offers.extend(format.and_then(|format| ask(configuration, Some(format), settings)));
        }
    }
    if offers.is_empty() {
        // For the error message: the format that the camera proposes by itself.
        let unasked = camera.generate_configuration(&[StreamRole::VideoRecording]);
        offers.extend(unasked.and_then(|configuration| ask(configuration, None, settings)));
    }
    let granted: Vec<Granted> = offers.iter().map(|(granted, _)| granted.clone()).collect();
    let (best, readable) = choose(id, settings.reading, settings.size, &granted)?;
    let configuration = offers.swap_remove(best).1;
    let listed: Vec<_> = configuration.get(0).map_or_else(Vec::new, |stream| {
        let formats = stream.formats();
        let sizes = |format| {
            let sizes = formats.sizes(format);
            sizes.iter().map(|size| (size.width, size.height)).collect()
        };
        let listed = formats.pixel_formats();
        listed
            .into_iter()
            .map(|format| (format.to_string(), sizes(format)))
            .collect()
    });
    let bits = sensor_bits(&listed, granted[best].size);
    Ok((configuration, readable.of_sensor(bits)))
}

/// Asks for a format; the camera may grant another format, or none.
fn ask(
    mut configuration: CameraConfiguration,
    format: Option<PixelFormat>,
    settings: &Settings,
) -> Option<(Granted, CameraConfiguration)> {
    let mut stream = configuration.get_mut(0)?;
    if let Some(format) = format {
        stream.set_pixel_format(format);
    }
    if let Some((width, height)) = settings.size {
        stream.set_size(Size { width, height });
    }
    stream.set_buffer_count(settings.buffers);
    if configuration.validate().is_invalid() {
        return None;
    }
    let stream = configuration.get(0)?;
    let size = stream.get_size();
    let granted = Granted {
        name: stream.get_pixel_format().to_string(),
        size: (size.width, size.height),
    };
    Some((granted, configuration))
}
