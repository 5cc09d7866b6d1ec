//! Pictures of other people's cameras: PNG, BMP and TIFF, grey or colour, 8 or 16 bits.

use embedded_graphics::pixelcolor::{Rgb888, RgbColor as _};
use hal::bounds::{MAX_SIDE, shortened};
use std::fs;
use std::io::Cursor;
use std::path::Path;
use tiff::decoder::DecodingResult;
use tinybmp::Bmp;

/// Endings of the names of pictures.
pub const ENDINGS: [&str; 4] = ["png", "bmp", "tif", "tiff"];
/// Longest file that is read.
const MAX_BYTES: u64 = 1 << 30;
/// Bytes that a decoder may allocate in addition to the samples.
const DECODER_BYTES: usize = 64 << 20;

/// What of a colour picture is taken. A grey picture is taken as it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Channel {
    /// 0.299 R + 0.587 G + 0.114 B (ITU-R BT.601).
    Luminance,
    /// The red samples.
    Red,
    /// The green samples.
    Green,
    /// The blue samples.
    Blue,
}

/// A decoded picture.
pub struct Picture {
    /// Columns and rows.
    pub size: (u32, u32),
    /// Bits that its file has per sample: 8 or 16.
    pub bits: u8,
    /// Samples per pixel: 1, 3, or one more for opacity.
    channels: usize,
    samples: Vec<u16>,
}

impl Picture {
    /// Reads the picture in a file; its format is told by its first bytes.
    ///
    /// # Errors
    /// In words, with the remedy.
    pub fn read(path: &Path) -> Result<Self, String> {
        let length = fs::metadata(path).map_err(|error| error.to_string())?.len();
        if length > MAX_BYTES {
            return Err(format!(
                "{length} bytes: name a picture of at most {MAX_BYTES}"
            ));
        }
        let bytes = fs::read(path).map_err(|error| error.to_string())?;
        Self::decode(&bytes).map_err(|problem| shortened(&problem))
    }

    fn decode(bytes: &[u8]) -> Result<Self, String> {
        let picture = match bytes {
            [0x89, b'P', b'N', b'G', ..] => Self::png(bytes),
            [b'B', b'M', ..] => Self::bmp(bytes),
            [b'I', b'I', ..] | [b'M', b'M', ..] => Self::tiff(bytes),
            _ => Err("neither PNG, BMP nor TIFF: convert it to one of them".into()),
        }?;
        let (width, height) = picture.size;
        let expected = width as usize * height as usize * picture.channels;
        match picture.samples.len() == expected && expected > 0 {
            true => Ok(picture),
            false => Err(format!(
                "it has {} samples of {expected}: it is cut off, or its colours are in separate planes: save it again",
                picture.samples.len()
            )),
        }
    }

    fn png(bytes: &[u8]) -> Result<Self, String> {
        let limits = png::Limits {
            bytes: DECODER_BYTES,
        };
        let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().map_err(broken)?;
        let size = bounded(reader.info().size())?;
        let (colour, depth) = reader.output_color_type();
        let length = reader.output_buffer_size().ok_or("it is too large")?;
        let mut raw = vec![0; length];
        reader.next_frame(&mut raw).map_err(broken)?;
        let wide = depth == png::BitDepth::Sixteen;
        Ok(Self {
            size,
            bits: if wide { 16 } else { 8 },
            channels: colour.samples(),
            samples: match wide {
                true => {
                    let (pairs, _) = raw.as_chunks::<2>();
                    pairs.iter().map(|pair| u16::from_be_bytes(*pair)).collect()
                }
                false => raw.into_iter().map(u16::from).collect(),
            },
        })
    }

    fn bmp(bytes: &[u8]) -> Result<Self, String> {
        let wrong = |error| broken(format!("{error:?}"));
        let bmp = Bmp::<Rgb888>::from_slice(bytes).map_err(wrong)?;
        let size = bmp.as_raw().header().image_size;
        let size = bounded((size.width, size.height))?;
        let colours = bmp.pixels().map(|pixel| pixel.1);
        let samples =
            colours.flat_map(|colour| [colour.r(), colour.g(), colour.b()].map(u16::from));
        Ok(Self {
            size,
            bits: 8,
            channels: 3,
            samples: samples.collect(),
        })
    }

    fn tiff(bytes: &[u8]) -> Result<Self, String> {
        let mut limits = tiff::decoder::Limits::default();
        limits.intermediate_buffer_size = DECODER_BYTES;
        let decoder = tiff::decoder::Decoder::new(Cursor::new(bytes)).map_err(broken)?;
        let mut decoder = decoder.with_limits(limits);
        let size = bounded(decoder.dimensions().map_err(broken)?)?;
        let colour = decoder.colortype().map_err(broken)?;
        let channels = match colour {
            tiff::ColorType::Gray(_) => 1,
            tiff::ColorType::GrayA(_) => 2,
            tiff::ColorType::RGB(_) => 3,
            tiff::ColorType::RGBA(_) => 4,
            other => return Err(format!("its colours are {other:?}: save it as grey or RGB")),
        };
        let (bits, samples) = match decoder.read_image().map_err(broken)? {
            DecodingResult::U8(samples) => (8, samples.into_iter().map(u16::from).collect()),
            DecodingResult::U16(samples) => (16, samples),
            _ => return Err("its samples are not of 8 or 16 bits: save it with those".into()),
        };
        Ok(Self {
            size,
            bits,
            channels,
            samples,
        })
    }

    /// Whether any pixel has a colour other than grey.
    pub fn is_colour(&self) -> bool {
        self.channels >= 3
            && self
                .samples
                .chunks(self.channels)
                .any(|pixel| pixel[0] != pixel[1] || pixel[1] != pixel[2])
    }

    /// The samples of a channel, row-major; a grey picture has only one.
    pub fn grey(&self, channel: Channel) -> Vec<u16> {
        let pixels = self.samples.chunks(self.channels);
        if self.channels < 3 {
            return pixels.map(|pixel| pixel[0]).collect();
        }
        let at = match channel {
            Channel::Red => 0,
            Channel::Green => 1,
            Channel::Blue => 2,
            Channel::Luminance => {
                let luminance = |pixel: &[u16]| {
                    let [red, green, blue] = [pixel[0], pixel[1], pixel[2]].map(u32::from);
                    ((299 * red + 587 * green + 114 * blue + 500) / 1000) as u16
                };
                return pixels.map(luminance).collect();
            }
        };
        pixels.map(|pixel| pixel[at]).collect()
    }
}

fn broken(error: impl std::fmt::Display) -> String {
    format!("the picture cannot be decoded ({error}): save it again, uncompressed if it is a BMP")
}

fn bounded((width, height): (u32, u32)) -> Result<(u32, u32), String> {
    match width.max(height) <= MAX_SIDE {
        true => Ok((width, height)),
        false => Err(format!(
            "{width}×{height} pixels: frames have at most {MAX_SIDE} each way"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_xoshiro::SplitMix64;
    use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};

    const SIZE: (u32, u32) = (5, 3);

    fn red(at: usize) -> u16 {
        (at * 16) as u16
    }

    fn png(colour: png::ColorType, depth: png::BitDepth, raw: &[u8]) -> Vec<u8> {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, SIZE.0, SIZE.1);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(raw).unwrap();
        writer.finish().unwrap();
        file
    }

    /// R, G, B of each pixel.
    fn colours() -> Vec<u8> {
        (0..15).flat_map(|at| [red(at) as u8, 100, 7]).collect()
    }

    /// A BMP of 24 bits: rows from the bottom, each padded to 4 bytes, B G R.
    fn bmp() -> Vec<u8> {
        let mut file = b"BM".to_vec();
        let long = |file: &mut Vec<u8>, value: u32| file.extend(value.to_le_bytes());
        for value in [54 + 48, 0, 54, 40, SIZE.0, SIZE.1] {
            long(&mut file, value);
        }
        file.extend([1, 0, 24, 0]);
        for value in [0, 48, 2835, 2835, 0, 0] {
            long(&mut file, value);
        }
        for row in (0..3).rev() {
            for column in 0..5 {
                file.extend([7, 100, red(row * 5 + column) as u8]);
            }
            file.push(0);
        }
        file
    }

    fn tiff<C: tiff::encoder::colortype::ColorType>(samples: &[C::Inner]) -> Vec<u8>
    where
        [C::Inner]: tiff::encoder::TiffValue,
    {
        let mut file = Cursor::new(Vec::new());
        let mut encoder = tiff::encoder::TiffEncoder::new(&mut file).unwrap();
        encoder.write_image::<C>(SIZE.0, SIZE.1, samples).unwrap();
        file.into_inner()
    }

    fn files() -> Vec<(&'static str, Vec<u8>, u8)> {
        use png::{BitDepth, ColorType};
        use tiff::encoder::colortype::{Gray16, RGB8};
        let wide: Vec<u16> = (0..15).map(|at| red(at) * 16).collect();
        let big_endian: Vec<u8> = wide
            .iter()
            .flat_map(|sample| sample.to_be_bytes())
            .collect();
        vec![
            ("RGB", png(ColorType::Rgb, BitDepth::Eight, &colours()), 8),
            ("RGB", bmp(), 8),
            ("RGB", tiff::<RGB8>(&colours()), 8),
            (
                "grey",
                png(ColorType::Grayscale, BitDepth::Sixteen, &big_endian),
                16,
            ),
            ("grey", tiff::<Gray16>(&wide), 16),
        ]
    }

    #[test]
    fn each_format_gives_its_samples_by_channel_or_luminance() {
        for (kind, file, bits) in files() {
            let picture = Picture::decode(&file).unwrap();
            assert_eq!((picture.size, picture.bits), (SIZE, bits));
            assert_eq!(picture.is_colour(), kind == "RGB");
            let factor = if bits == 16 { 16 } else { 1 };
            let expected: Vec<u16> = (0..15).map(|at| red(at) * factor).collect();
            assert_eq!(picture.grey(Channel::Red), expected);
            if kind == "RGB" {
                assert_eq!(picture.grey(Channel::Blue), [7; 15]);
                let luminance = 0.299 * 16.0 + 0.587 * 100.0 + 0.114 * 7.0;
                let found = f64::from(picture.grey(Channel::Luminance)[1]);
                assert!((found - luminance).abs() <= 0.5, "{found}");
            }
        }
    }

    #[test]
    fn no_damage_to_a_picture_makes_reading_it_panic() {
        let mut random = SplitMix64::seed_from_u64(7);
        let mut refused = 0;
        for (_, whole, _) in files() {
            for _ in 0..2000 {
                let mut bytes = whole.clone();
                for _ in 0..=random.next_u32() % 3 {
                    let at = random.next_u64() as usize % bytes.len();
                    match random.next_u32() % 3 {
                        0 => bytes[at] = random.next_u32() as u8,
                        1 => bytes[at] ^= 1 << (random.next_u32() % 8),
                        _ => bytes.truncate(at.max(2)),
                    }
                }
                refused += usize::from(Picture::decode(&bytes).is_err());
            }
        }
        assert!(refused > 2000, "{refused}");
    }
}
