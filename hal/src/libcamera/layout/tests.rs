//! Tests of the choice of a pixel format, on what cameras are known to grant.

use super::*;
use crate::error::ErrorKind;

const IMX296: (u32, u32) = (1456, 1088);

fn granted(names: &[&str]) -> Vec<Granted> {
    let granted = |name: &&str| Granted {
        name: (*name).to_owned(),
        size: IMX296,
    };
    names.iter().map(granted).collect()
}

fn chosen(reading: Reading, names: &[&str]) -> Result<&'static str, Error> {
    choose("cam", reading, None, &granted(names)).map(|(at, format)| {
        assert_eq!(format.name, names[at]);
        format.name
    })
}

#[test]
fn raw_mono_is_taken_with_the_most_bits_and_unpacked_before_packed() {
    // A Pi 5 grants R16 for every unpacked word and a compressed format for every packed one.
    let pi5 = [
        "R16",
        "R16",
        "R16",
        "MONO_PISP_COMP1",
        "R16",
        "MONO_PISP_COMP1",
        "R16",
    ];
    assert_eq!(chosen(Reading::Raw, &pi5).unwrap(), "R16");
    assert_eq!(
        chosen(Reading::Raw, &["R10_CSI2P", "R10", "R8"]).unwrap(),
        "R10"
    );
    assert_eq!(chosen(Reading::Raw, &["R10_CSI2P"]).unwrap(), "R10_CSI2P");
    assert_eq!(chosen(Reading::Raw, &["NV12", "R8"]).unwrap(), "R8");
}

#[test]
fn compressed_and_unknown_formats_are_refused_by_name_and_reason() {
    for (name, reason) in [
        ("MONO_PISP_COMP1", "compressed"),
        ("BGGR_PISP_COMP1", "compressed"),
        ("MJPEG", "compressed"),
        ("YUYV", "unknown"),
    ] {
        for reading in [Reading::Raw, Reading::Luma, Reading::Green] {
            let error = chosen(reading, &[name]).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Unsupported);
            let words = error.to_string();
            assert!(words.contains(name) && words.contains(reason), "{words}");
        }
    }
}

#[test]
fn the_luma_of_a_yuv_format_is_taken_only_when_configured_so() {
    let error = chosen(Reading::Raw, &["NV12"]).unwrap_err().to_string();
    assert!(
        error.contains("NV12 (only where luma is to be read)"),
        "{error}"
    );
    assert_eq!(chosen(Reading::Luma, &["NV12"]).unwrap(), "NV12");
    assert_eq!(chosen(Reading::Luma, &["NV12", "R8"]).unwrap(), "R8");
    assert!(chosen(Reading::Luma, &["BGR888"]).is_err());
    assert_eq!(chosen(Reading::Green, &["BGR888"]).unwrap(), "BGR888");
}

#[test]
fn a_size_that_the_camera_does_not_grant_is_refused_with_the_sizes_that_it_does() {
    let offers = granted(&["R16"]);
    assert!(choose("cam", Reading::Raw, Some(IMX296), &offers).is_ok());
    let error = choose("cam", Reading::Raw, Some((728, 544)), &offers).unwrap_err();
    let words = error.to_string();
    assert!(
        words.contains("728×544") && words.contains("R16 of 1456×1088"),
        "{words}"
    );
}

#[test]
fn a_camera_that_grants_nothing_is_refused_in_words() {
    let words = choose("cam", Reading::Raw, None, &[])
        .unwrap_err()
        .to_string();
    assert!(
        words.contains("raw frames") && words.contains("grants nothing"),
        "{words}"
    );
}

#[test]
fn packed_samples_are_unpacked_as_the_standard_packs_them() {
    // Two rows of 5 columns, RAW10: 8 bytes of groups a row, padded to 16 bytes.
    let samples: [u16; 10] = [0, 1, 2, 3, 1023, 1022, 512, 511, 0x155, 0x2aa];
    let mut buffer = vec![0xff_u8; 32];
    for (row, samples) in buffer.chunks_mut(16).zip(samples.chunks(5)) {
        for (group, samples) in row.chunks_mut(5).zip(samples.chunks(4)) {
            group.fill(0);
            for (at, sample) in samples.iter().enumerate() {
                group[at] = (sample >> 2) as u8;
                group[4] |= ((sample & 3) << (2 * at)) as u8;
            }
        }
    }
    let readable = FORMATS.iter().find(|f| f.name == "R10_CSI2P").unwrap();
    let (format, bytes) = readable.frames((5, 2), 16).unwrap();
    assert_eq!((format, bytes), (FrameFormat::packed(5, 2, 10), 32));
    let mut pixels = Pixels::zeroed(&format);
    readable.copy(&buffer, 16, &format, &mut pixels);
    assert_eq!(pixels, Pixels::Sixteen(samples.to_vec()));

    let readable = FORMATS.iter().find(|f| f.name == "R12_CSI2P").unwrap();
    let (format, _) = readable.frames((2, 1), 3).unwrap();
    let mut pixels = Pixels::zeroed(&format);
    readable.copy(&[0xab, 0x12, 0x3c], 3, &format, &mut pixels);
    assert_eq!(pixels, Pixels::Sixteen(vec![0xabc, 0x123]));
}

#[test]
fn green_is_the_middle_of_three_and_words_keep_their_padding() {
    let green = FORMATS.iter().find(|f| f.name == "BGR888").unwrap();
    let (format, _) = green.frames((2, 2), 8).unwrap();
    let mut pixels = Pixels::zeroed(&format);
    let buffer = [1, 2, 3, 4, 5, 6, 0, 0, 7, 8, 9, 10, 11, 12, 0, 0];
    green.copy(&buffer, 8, &format, &mut pixels);
    assert_eq!(pixels, Pixels::Eight(vec![2, 5, 8, 11]));

    let words = FORMATS.iter().find(|f| f.name == "R16").unwrap();
    let (format, bytes) = words.frames((1, 2), 4).unwrap();
    assert_eq!((format.stride, bytes), (2, 8));
    let mut pixels = Pixels::zeroed(&format);
    words.copy(&[1, 2, 0, 0, 3, 4, 0, 0], 4, &format, &mut pixels);
    assert_eq!(pixels, Pixels::Sixteen(vec![0x201, 0, 0x403, 0]));
}

#[test]
fn rows_that_do_not_fit_their_stride_are_refused() {
    let format = |name| FORMATS.iter().find(|f| f.name == name).unwrap();
    for (name, stride) in [
        ("R16", 7),
        ("R16", 9),
        ("R8", 3),
        ("R10_CSI2P", 4),
        ("BGR888", 11),
    ] {
        let error = format(name).frames((4, 2), stride).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Protocol, "{name} {stride}");
    }
    assert!(format("R10_CSI2P").frames((4, 2), 5).is_ok());
}

#[test]
fn the_upper_bits_of_a_wider_format_are_the_sensors() {
    let format = |name| *FORMATS.iter().find(|f| f.name == name).unwrap();
    // As a Pi 5 lists them for an OV9281, an IMX296, and a colour sensor; and for one whose largest
    // mode has 8 bits only.
    let (small, large) = ((640, 400), (1280, 800));
    let bits = |listed: &[(&str, &[(u32, u32)])], size| {
        let listed: Vec<_> = listed
            .iter()
            .map(|(name, sizes)| ((*name).to_owned(), sizes.to_vec()))
            .collect();
        sensor_bits(&listed, size)
    };
    let both: &[_] = &[small, large];
    assert_eq!(bits(&[("R8", both), ("R10_CSI2P", both)], large), Some(10));
    assert_eq!(bits(&[("R10_CSI2P", &[IMX296])], IMX296), Some(10));
    let colour = [("SRGGB12_CSI2P", both), ("NV12", both)];
    assert_eq!(bits(&colour, large), Some(12));
    assert_eq!(bits(&[("NV12", both)], large), None);
    let mixed: &[(&str, &[_])] = &[("R8", &[large]), ("R10_CSI2P", &[small])];
    assert_eq!(
        (bits(mixed, large), bits(mixed, small)),
        (Some(8), Some(10))
    );

    let upper = format("R16").of_sensor(Some(10));
    let (frames, bytes) = upper.frames((2, 2), 6).unwrap();
    assert_eq!((frames, bytes), (FrameFormat::packed(2, 2, 10), 12));
    let mut pixels = Pixels::zeroed(&frames);
    let buffer: Vec<u8> = [1023_u16 << 6, 1 << 6, 0xffff, 512 << 6, 0, 0xffff]
        .iter()
        .flat_map(|sample| sample.to_le_bytes())
        .collect();
    upper.copy(&buffer, 6, &frames, &mut pixels);
    assert_eq!(pixels, Pixels::Sixteen(vec![1023, 1, 512, 0]));

    // A format with as many bits as its sensor, or with an unknown sensor, is left as it is.
    assert_eq!(format("R10").of_sensor(Some(10)), format("R10"));
    assert_eq!(format("R16").of_sensor(None), format("R16"));

    // A saturated pixel of 8 bits is 255 of 255, and not 65 280 of 65 535.
    let upper = format("R16").of_sensor(Some(8));
    let (frames, bytes) = upper.frames((2, 2), 6).unwrap();
    assert_eq!((frames, bytes), (FrameFormat::packed(2, 2, 8), 12));
    let mut pixels = Pixels::zeroed(&frames);
    let buffer = [0, 255, 0, 1, 7, 7, 0, 0, 0, 128, 7, 7];
    upper.copy(&buffer, 6, &frames, &mut pixels);
    assert_eq!(pixels, Pixels::Eight(vec![255, 1, 0, 128]));
}

#[test]
fn a_colour_sensor_is_read_through_one_green_plane_where_there_is_no_monochrome_format() {
    // As a Pi 5 and a Pi 4 grant them for the official Global Shutter Camera.
    let pi5 = ["SRGGB16", "RGGB_PISP_COMP1"];
    assert_eq!(chosen(Reading::Raw, &pi5).unwrap(), "SRGGB16");
    let pi4 = ["SRGGB10_CSI2P", "SRGGB10"];
    assert_eq!(chosen(Reading::Raw, &pi4).unwrap(), "SRGGB10");
    assert_eq!(chosen(Reading::Raw, &["SRGGB10", "R8"]).unwrap(), "R8");
    assert_eq!(chosen(Reading::Luma, &["SRGGB10", "NV12"]).unwrap(), "NV12");
    let listed = [("SRGGB10_CSI2P".to_owned(), vec![IMX296])];
    assert_eq!(sensor_bits(&listed, IMX296), Some(10));

    let plane = formats().find(|format| format.name == "SRGGB10").unwrap();
    let said = "one green plane of SRGGB10, with half its columns and rows";
    assert_eq!(plane.describe(), said);

    // A picture whose sample is 100 × row + column, of which green is at other places in each
    // order.
    let format = |name: &str| *formats().find(|format| format.name == name).unwrap();
    let size = (8, 4);
    let sample = |row: u16, column: u16| 100 * row + column;
    for (name, first) in [("SRGGB", 1), ("SBGGR", 1), ("SGRBG", 0), ("SGBRG", 0)] {
        let green = [0, 2].map(|row| [0, 2, 4, 6].map(|column| sample(row, column + first)));
        let green = Pixels::Sixteen(green.concat());
        let read = |readable: Readable, stride: usize, buffer: &[u8]| {
            let (frames, bytes) = readable.frames(size, stride).unwrap();
            assert_eq!(frames, FrameFormat::packed(4, 2, 10));
            assert_eq!(bytes, buffer.len());
            let mut pixels = Pixels::zeroed(&frames);
            readable.copy(buffer, stride, &frames, &mut pixels);
            pixels
        };
        let words = |shift: u32| -> Vec<u8> {
            let all = (0..4).flat_map(|row| (0..8).map(move |column| sample(row, column)));
            all.flat_map(|sample| (sample << shift).to_le_bytes())
                .collect()
        };
        let unpacked = format(&format!("{name}10"));
        assert_eq!(read(unpacked, 16, &words(0)), green, "{name}");
        let upper = format(&format!("{name}16")).of_sensor(Some(10));
        assert_eq!(read(upper, 16, &words(6)), green, "{name}");
        let mut packed = Vec::new();
        for group in words(0).chunks(8) {
            let samples: Vec<u16> = group
                .chunks(2)
                .map(|two| u16::from_le_bytes([two[0], two[1]]))
                .collect();
            packed.extend(samples.iter().map(|sample| (sample >> 2) as u8));
            let lower = samples.iter().enumerate();
            packed.push(lower.fold(0, |byte, (at, sample)| {
                byte | ((sample & 3) << (2 * at)) as u8
            }));
        }
        assert_eq!(read(format(&format!("{name}10_CSI2P")), 10, &packed), green);
    }
}
