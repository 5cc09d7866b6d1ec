//! The virtual display's checksum of every refresh, which shows what the display really showed.

use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::os::unix::fs::OpenOptionsExt;

use hal::projector::Raster;
use rustix::fs::OFlags;

/// Where the kernel reports the checksums of the first display of a card.
const FOLDER: &str = "/sys/kernel/debug/dri/0/crtc-0/crc";

/// The checksums since its creation, by the count of the refresh.
pub struct Checksums {
    lines: File,
    pub seen: HashMap<u64, u32>,
}

impl Checksums {
    pub fn record() -> Self {
        let mut control = OpenOptions::new()
            .write(true)
            .open(format!("{FOLDER}/control"))
            .unwrap();
        control.write_all(b"auto").unwrap();
        let mut options = OpenOptions::new();
        options
            .read(true)
            .custom_flags(OFlags::NONBLOCK.bits().cast_signed());
        Self {
            lines: options.open(format!("{FOLDER}/data")).unwrap(),
            seen: HashMap::new(),
        }
    }

    /// Reads the checksums so far; the kernel keeps only the last 128.
    pub fn take(&mut self) {
        let mut line = [0; 64];
        while let Ok(length @ 1..) = self.lines.read(&mut line) {
            let text = String::from_utf8_lossy(&line[..length]);
            let mut numbers = text
                .split(|c: char| c.is_whitespace() || c == '\0')
                .filter_map(|word| u32::from_str_radix(word.strip_prefix("0x")?, 16).ok());
            let (count, sum) = (numbers.next().unwrap(), numbers.next().unwrap());
            self.seen.insert(count.into(), sum);
        }
    }
}

/// The checksum of a raster: CRC-32 (reflected, from 0, not inverted) over its pixels as opaque
/// 16-bit alpha, red, green, blue.
pub fn of(raster: &Raster) -> u32 {
    let mut table = [0_u32; 256];
    for (index, entry) in (0..).zip(&mut table) {
        *entry = (0..8).fold(index, |c: u32, _| {
            (c >> 1) ^ if c & 1 == 1 { 0xEDB8_8320 } else { 0 }
        });
    }
    let byte = |crc: u32, byte: u8| table[usize::from(crc as u8 ^ byte)] ^ (crc >> 8);
    raster.pixels().iter().fold(0, |crc, grey| {
        // A grey level of 8 bits is written twice to make 16.
        let pixel = [0xFF, 0xFF, *grey, *grey, *grey, *grey, *grey, *grey];
        pixel.into_iter().fold(crc, byte)
    })
}
