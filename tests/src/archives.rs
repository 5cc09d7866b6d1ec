//! ZIP files as nobody should make them: each member with the bytes of its headers as they are said.

use std::io::Write as _;

/// A member, as it is written.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Its name.
    pub name: String,
    /// Its content.
    pub content: Vec<u8>,
    /// 0 stored, 8 deflated.
    pub method: u16,
    /// The mode of the file, in the upper half as on Unix: 0o120777 is a link.
    pub mode: u32,
    /// The size that the headers say; `None`: that of the content.
    pub said: Option<u32>,
    /// Where the directory says that it begins; `None`: where it does.
    pub at: Option<u32>,
}

impl Entry {
    /// As a backup has it.
    pub fn new(name: &str, content: impl Into<Vec<u8>>) -> Self {
        Self {
            name: name.into(),
            content: content.into(),
            method: 0,
            mode: 0o100_644,
            said: None,
            at: None,
        }
    }
}

/// A ZIP of these members (APPNOTE 6.3.10, sections 4.3.7, 4.3.12 and 4.3.16).
pub fn zip(entries: &[Entry]) -> Vec<u8> {
    let (mut zip, mut directory) = (Vec::new(), Vec::new());
    let short = |at: usize| u16::try_from(at).unwrap_or(u16::MAX).to_le_bytes();
    let long = |at: usize| u32::try_from(at).unwrap_or(u32::MAX).to_le_bytes();
    for entry in entries {
        let at = entry.at.map_or(zip.len(), |at| at as usize);
        let size = entry.said.map_or(entry.content.len(), |said| said as usize);
        let mut common = Vec::new();
        common.extend(20_u16.to_le_bytes());
        common.extend(0_u16.to_le_bytes());
        common.extend(entry.method.to_le_bytes());
        common.extend([0, 0, 0x21, 0]);
        common.extend(crc32(&entry.content).to_le_bytes());
        common.extend(long(entry.content.len()));
        common.extend(long(size));
        common.extend(short(entry.name.len()));
        common.extend(0_u16.to_le_bytes());
        zip.extend(b"PK\x03\x04");
        zip.extend(&common);
        zip.extend(entry.name.as_bytes());
        zip.extend(&entry.content);
        directory.extend(b"PK\x01\x02");
        directory.extend([20, 3]);
        directory.extend(&common);
        directory.extend([0; 6]);
        directory.extend((entry.mode << 16).to_le_bytes());
        directory.extend(long(at));
        directory.extend(entry.name.as_bytes());
    }
    let start = zip.len();
    zip.extend(&directory);
    zip.extend(b"PK\x05\x06\0\0\0\0");
    zip.extend(short(entries.len()));
    zip.extend(short(entries.len()));
    zip.extend(long(directory.len()));
    zip.extend(long(start));
    // A vector takes whatever is written.
    let _ = zip.write_all(&[0; 2]);
    zip
}

/// CRC-32 of ISO 3309, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32| match crc & 1 {
        1 => crc >> 1 ^ 0xEDB8_8320,
        _ => crc >> 1,
    };
    let byte = |crc: u32, byte: &u8| (0..8).fold(crc ^ u32::from(*byte), |crc, _| step(crc));
    !bytes.iter().fold(!0, byte)
}
