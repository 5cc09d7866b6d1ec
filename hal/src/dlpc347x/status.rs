//! What a controller says of its own condition, from READ_SHORT_STATUS and READ_SYSTEM_STATUS.
//!
//! Bits as in `DLPC347X_ShortStatus_s` and `DLPC347X_SystemStatus_s` of TI's interface
//! ([`super::command`]).

use crate::controller::fault;

/// READ_SHORT_STATUS bit 0: initialised.
const INITIALISED: u8 = 1 << 0;
/// READ_SHORT_STATUS bit 5: an error of the flash memory.
const FLASH_ERROR: u8 = 1 << 5;
/// READ_SHORT_STATUS bit 6: the timing of the patterns is not supported.
const SENSING_ERROR: u8 = 1 << 6;
/// READ_SHORT_STATUS bit 7: the main application runs, not the one that updates the flash memory.
const MAIN_APPLICATION: u8 = 1 << 7;

/// Whether the controller has started.
pub fn is_started(short: u8) -> bool {
    short & (INITIALISED | MAIN_APPLICATION) == INITIALISED | MAIN_APPLICATION
}

/// The faults that both answers report, as bits of [`fault`].
pub fn faults(short: u8, [dmd, leds, sequence, system]: [u8; 4]) -> u16 {
    let bit = |set: bool, fault: u16| if set { fault } else { 0 };
    // Device, interface or training of the micromirror device.
    bit(dmd & 0b111 != 0, fault::DMD)
        // Errors of the red, green and blue LED; the bits below them say which are on.
        | bit(leds & 0b11_1000 != 0, fault::LED)
        // Aborted, and an error.
        | bit(sequence & 0b11 != 0, fault::SEQUENCE)
        | bit(sequence & 0b100 != 0, fault::SUPPLY)
        | bit(sequence >> 3 != 0 || short & SENSING_ERROR != 0, fault::PATTERN_TIMING)
        | bit(system & 0b1_0000 != 0, fault::CONFIGURATION)
        | bit(system & 0b10_0000 != 0, fault::WATCHDOG)
        | bit(short & FLASH_ERROR != 0, fault::FLASH)
}

/// What is wrong with the timing of the patterns [`DLPC347X_SensingError_e`].
pub fn timing_error(sequence: u8) -> Option<&'static str> {
    Some(match sequence >> 3 {
        0 => return None,
        1 => "the illumination time is not supported",
        2 => "the dark time before a pattern is not supported",
        3 => "the dark time after a pattern is not supported",
        4 => "the delay of TRIG_OUT_1 is not supported",
        5 => "the delay of TRIG_OUT_2 is not supported",
        6 => "there are too many entries in the table of patterns",
        _ => "the timing of the patterns is not supported",
    })
}
