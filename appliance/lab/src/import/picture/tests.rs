//! Pictures of every format are read, and damaged ones refused.

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

/// Two pages, and between them a smaller copy of the first.
fn stack() -> Vec<u8> {
    use tiff::encoder::colortype::Gray8;
    let mut file = Cursor::new(Vec::new());
    let mut encoder = tiff::encoder::TiffEncoder::new(&mut file).unwrap();
    for (grey, kind) in [(1_u8, 0_u32), (2, 1), (3, 0)] {
        let mut image = encoder.new_image::<Gray8>(SIZE.0, SIZE.1).unwrap();
        let tags = image.encoder();
        tags.write_tag(Tag::NewSubfileType, kind).unwrap();
        image.write_data(&[grey; 15]).unwrap();
    }
    file.into_inner()
}

fn any(bytes: &[u8]) -> Result<Picture> {
    let mut file = Cursor::new(bytes);
    match is_tiff(&mut file)? {
        true => Picture::tiff(file, 0),
        false => Picture::decode(bytes),
    }?
    .complete()
}

#[test]
fn every_page_of_a_tiff_is_a_picture_and_its_thumbnails_are_none() {
    let file = stack();
    let grey = |page| {
        let picture = Picture::tiff(Cursor::new(&file[..]), page);
        picture.map(|picture| picture.grey(Channel::Luminance)[0])
    };
    assert_eq!([0, 1].map(|page| grey(page).unwrap()), [1, 3]);
    assert!(matches!(grey(2), Err(PictureError::NoPage)));
}

/// A grey ramp of 16 × 16 pixels, as most cameras save it.
fn jpeg() -> Vec<u8> {
    let samples: Vec<u8> = (0..256).map(|at| (at % 16 * 16) as u8).collect();
    let mut file = Vec::new();
    let encoder = jpeg_encoder::Encoder::new(&mut file, 90);
    let grey = jpeg_encoder::ColorType::Luma;
    encoder.encode(&samples, 16, 16, grey).unwrap();
    file
}

#[test]
fn a_jpeg_is_read_with_its_loss_and_refused_when_it_is_cut_off() {
    let file = jpeg();
    let picture = any(&file).unwrap();
    assert!(picture.lossy && picture.size == (16, 16) && !picture.is_colour());
    for (at, sample) in picture.grey(Channel::Green).into_iter().enumerate() {
        let error = i32::from(sample) - (at % 16 * 16) as i32;
        assert!(error.abs() < 12, "{at}: {error}");
    }
    let cut = any(&file[..file.len() * 3 / 4]);
    assert!(cut.is_err());
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
        let picture = any(&file).unwrap();
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
    let whole = files().into_iter().map(|(_, file, _)| file);
    for whole in whole.chain([stack(), jpeg()]) {
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
            refused += usize::from(any(&bytes).is_err());
        }
    }
    assert!(refused > 2000, "{refused}");
}

#[test]
fn a_picture_that_is_to_be_turned_is_refused_in_every_format_that_can_say_so() {
    let little = *b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";
    let big = *b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
    let prefixed = [&b"Exif\0\0"[..], &little].concat();
    for exif in [&little[..], &big, &prefixed] {
        assert_eq!(orientation(exif), Some(6), "{exif:?}");
        for length in 0..exif.len() {
            // Whatever is cut off.
            let _ = orientation(&exif[..length]);
        }
    }
    let mut upside_down = Cursor::new(Vec::new());
    let mut encoder = tiff::encoder::TiffEncoder::new(&mut upside_down).unwrap();
    let mut image = encoder
        .new_image::<tiff::encoder::colortype::Gray8>(SIZE.0, SIZE.1)
        .unwrap();
    image.encoder().write_tag(Tag::Orientation, 3_u16).unwrap();
    image.write_data(&[0; 15]).unwrap();
    let read = Picture::tiff(Cursor::new(upside_down.into_inner()), 0);
    assert!(matches!(read, Err(PictureError::Turned(3))));
    let mut turned = Vec::new();
    let mut info = png::Info::with_size(SIZE.0, SIZE.1);
    info.color_type = png::ColorType::Grayscale;
    info.bit_depth = png::BitDepth::Eight;
    info.exif_metadata = Some(little.to_vec().into());
    let encoder = png::Encoder::with_info(&mut turned, info).unwrap();
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&[0; 15]).unwrap();
    writer.finish().unwrap();
    if let Err(error) = Picture::png(&turned) {
        assert!(matches!(error, PictureError::Turned(6)), "{error}");
    }
}
