//! Samples of a camera that clips below full scale, or bends from there on, as samples at full scale: what
//! uses frames knows one mark of a sample that says only that the light was brighter.

use crate::error::Error;
use crate::frame::{Frame, FrameFormat, Pixels, Pool, Samples};

/// Frames that may be kept before each further one costs an allocation.
const KEPT: usize = 64;

/// From which sample on a camera is not linear, and buffers for its frames.
pub(super) struct Clipping {
    from: u16,
    pool: Pool,
}

impl Clipping {
    /// For frames like these; none if all samples below full scale are linear.
    pub fn new(from: u16, format: FrameFormat) -> Option<Self> {
        (from < format.full_scale()).then(|| Self {
            from,
            pool: Pool::new(format, KEPT),
        })
    }

    /// The frame as it is, or of a camera that clips with full scale from there on.
    pub fn marked(of: &mut Option<Self>, frame: Frame) -> Result<Frame, Error> {
        match of {
            Some(clipping) => clipping.mark(&frame),
            None => Ok(frame),
        }
    }

    fn mark(&mut self, frame: &Frame) -> Result<Frame, Error> {
        let (from, full_scale) = (self.from, frame.format().full_scale());
        let marked = |sample: u16| if sample < from { sample } else { full_scale };
        let (time, count) = (frame.timestamp(), frame.count());
        self.pool
            .frame(time, count, |pixels| match (pixels, frame.samples()) {
                (Pixels::Eight(out), Samples::Eight(samples)) => {
                    for (out, &sample) in out.iter_mut().zip(samples) {
                        *out = marked(sample.into()) as u8;
                    }
                }
                (Pixels::Sixteen(out), Samples::Sixteen(samples)) => {
                    for (out, &sample) in out.iter_mut().zip(samples) {
                        *out = marked(sample);
                    }
                }
                // A camera has frames of one format.
                _ => {}
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Timestamp;
    use std::sync::Arc;

    #[test]
    fn samples_from_where_a_camera_clips_are_at_full_scale_and_others_as_they_were() {
        let bits = [(8, [0, 234, 235, 255]), (12, [0, 3999, 4000, 4095])];
        for (bit_depth, samples @ [_, below, from, full_scale]) in bits {
            let format = FrameFormat::packed(2, 2, bit_depth);
            let pixels = match bit_depth {
                8 => Pixels::Eight(samples.map(|sample| sample as u8).to_vec()),
                _ => Pixels::Sixteen(samples.to_vec()),
            };
            let frame = Frame::new(format, Arc::new(pixels), Timestamp(7), 9).unwrap();
            let marked = Clipping::new(from, format).unwrap().mark(&frame).unwrap();
            assert_eq!((marked.timestamp(), marked.count()), (Timestamp(7), 9));
            let expected = [0, below, full_scale, full_scale].map(f32::from);
            assert_eq!(marked.counts(), expected);
            assert!(Clipping::new(full_scale, format).is_none());
        }
    }
}
