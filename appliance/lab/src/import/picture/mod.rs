//! Pictures of other people's cameras: PNG, BMP, TIFF and JPEG, grey or colour, 8 or 16 bits.

use embedded_graphics::pixelcolor::{Rgb888, RgbColor as _};
use hal::bounds::MAX_SIDE;
use std::fmt::Display;
use std::fs::File;
use std::io::{self, BufReader, Cursor, Read, Seek};
use std::path::Path;
use tiff::decoder::{Decoder, DecodingResult};
use tiff::tags::Tag;
use tinybmp::Bmp;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Endings of the names of pictures.
pub const ENDINGS: [&str; 6] = ["png", "bmp", "tif", "tiff", "jpg", "jpeg"];
/// Longest file that is read.
const MAX_BYTES: u64 = 1 << 30;
/// Bytes that a decoder may allocate in addition to the samples.
const DECODER_BYTES: usize = 64 << 20;
/// Most pages of a file: as many as a recording has frames.
const MAX_PAGES: usize = 1024;

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

/// Why a picture cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] io::Error),
    /// The file is too long.
    #[error("{0} bytes: name a picture of at most {MAX_BYTES}")]
    Long(u64),
    /// A file of another format.
    #[error("neither PNG, BMP, TIFF nor JPEG: convert it to one of them")]
    Format,
    /// The decoder of its format refuses it.
    #[error("the picture cannot be decoded ({0}): save it again, uncompressed if it is a BMP")]
    Broken(String),
    /// Other samples than its size has.
    #[error(
        "it has {found} samples of {expected}: it is cut off, or its colours are in separate planes: save it again"
    )]
    Incomplete {
        /// Samples that were decoded.
        found: usize,
        /// Samples of its size.
        expected: usize,
    },
    /// A side that is too long.
    #[error("{width}×{height} pixels: frames have at most {MAX_SIDE} each way")]
    Large {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// More samples than memory can hold.
    #[error("it is too large")]
    TooLarge,
    /// No size in the file.
    #[error("it has no size: save it again")]
    NoSize,
    /// Several pictures in a PNG.
    #[error("it is animated: save each of its pictures as a file")]
    Animated,
    /// Pixels that viewers turn or mirror.
    #[error(
        "its orientation is {0}, so viewers turn or mirror it, and it is not known which way its models were made: save it with its \
         pixels as they are meant and orientation 1"
    )]
    Turned(u16),
    /// Another colour space.
    #[error("its colours are {0:?}: save it as grey or RGB")]
    Colours(tiff::ColorType),
    /// Samples of other than 8 or 16 bits.
    #[error("its samples are not of 8 or 16 bits: save it with those")]
    Depth,
    /// A page that there is not.
    #[error("it has no such page")]
    NoPage,
    /// Several pages where one is expected.
    #[error("it has {0} pages: save the one that is meant")]
    Pages(usize),
    /// Too many pages.
    #[error("it has more than {MAX_PAGES} pages: save one file for each part")]
    ManyPages,
}

type Result<T> = std::result::Result<T, PictureError>;

/// A decoded picture.
pub struct Picture {
    /// Columns and rows.
    pub size: (u32, u32),
    /// Bits that its file has per sample: 8 or 16.
    pub bits: u8,
    /// Whether its file was compressed with loss.
    pub lossy: bool,
    /// Samples per pixel: 1, 3, or one more for opacity.
    channels: usize,
    samples: Vec<u16>,
}

impl Picture {
    /// How many pictures a file holds: the pages of a TIFF, of any other format one.
    ///
    /// # Errors
    /// [`PictureError`]
    pub fn pages(path: &Path) -> Result<usize> {
        let mut file = open(path)?;
        match is_tiff(&mut file)? {
            true => Ok(pages(&mut tiff(file)?)?.len()),
            false => Ok(1),
        }
    }

    /// Reads a page (from 0) of a file; its first bytes say the format.
    ///
    /// # Errors
    /// [`PictureError`]
    pub fn read(path: &Path, page: usize) -> Result<Self> {
        let mut file = open(path)?;
        let picture = match is_tiff(&mut file)? {
            true => Self::tiff(file, page),
            false => {
                let mut bytes = Vec::new();
                file.take(MAX_BYTES).read_to_end(&mut bytes)?;
                Self::decode(&bytes)
            }
        };
        picture.and_then(Self::complete)
    }

    /// Reads the only picture of a file.
    ///
    /// # Errors
    /// [`PictureError`]
    pub fn single(path: &Path) -> Result<Self> {
        match Self::pages(path)? {
            1 => Self::read(path, 0),
            pages => Err(PictureError::Pages(pages)),
        }
    }

    /// Everything but TIFF.
    fn decode(bytes: &[u8]) -> Result<Self> {
        match bytes {
            [0x89, b'P', b'N', b'G', ..] => Self::png(bytes),
            [b'B', b'M', ..] => Self::bmp(bytes),
            [0xFF, 0xD8, ..] => Self::jpeg(bytes),
            _ => Err(PictureError::Format),
        }
    }

    /// This picture, if it has the samples of its size.
    fn complete(self) -> Result<Self> {
        let (width, height) = self.size;
        let expected = width as usize * height as usize * self.channels;
        match self.samples.len() == expected && expected > 0 {
            true => Ok(self),
            false => Err(PictureError::Incomplete {
                found: self.samples.len(),
                expected,
            }),
        }
    }

    fn png(bytes: &[u8]) -> Result<Self> {
        let limits = png::Limits {
            bytes: DECODER_BYTES,
        };
        let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().map_err(broken)?;
        let size = bounded(reader.info().size())?;
        if reader.info().is_animated() {
            return Err(PictureError::Animated);
        }
        let exif = reader.info().exif_metadata.as_deref();
        upright(exif.and_then(orientation))?;
        let (colour, depth) = reader.output_color_type();
        let length = reader.output_buffer_size().ok_or(PictureError::TooLarge)?;
        let mut raw = vec![0; length];
        reader.next_frame(&mut raw).map_err(broken)?;
        let wide = depth == png::BitDepth::Sixteen;
        Ok(Self {
            size,
            bits: if wide { 16 } else { 8 },
            lossy: false,
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

    fn bmp(bytes: &[u8]) -> Result<Self> {
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
            lossy: false,
            channels: 3,
            samples: samples.collect(),
        })
    }

    fn jpeg(bytes: &[u8]) -> Result<Self> {
        let side = MAX_SIDE as usize;
        // A file that is cut off is refused, not filled with grey.
        let options = DecoderOptions::new_safe()
            .set_strict_mode(true)
            .set_max_width(side)
            .set_max_height(side);
        let mut decoder = JpegDecoder::new_with_options(Cursor::new(bytes), options);
        let samples = decoder.decode().map_err(broken)?;
        upright(decoder.exif().and_then(|exif| orientation(exif)))?;
        let (width, height) = decoder.dimensions().ok_or(PictureError::NoSize)?;
        let colours = decoder
            .output_colorspace()
            .map_or(0, |space| space.num_components());
        Ok(Self {
            size: bounded((width as u32, height as u32))?,
            bits: 8,
            lossy: true,
            channels: colours,
            samples: samples.into_iter().map(u16::from).collect(),
        })
    }

    fn tiff(file: impl Read + Seek, page: usize) -> Result<Self> {
        let mut decoder = tiff(file)?;
        let directory = *pages(&mut decoder)?.get(page).ok_or(PictureError::NoPage)?;
        decoder.seek_to_image(directory).map_err(broken)?;
        let size = bounded(decoder.dimensions().map_err(broken)?)?;
        let turned = decoder.find_tag_unsigned(Tag::Orientation);
        upright(turned.map_err(broken)?)?;
        let colour = decoder.colortype().map_err(broken)?;
        let channels = match colour {
            tiff::ColorType::Gray(_) => 1,
            tiff::ColorType::GrayA(_) => 2,
            tiff::ColorType::RGB(_) => 3,
            tiff::ColorType::RGBA(_) => 4,
            other => return Err(PictureError::Colours(other)),
        };
        let (bits, samples) = match decoder.read_image().map_err(broken)? {
            DecodingResult::U8(samples) => (8, samples.into_iter().map(u16::from).collect()),
            DecodingResult::U16(samples) => (16, samples),
            _ => return Err(PictureError::Depth),
        };
        Ok(Self {
            size,
            bits,
            lossy: false,
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

/// The orientation that EXIF data state, a TIFF directory (JEITA CP-3451, tag 0x0112).
fn orientation(exif: &[u8]) -> Option<u16> {
    const ORIENTATION: u16 = 0x0112;
    let exif = exif.strip_prefix(b"Exif\0\0").unwrap_or(exif);
    let little = match exif.get(..2)? {
        b"II" => true,
        b"MM" => false,
        _ => return None,
    };
    let short = |at: usize| {
        let two: [u8; 2] = exif.get(at..at.checked_add(2)?)?.try_into().ok()?;
        Some(match little {
            true => u16::from_le_bytes(two),
            false => u16::from_be_bytes(two),
        })
    };
    let [low, high] = match little {
        true => [4, 6],
        false => [6, 4],
    };
    let directory = usize::from(short(low)?) | usize::from(short(high)?) << 16;
    let entries = (0..short(directory)?).map(|entry| directory + 2 + 12 * usize::from(entry));
    let mut entries = entries.filter(|&at| short(at) == Some(ORIENTATION));
    short(entries.next()? + 8)
}

/// Refuses a picture that is to be turned before it is looked at.
fn upright(orientation: Option<u16>) -> Result<()> {
    match orientation {
        None | Some(0 | 1) => Ok(()),
        Some(turned) => Err(PictureError::Turned(turned)),
    }
}

fn open(path: &Path) -> Result<BufReader<File>> {
    let file = File::open(path)?;
    let length = file.metadata()?.len();
    match length <= MAX_BYTES {
        true => Ok(BufReader::new(file)),
        false => Err(PictureError::Long(length)),
    }
}

/// Whether a file begins as a TIFF does; it is at its beginning afterwards.
fn is_tiff(file: &mut (impl Read + Seek)) -> Result<bool> {
    let mut first = Vec::new();
    file.by_ref().take(2).read_to_end(&mut first)?;
    file.rewind()?;
    Ok(first == b"II" || first == b"MM")
}

fn tiff<R: Read + Seek>(file: R) -> Result<Decoder<R>> {
    let mut limits = tiff::decoder::Limits::default();
    limits.intermediate_buffer_size = DECODER_BYTES;
    Ok(Decoder::new(file).map_err(broken)?.with_limits(limits))
}

/// The directories of a TIFF that are pages, without thumbnails and masks of other pages.
fn pages<R: Read + Seek>(decoder: &mut Decoder<R>) -> Result<Vec<usize>> {
    /// Bits of the tag NewSubfileType: a smaller copy of another page, and a mask of one.
    const OF_ANOTHER: u32 = 1 | 4;
    let mut pages = Vec::new();
    for directory in 0.. {
        let kind = decoder.find_tag_unsigned(Tag::NewSubfileType);
        let kind: u32 = kind.map_err(broken)?.unwrap_or(0);
        if kind & OF_ANOTHER == 0 {
            pages.push(directory);
        }
        if !decoder.more_images() {
            break;
        }
        if directory >= MAX_PAGES {
            return Err(PictureError::ManyPages);
        }
        decoder.next_image().map_err(broken)?;
    }
    Ok(pages)
}

fn broken(error: impl Display) -> PictureError {
    PictureError::Broken(error.to_string())
}

fn bounded((width, height): (u32, u32)) -> Result<(u32, u32)> {
    match width.max(height) <= MAX_SIDE {
        true => Ok((width, height)),
        false => Err(PictureError::Large { width, height }),
    }
}

#[cfg(test)]
mod tests;
