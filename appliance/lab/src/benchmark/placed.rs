//! Where the frames of a set lie in memory: packed in one allocation, or as cameras deliver them.

/// Bytes of a line of the cache.
pub const LINE: usize = 64;
/// Every frame that lies apart begins at a multiple of this many bytes: a page of a Raspberry Pi 5.
const PAGE: usize = 16 << 10;

/// The samples of the frames of a set.
#[derive(Clone)]
pub enum Placed<T: Copy + Default> {
    /// One after the other, without padding.
    Packed(Vec<T>),
    /// Each in a mapping of its own that begins at a page of 16 KiB, as the buffers of a camera do.
    /// Equal pixels of all frames then compete for the same sets of the first-level cache, whose
    /// size divided by its ways is 16 KiB on the processors of a Raspberry Pi.
    Apart(Vec<Mapping<T>>),
}

impl<T: Copy + Default> Placed<T> {
    /// The frames. Packed ones have `pixels` samples each; samples after the last whole frame are
    /// left out.
    pub fn frames(&self, pixels: usize) -> Box<dyn Iterator<Item = &[T]> + '_> {
        match self {
            Self::Packed(all) => Box::new(all.chunks_exact(pixels.max(1))),
            Self::Apart(mappings) => Box::new(mappings.iter().map(Mapping::samples)),
        }
    }

    /// Packed frames of `pixels` samples in mappings of their own, rows of `width` samples `stride`
    /// apart.
    pub fn apart(&self, pixels: usize, width: usize, stride: usize) -> Self {
        let padded = |frame: &[T]| {
            let rows = frame.chunks(width.max(1));
            let mut mapping = Mapping::new(rows.len() * stride);
            for (to, from) in mapping.samples_mut().chunks_mut(stride.max(1)).zip(rows) {
                to[..from.len()].copy_from_slice(from);
            }
            mapping
        };
        Self::Apart(self.frames(pixels).map(padded).collect())
    }
}

/// An array that begins at a multiple of [`PAGE`] bytes.
///
/// The allocator maps an array of a megabyte and more by itself
/// (`appliance::system::computing::give_back`), so one of the size of a camera's frame shares no page
/// with another.
pub struct Mapping<T: Copy + Default> {
    memory: Vec<T>,
    start: usize,
    len: usize,
}

impl<T: Copy + Default> Mapping<T> {
    fn new(len: usize) -> Self {
        let memory = vec![T::default(); len + PAGE / size_of::<T>()];
        let start = memory.as_ptr().align_offset(PAGE);
        Self { memory, start, len }
    }

    fn samples(&self) -> &[T] {
        &self.memory[self.start..][..self.len]
    }

    fn samples_mut(&mut self) -> &mut [T] {
        &mut self.memory[self.start..][..self.len]
    }
}

impl<T: Copy + Default> Clone for Mapping<T> {
    fn clone(&self) -> Self {
        let mut clone = Self::new(self.len);
        clone.samples_mut().copy_from_slice(self.samples());
        clone
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_that_lie_apart_begin_at_pages_and_keep_their_rows() {
        let packed = Placed::Packed((0..2 * 6).collect::<Vec<u16>>());
        let apart = packed.apart(6, 3, 32).clone();
        let frames: Vec<_> = apart.frames(6).collect();
        assert_eq!(frames.len(), 2);
        for (frame, packed) in frames.iter().zip(packed.frames(6)) {
            assert_eq!(frame.as_ptr().align_offset(PAGE), 0);
            assert_eq!(frame.len(), 2 * 32);
            assert_eq!((&frame[..3], &frame[32..35]), packed.split_at(3));
        }
    }
}
