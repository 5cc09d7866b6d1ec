//! A display that describes itself (EDID) only after the head was opened: a projector that is
//! switched on later.

use super::machine::in_the_machine;
use super::{open, rasters, show};
use hal::error::ErrorKind;
use hal::kms;
use hal::projector::Projector;
use hal::setup::ProjectorSetup;

/// Columns and rows of its mode.
const SIZE: (u32, u32) = (856, 480);

/// Its description: version 1.3 of VESA's standard, with one detailed timing of 856×480 at 60 Hz.
fn edid() -> [u8; 128] {
    let mut edid = [0; 128];
    edid[1..7].fill(0xFF);
    // Manufacturer "TST", product 1, the first week of 2026.
    edid[8..18].copy_from_slice(&[0x52, 0x74, 1, 0, 0, 0, 0, 0, 1, 36]);
    // Version 1.3, digital, gamma 2.2, the first timing is preferred.
    edid[18..25].copy_from_slice(&[1, 3, 0x80, 0, 0, 0x78, 0x0A]);
    // No standard timings.
    edid[38..54].fill(1);
    // 30 MHz; 856 + 144 columns, 480 + 20 rows; porch and sync 40 + 32 columns, 3 + 5 rows;
    // positive pulses.
    edid[54..66].copy_from_slice(&[
        0xB8, 0x0B, 0x58, 0x90, 0x30, 0xE0, 0x14, 0x10, 40, 32, 0x35, 0,
    ]);
    edid[71] = 0x1E;
    // The other three descriptors are empty.
    for at in [72, 90, 108] {
        edid[at + 3] = 0x10;
    }
    edid[127] = edid.iter().fold(0_u8, |sum, byte| sum.wrapping_sub(*byte));
    edid
}

#[test]
fn a_projector_that_is_switched_on_later_is_shown_the_mode_that_it_describes() {
    if !in_the_machine() {
        return;
    }
    let cable =
        |state: &str| std::fs::write("/sys/class/drm/card0-Virtual-1/status", state).unwrap();
    let describe = |edid: &[u8]| {
        std::fs::write("/sys/kernel/debug/dri/0/Virtual-1/edid_override", edid).unwrap();
        cable("detect");
    };
    let any = ProjectorSetup::default();

    // It has no power while the head is opened, and the kernel was told that it is there: a
    // standard mode is set.
    let (display, _) = open(&any);
    assert_eq!((display.size(), display.present()), ((1024, 768), Ok(())));
    describe(&edid());
    let gone = display.present().unwrap_err();
    assert_eq!(gone.kind(), ErrorKind::Disconnected);
    assert!(gone.to_string().contains("EDID"), "{gone}");
    println!("{gone}");
    drop(display);
    let (mut display, mut clock) = open(&any);
    assert_eq!(display.size(), SIZE);
    assert_eq!(display.present(), Ok(()));
    display.load(rasters(&display, 1)).unwrap();
    show(&mut display, &mut clock, 0);
    drop((display, clock));

    // The kernel finds nothing there until it has power.
    describe(b"reset");
    cable("off");
    assert_eq!(kms::open(&any).unwrap_err().kind(), ErrorKind::Disconnected);
    describe(&edid());
    assert_eq!(kms::open(&any).unwrap().size(), SIZE);

    describe(b"reset");
    assert_eq!(kms::open(&any).unwrap().size(), (1024, 768));
}
