//! Frames of any samples, decoded in all ways that must give the same bits.

use algo::frame::{FrameView, Samples};
use algo::pattern::{PhaseRange, Sequence, Shot};
use algo::phase::{Decoder, LeastModulation, Trust};
use algo::pipeline::{self, PhaseMap, Window};
use algo::simd::Backend;
use algo::units::AbsolutePhase;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::OnceLock;
use tests::oracle::unwrap::{Form, recognise};
use tests::oracle::{Level, PixelTwin, Scale, levels_from};

/// Frames of a sequence, and everything to decode them.
#[derive(Clone, Debug)]
pub struct Stack {
    pub width: usize,
    pub height: usize,
    /// Distance of rows in samples; those between the end of a row and the next row are not part of
    /// the picture.
    pub stride: usize,
    pub bit_depth: u8,
    /// The ratio and shift of each frame.
    pub frames: Vec<Shot>,
    /// Range of the phase function.
    pub range: PhaseRange,
    /// The known map, row-major, for the forms that need one.
    pub map: Option<Vec<AbsolutePhase>>,
    /// From which modulation on it is decoded.
    pub least: LeastModulation,
    samples: Vec<Vec<u16>>,
}

/// Converts the samples of a stack to what a camera delivers.
enum Delivered {
    Eight(Vec<Vec<u8>>),
    Sixteen(Vec<Vec<u16>>),
}

impl Stack {
    /// Dark frames without gaps between rows.
    pub fn dark(
        (width, height): (usize, usize),
        bit_depth: u8,
        frames: Vec<Shot>,
        (min, max): (f64, f64),
    ) -> Self {
        let samples = vec![vec![0; width * height]; frames.len()];
        Self {
            width,
            height,
            stride: width,
            bit_depth,
            frames,
            range: PhaseRange { min, max },
            map: None,
            least: LeastModulation::default(),
            samples,
        }
    }

    /// The same frames with another stride. The gaps contain the brightest sample of the type, so
    /// reading them is noticed.
    pub fn with_stride(mut self, stride: usize) -> Self {
        let gap = if self.bit_depth == 8 { 255 } else { u16::MAX };
        for frame in &mut self.samples {
            let mut spaced = vec![gap; stride * self.height];
            for (row, old) in frame.chunks(self.stride.max(1)).enumerate() {
                spaced[row * stride..][..self.width].copy_from_slice(&old[..self.width]);
            }
            *frame = spaced;
        }
        self.stride = stride;
        self
    }

    /// Full scale in counts.
    pub fn full_scale(&self) -> u16 {
        ((1_u32 << self.bit_depth) - 1) as u16
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.width * self.height
    }

    /// The sample of a frame at a pixel (row-major).
    pub fn sample(&self, frame: usize, pixel: usize) -> u16 {
        self.samples[frame][pixel / self.width * self.stride + pixel % self.width]
    }

    /// Sets the sample of a frame at a pixel (row-major).
    pub fn set(&mut self, frame: usize, pixel: usize, sample: u16) {
        self.samples[frame][pixel / self.width * self.stride + pixel % self.width] = sample;
    }

    /// Sets every sample, from the frame and the pixel (row-major).
    pub fn fill(&mut self, mut sample: impl FnMut(usize, usize) -> u16) {
        for frame in 0..self.frames.len() {
            for pixel in 0..self.pixels() {
                self.set(frame, pixel, sample(frame, pixel));
            }
        }
    }

    /// The levels for the textbook, from coarse to fine.
    pub fn levels(&self) -> Vec<Level> {
        let frames = self.frames.iter().enumerate();
        levels_from(frames.map(|(place, shot)| (place, shot.ratio, shot.shift)))
    }

    /// How the textbook unwraps the levels.
    pub fn form(&self) -> Form {
        let ratios: Vec<f64> = self.levels().iter().map(|level| level.ratio).collect();
        recognise(&ratios, (self.range.min, self.range.max)).expect("ratios of a form")
    }

    /// The textbook's result for every pixel.
    pub fn twins(&self) -> Vec<PixelTwin> {
        let (levels, form) = (self.levels(), self.form());
        let scale = Scale {
            full: f64::from(self.full_scale()),
            least: self.least.counts(self.full_scale()),
        };
        let twin = |pixel| {
            let samples: Vec<Vec<f64>> = levels
                .iter()
                .map(|level| {
                    let frames = level.frames.iter();
                    frames.map(|&f| f64::from(self.sample(f, pixel))).collect()
                })
                .collect();
            let map = || match &self.map {
                Some(map) if map[pixel].is_known() => map[pixel].turns(),
                _ => f64::NAN,
            };
            PixelTwin::of(form, &levels, &samples, scale, map)
        };
        (0..self.pixels()).map(twin).collect()
    }

    /// Decodes with one and with two threads and on every back-end, and checks that all give the
    /// same bits, and that rejected pixels have no phase.
    pub fn decode(&self) -> PhaseMap {
        self.decode_in(None)
    }

    /// As [`Self::decode`], but decodes only `window`.
    pub fn decode_in(&self, window: Option<Window<'_>>) -> PhaseMap {
        let delivered = self.deliver();
        let views = delivered.views(self);
        let mut first: Option<PhaseMap> = None;
        for (backend, decoder) in self.decoders() {
            for threads in [1, 2] {
                let run = || pipeline::decode(&decoder, &views, self.map.as_deref(), window);
                let map = pool(threads).install(run).expect("frames of the plan");
                check_canonical(&map);
                match &first {
                    None => first = Some(map),
                    Some(first) => assert!(
                        *first == map,
                        "{backend} with {threads} threads writes other bits than the first: {self:?}"
                    ),
                }
            }
        }
        first.expect("at least one back-end")
    }

    /// The plan with the default back-end.
    pub fn decoder(&self) -> Decoder {
        let sequence = Sequence::from_frames(&self.frames).expect("a sequence");
        Decoder::new(&sequence, self.range, self.bit_depth)
            .expect("a sequence that can be decoded")
            .with_least_modulation(self.least)
    }

    /// The plan for every back-end that runs on this machine, with the back-end's name. Only this
    /// function of the suite uses back-ends.
    fn decoders(&self) -> Vec<(&'static str, Decoder)> {
        Backend::available()
            .map(|backend| (backend.name(), self.decoder().with_backend(backend)))
            .collect()
    }

    fn deliver(&self) -> Delivered {
        let eight = |frame: &Vec<u16>| frame.iter().map(|&sample| sample as u8).collect();
        match self.bit_depth {
            8 => Delivered::Eight(self.samples.iter().map(eight).collect()),
            _ => Delivered::Sixteen(self.samples.clone()),
        }
    }
}

impl Delivered {
    fn views(&self, stack: &Stack) -> Vec<FrameView<'_>> {
        let frames: Vec<Samples<'_>> = match self {
            Self::Eight(frames) => frames.iter().map(|f| Samples::Eight(f)).collect(),
            Self::Sixteen(frames) => frames.iter().map(|f| Samples::Sixteen(f)).collect(),
        };
        let view =
            |samples| FrameView::new(samples, stack.width, stack.height, stack.stride).unwrap();
        frames.into_iter().map(view).collect()
    }
}

/// The frames of levels with these ratios.
pub fn shots(ratios: &[f64], shifts: usize) -> Vec<Shot> {
    let levels = ratios.iter().map(|&ratio| Shot::level(ratio, shifts));
    levels.flatten().collect()
}

/// A rejected pixel has no phase, and only a rejected pixel has none.
fn check_canonical(map: &PhaseMap) {
    for (pixel, (trust, phase)) in map.trust.iter().zip(&map.phase).enumerate() {
        assert_eq!(*trust == Trust::Resolved, phase.is_known(), "pixel {pixel}");
        assert_ne!(*trust, Trust::OutOfRange, "no height was looked for");
    }
}

/// A pool of one or two threads, created once.
pub fn pool(threads: usize) -> &'static ThreadPool {
    static POOLS: [OnceLock<ThreadPool>; 2] = [const { OnceLock::new() }; 2];
    POOLS[threads - 1].get_or_init(|| {
        let builder = ThreadPoolBuilder::new().num_threads(threads);
        builder.build().expect("a pool of threads")
    })
}
