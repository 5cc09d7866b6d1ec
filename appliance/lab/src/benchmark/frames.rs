//! Sets of frames that kernels are timed on, and a rotation through copies of a set: with
//! `Effort::FULL` more than fit into any cache, with `Effort::QUICK` one.

use super::placed::{LINE, Placed};
use algo::frame::{FrameView, Samples};
use algo::phase::Trust;
use algo::pipeline::PhaseMap;
use algo::units::{AbsolutePhase, Modulation};
use hal::frame::Frame;

/// The frames of one sequence, the phase map that they are unwrapped about if the sequence needs
/// one, and memory for the result.
#[derive(Clone)]
pub struct FrameSet {
    width: usize,
    height: usize,
    /// Samples from one row to the next.
    stride: usize,
    samples: Buffer,
    map: Option<Vec<AbsolutePhase>>,
    /// The result of the kernel.
    pub out: PhaseMap,
}

/// All frames of a set, each row-major.
#[derive(Clone)]
pub enum Buffer {
    /// 8 bits.
    Eight(Placed<u8>),
    /// 9 to 16 bits.
    Sixteen(Placed<u16>),
}

impl FrameSet {
    /// Packed frames of `width` × `height` samples without padding, and the map for sequences that
    /// need one. Samples beyond the last whole frame are not used.
    pub fn new(
        (width, height): (usize, usize),
        samples: Buffer,
        map: Option<Vec<AbsolutePhase>>,
    ) -> Self {
        let mut out = PhaseMap::new(width, height);
        // Written, so that the system maps the memory before the first run.
        out.modulation.fill(Modulation::from_bits(1));
        out.trust.fill(Trust::Dark);
        Self {
            width,
            height,
            stride: width,
            samples,
            map,
            out,
        }
    }

    /// This set as a camera delivers frames: each in a mapping of its own ([`Placed::Apart`]), its
    /// rows padded to whole lines of the cache. This set must have been made by [`FrameSet::new`].
    pub fn aligned(&self) -> Self {
        let samples_of_a_line = match &self.samples {
            Buffer::Eight(_) => LINE,
            Buffer::Sixteen(_) => LINE / 2,
        };
        let stride = self.width.next_multiple_of(samples_of_a_line);
        let samples = match &self.samples {
            Buffer::Eight(all) => Buffer::Eight(all.apart(self.pixels(), self.width, stride)),
            Buffer::Sixteen(all) => Buffer::Sixteen(all.apart(self.pixels(), self.width, stride)),
        };
        Self {
            stride,
            samples,
            ..self.clone()
        }
    }

    /// A set of a head's frames, which have equal format, without the padding of their rows.
    pub fn of(frames: &[Frame], map: Option<Vec<AbsolutePhase>>) -> Self {
        let (mut eight, mut sixteen) = (Vec::new(), Vec::new());
        let mut size = (0, 0);
        for frame in frames {
            let format = frame.format();
            size = (format.width as usize, format.height as usize);
            let stride = format.stride;
            match frame.samples() {
                hal::frame::Samples::Eight(samples) => {
                    let rows = samples.chunks(stride).take(size.1);
                    eight.extend(rows.flat_map(|row| &row[..size.0]));
                }
                hal::frame::Samples::Sixteen(samples) => {
                    let rows = samples.chunks(stride).take(size.1);
                    sixteen.extend(rows.flat_map(|row| &row[..size.0]));
                }
            }
        }
        let samples = if sixteen.is_empty() {
            Buffer::Eight(Placed::Packed(eight))
        } else {
            Buffer::Sixteen(Placed::Packed(sixteen))
        };
        Self::new(size, samples, map)
    }

    /// Number of pixels of a frame.
    pub fn pixels(&self) -> usize {
        self.width * self.height
    }

    /// Samples per row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// The frames.
    pub fn samples(&self) -> &Buffer {
        &self.samples
    }

    /// Frames, map and result, borrowed separately.
    pub fn parts(&mut self) -> (Vec<FrameView<'_>>, Option<&[AbsolutePhase]>, &mut PhaseMap) {
        let pixels = self.width * self.height;
        let frames: Vec<Samples<'_>> = match &self.samples {
            Buffer::Eight(all) => all.frames(pixels).map(Samples::Eight).collect(),
            Buffer::Sixteen(all) => all.frames(pixels).map(Samples::Sixteen).collect(),
        };
        let views = frames
            .into_iter()
            // Every frame has its rows at this stride, so this cannot fail.
            .filter_map(|frame| FrameView::new(frame, self.width, self.height, self.stride).ok())
            .collect();
        (views, self.map.as_deref(), &mut self.out)
    }

    /// Bytes that a kernel reads.
    fn bytes(&self) -> usize {
        let pixels = self.pixels();
        let frames = match &self.samples {
            Buffer::Eight(all) => pixels * all.frames(pixels).count(),
            Buffer::Sixteen(all) => 2 * pixels * all.frames(pixels).count(),
        };
        frames + 4 * self.map.as_ref().map_or(0, Vec::len)
    }
}

/// Copies of one set, used in turn.
pub struct Rotation {
    sets: Vec<FrameSet>,
    next: usize,
}

impl Rotation {
    /// As many copies as a kernel must decode to read at least `bytes` bytes of frames and maps; at
    /// least one.
    pub fn of(set: FrameSet, bytes: usize) -> Self {
        let copies = bytes.div_ceil(set.bytes().max(1)).max(1);
        Self {
            sets: vec![set; copies],
            next: 0,
        }
    }

    /// Number of copies.
    pub fn copies(&self) -> usize {
        self.sets.len()
    }

    /// The set that was used least recently.
    pub fn next(&mut self) -> &mut FrameSet {
        self.next = (self.next + 1) % self.sets.len();
        &mut self.sets[self.next]
    }
}
