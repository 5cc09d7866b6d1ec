//! Pixel formats of cameras: which one to use, which to refuse and why, and how samples are stored
//! in a buffer.
//!
//! The code here does not use the library; formats are known by its names for them ("R16", "NV12").

use crate::error::Error;
use crate::frame::{FrameFormat, Pixels};

/// Which samples of a camera's images are used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reading {
    /// The raw counts of a monochrome sensor, or of one of the two green planes of a colour sensor.
    #[default]
    Raw,
    /// Raw counts if available, else the luma plane of a YUV format, which an image processor has
    /// computed.
    Luma,
    /// The green samples of an RGB format. For trials with a camera that has nothing else.
    Green,
}

/// How the samples of a row are stored in a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Layout {
    /// A byte each.
    Bytes,
    /// Two bytes each, the lower one first.
    Words,
    /// Two bytes each, the lower one first; only so many upper bits are the sensor's: 8 to 15.
    UpperBits(u8),
    /// Four samples of 10 bits in five bytes: four upper bytes, then the lower bits of all four.
    FourInFive,
    /// Two samples of 12 bits in three bytes: two upper bytes, then the lower bits of both.
    TwoInThree,
    /// The middle byte of every three.
    MiddleOfThree,
}

/// A pixel format that can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Readable {
    /// The library's name of the format.
    pub name: &'static str,
    pub reading: Reading,
    pub layout: Layout,
    pub bits: u8,
    /// Column and row of the green pixel that is read of each 2×2 pixels of a colour sensor.
    pub green: Option<(usize, usize)>,
}

const fn readable(name: &'static str, reading: Reading, layout: Layout, bits: u8) -> Readable {
    Readable {
        name,
        reading,
        layout,
        bits,
        green: None,
    }
}

/// The raw formats of a colour sensor whose green pixels are in this column of the even rows. Green
/// sees most of white light, and has twice as many pixels as red and blue; those of the odd rows
/// are not read, as a picture that is made of both planes would be sampled unevenly, and
/// interpolated samples are no counts.
macro_rules! bayer {
    ($order:literal, $column:literal) => {
        [
            green(concat!($order, "16"), Layout::Words, 16, $column),
            green(concat!($order, "14"), Layout::Words, 14, $column),
            green(concat!($order, "12"), Layout::Words, 12, $column),
            green(concat!($order, "12_CSI2P"), Layout::TwoInThree, 12, $column),
            green(concat!($order, "10"), Layout::Words, 10, $column),
            green(concat!($order, "10_CSI2P"), Layout::FourInFive, 10, $column),
            green(concat!($order, "8"), Layout::Bytes, 8, $column),
        ]
    };
}

const fn green(name: &'static str, layout: Layout, bits: u8, column: usize) -> Readable {
    Readable {
        green: Some((column, 0)),
        ..readable(name, Reading::Raw, layout, bits)
    }
}

/// The formats of colour sensors, by the colours of the first two pixels of the first two rows.
const BAYER: [[Readable; 7]; 4] = [
    bayer!("SRGGB", 1),
    bayer!("SBGGR", 1),
    bayer!("SGRBG", 0),
    bayer!("SGBRG", 0),
];

/// Every format of monochrome and processed pictures that can be read, the best of each reading
/// first: more bits, then those that need no unpacking.
const FORMATS: [Readable; 19] = [
    readable("R16", Reading::Raw, Layout::Words, 16),
    readable("R14", Reading::Raw, Layout::Words, 14),
    readable("R12", Reading::Raw, Layout::Words, 12),
    readable("R12_CSI2P", Reading::Raw, Layout::TwoInThree, 12),
    readable("R10", Reading::Raw, Layout::Words, 10),
    readable("R10_CSI2P", Reading::Raw, Layout::FourInFive, 10),
    readable("R8", Reading::Raw, Layout::Bytes, 8),
    readable("YUV444", Reading::Luma, Layout::Bytes, 8),
    readable("YVU444", Reading::Luma, Layout::Bytes, 8),
    readable("YUV422", Reading::Luma, Layout::Bytes, 8),
    readable("YVU422", Reading::Luma, Layout::Bytes, 8),
    readable("YUV420", Reading::Luma, Layout::Bytes, 8),
    readable("YVU420", Reading::Luma, Layout::Bytes, 8),
    readable("NV24", Reading::Luma, Layout::Bytes, 8),
    readable("NV16", Reading::Luma, Layout::Bytes, 8),
    readable("NV12", Reading::Luma, Layout::Bytes, 8),
    readable("NV21", Reading::Luma, Layout::Bytes, 8),
    readable("BGR888", Reading::Green, Layout::MiddleOfThree, 8),
    readable("RGB888", Reading::Green, Layout::MiddleOfThree, 8),
];

/// Every format that can be read, the best of each reading first.
fn formats() -> impl Iterator<Item = &'static Readable> {
    FORMATS.iter().chain(BAYER.iter().flatten())
}

/// The format that a camera granted when it was asked for one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Granted {
    /// The library's name of the format.
    pub name: String,
    /// Columns and rows.
    pub size: (u32, u32),
}

/// The formats to ask a camera for. It may grant a different one, so all are asked for before one
/// is chosen.
pub(crate) fn worth_asking(reading: Reading) -> impl Iterator<Item = &'static Readable> {
    formats().filter(move |f| reading.takes(f.reading))
}

/// The index in `granted` of the best format, and how to read it.
///
/// # Errors
/// `Unsupported` if no format can be read, or none has the wanted size; the message says what is
/// wrong with each.
pub(crate) fn choose(
    camera: &str,
    reading: Reading,
    size: Option<(u32, u32)>,
    granted: &[Granted],
) -> Result<(usize, Readable), Error> {
    let fits = |g: &Granted| size.is_none_or(|size| size == g.size);
    let best = worth_asking(reading).find_map(|format| {
        let at = granted
            .iter()
            .position(|g| g.name == format.name && fits(g))?;
        Some((at, *format))
    });
    best.ok_or_else(|| {
        let mut offers: Vec<String> = granted
            .iter()
            .map(|g| match objection(reading, &g.name) {
                Some(objection) => format!("{} ({objection})", g.name),
                None => format!("{} of {}×{}", g.name, g.size.0, g.size.1),
            })
            .collect();
        offers.sort();
        offers.dedup();
        let offers = match &offers[..] {
            [] => "nothing".to_owned(),
            offers => offers.join(", "),
        };
        let wanted = size.map_or(String::new(), |(w, h)| format!(" of {w}×{h} pixels"));
        Error::unsupported(
            format!("taking {} frames{wanted} with the camera `{camera}`", reading.word()),
            format!("it grants {offers}; set head.camera.width and height to a size that it has, head.camera.luma for a YUV format, or take a camera with a raw one"),
        )
    })
}

/// The bits of a sensor in pictures of `size`, from the raw formats that its camera lists with
/// their sizes: those of the deepest mode of that size, which a camera uses when it is asked for 16
/// bits.
pub(crate) fn sensor_bits(listed: &[(String, Vec<(u32, u32)>)], size: (u32, u32)) -> Option<u8> {
    let format = |name: &str| formats().find(|f| f.name == name && f.reading == Reading::Raw);
    let modes = listed.iter().filter(|(_, sizes)| sizes.contains(&size));
    modes.filter_map(|(name, _)| Some(format(name)?.bits)).max()
}

/// Why a format cannot be used; none if it can.
pub(crate) fn objection(reading: Reading, name: &str) -> Option<String> {
    if let Some(format) = formats().find(|format| format.name == name) {
        return (!reading.takes(format.reading))
            .then(|| format!("only where {} is to be read", format.reading.word()));
    }
    let compressed = name.contains("_COMP") || name.contains("JPEG") || name.starts_with("IPU");
    Some(if compressed {
        "compressed: its samples are not what the sensor counted".into()
    } else {
        "unknown here".into()
    })
}

impl Reading {
    fn takes(self, format: Self) -> bool {
        self == format || (self, format) == (Self::Luma, Self::Raw)
    }

    /// Its name in messages.
    fn word(self) -> &'static str {
        match self {
            Self::Raw => "raw",
            Self::Luma => "luma",
            Self::Green => "green",
        }
    }
}

impl Readable {
    /// Its name, and what is read of it.
    pub fn describe(&self) -> String {
        match self.green {
            Some(_) => format!(
                "one green plane of {}, with half its columns and rows",
                self.name
            ),
            None => self.name.into(),
        }
    }

    /// This format for a sensor of `bits`. If a format has more bits (R16 of a Pi 5), the sensor's
    /// are the upper ones. They must be shifted down: otherwise full scale would not be 2^bits − 1,
    /// and saturated pixels would not be recognised.
    pub fn of_sensor(self, bits: Option<u8>) -> Self {
        match (self.layout, bits) {
            (Layout::Words, Some(bits)) if (8..self.bits).contains(&bits) => Self {
                layout: Layout::UpperBits(bits),
                bits,
                ..self
            },
            _ => self,
        }
    }

    /// The format of frames from buffers of pictures of this size with `stride` bytes per row, and
    /// the number of bytes of a picture in a buffer. A plane of a colour sensor has half the
    /// columns and rows of its pictures.
    ///
    /// # Errors
    /// `Protocol` if a row does not fit into `stride` bytes or `stride` holds no whole number of
    /// samples.
    pub fn frames(
        &self,
        (width, height): (u32, u32),
        stride: usize,
    ) -> Result<(FrameFormat, usize), Error> {
        let columns = width as usize;
        let (row, samples) = match self.layout {
            Layout::Bytes => (columns, Some(stride)),
            Layout::Words => (columns * 2, stride.is_multiple_of(2).then_some(stride / 2)),
            Layout::UpperBits(_) => (columns * 2, Some(columns)),
            Layout::FourInFive => (columns.div_ceil(4) * 5, Some(columns)),
            Layout::TwoInThree => (columns.div_ceil(2) * 3, Some(columns)),
            Layout::MiddleOfThree => (columns * 3, Some(columns)),
        };
        let cell = if self.green.is_some() { 2 } else { 1 };
        match samples {
            Some(samples) if row <= stride && width >= cell && height >= cell => Ok((
                FrameFormat {
                    stride: if cell == 1 { samples } else { columns / 2 },
                    ..FrameFormat::packed(width / cell, height / cell, self.bits)
                },
                stride * height as usize,
            )),
            _ => Err(Error::protocol(
                format!(
                    "{width}×{height} pixels of {} in rows of {stride} bytes",
                    self.name
                ),
                "this is a defect of the camera's driver: report it, or take another format",
            )),
        }
    }

    /// The sample of one column of a row.
    fn sample(&self, row: &[u8], column: usize) -> u16 {
        let word = |at: usize| u16::from_le_bytes([row[at], row[at + 1]]);
        // A group of packed samples has the upper bytes of each, then the lower bits of all.
        let packed = |samples: usize, bits: usize| {
            let (group, at) = (column / samples * (samples + 1), column % samples);
            let lower = u16::from(row[group + samples]) >> (bits * at) & ((1 << bits) - 1);
            u16::from(row[group + at]) << bits | lower
        };
        match self.layout {
            Layout::Bytes => row[column].into(),
            Layout::Words => word(2 * column),
            Layout::UpperBits(bits) => word(2 * column) >> (16 - u32::from(bits)),
            Layout::FourInFive => packed(4, 2),
            Layout::TwoInThree => packed(2, 4),
            Layout::MiddleOfThree => row[3 * column + 1].into(),
        }
    }

    /// Copies the samples of a whole frame of `format` out of a buffer with `stride` bytes per row.
    pub fn copy(&self, buffer: &[u8], stride: usize, format: &FrameFormat, pixels: &mut Pixels) {
        if let Some((column, row)) = self.green {
            let rows = buffer.chunks(stride.max(1)).skip(row).step_by(2);
            match pixels {
                Pixels::Eight(samples) => {
                    let sample = |row: &[u8], at| self.sample(row, at) as u8;
                    every_second(rows, column, samples, format.stride, sample);
                }
                Pixels::Sixteen(samples) => {
                    let sample = |row: &[u8], at| self.sample(row, at);
                    every_second(rows, column, samples, format.stride, sample);
                }
            }
            return;
        }
        let (columns, width) = (format.width as usize, format.stride);
        let rows = buffer.chunks(stride.max(1));
        match pixels {
            Pixels::Eight(samples) => {
                for (row, into) in rows.zip(samples.chunks_exact_mut(width)) {
                    match self.layout {
                        Layout::MiddleOfThree => {
                            for (from, into) in row.chunks_exact(3).zip(&mut into[..columns]) {
                                *into = from[1];
                            }
                        }
                        Layout::UpperBits(_) => {
                            for (from, into) in row.chunks_exact(2).zip(into) {
                                *into = from[1];
                            }
                        }
                        _ => into.copy_from_slice(&row[..width]),
                    }
                }
            }
            Pixels::Sixteen(samples) => {
                for (row, into) in rows.zip(samples.chunks_exact_mut(width)) {
                    match self.layout {
                        Layout::FourInFive => unpack::<5>(row, &mut into[..columns], 2),
                        Layout::TwoInThree => unpack::<3>(row, &mut into[..columns], 4),
                        Layout::UpperBits(bits) => {
                            words(row, &mut into[..columns], 16 - u32::from(bits))
                        }
                        _ => words(row, into, 0),
                    }
                }
            }
        }
    }
}

/// Fills rows of `width` samples with every second sample of each row, from `column` on.
fn every_second<'a, T>(
    rows: impl Iterator<Item = &'a [u8]>,
    column: usize,
    samples: &mut [T],
    width: usize,
    sample: impl Fn(&[u8], usize) -> T,
) {
    for (row, into) in rows.zip(samples.chunks_exact_mut(width)) {
        for (at, into) in into.iter_mut().enumerate() {
            *into = sample(row, 2 * at + column);
        }
    }
}

fn words(row: &[u8], into: &mut [u16], unused: u32) {
    for (from, into) in row.chunks_exact(2).zip(into) {
        *into = u16::from_le_bytes([from[0], from[1]]) >> unused;
    }
}

/// Unpacks groups of `BYTES` bytes: one upper byte per sample, then one byte with the lower `bits`
/// of each sample, those of the first sample in the lowest bits (MIPI CSI-2, "RAW10" and "RAW12").
fn unpack<const BYTES: usize>(row: &[u8], into: &mut [u16], bits: usize) {
    for (group, into) in row.chunks_exact(BYTES).zip(into.chunks_mut(BYTES - 1)) {
        let lower = u16::from(group[BYTES - 1]);
        for (at, (upper, into)) in group.iter().zip(into).enumerate() {
            *into = u16::from(*upper) << bits | lower >> (bits * at) & ((1 << bits) - 1);
        }
    }
}

#[cfg(test)]
mod tests;
