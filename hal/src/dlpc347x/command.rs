//! The commands that are used, how their parameters and answers are laid out, and what the answers
//! say of the controller's condition.
//!
//! Each constant is an opcode, with its name in TI's guides and in brackets the function of TI's
//! generated interface that has the same layout. The guides are the software programmer's guides of
//! the DLPC3470 and DLPC3478 (Texas Instruments, DLPU075, 2018) and of the DLPC3479 (DLPU081,
//! 2019), section 3; the interface is `dlpc347x.c` and `dlpc347x.h` (Texas Instruments, command
//! specification 1.0, 2019), which is part of TI's evaluation software and of several public
//! projects. Numbers of more than one byte have the least significant byte first.
//!
//! There is no command for dithering or the degamma curve in these sources, so they cannot be
//! switched here; what is left of them is measured as the response of the projector.

use crate::projector::fault;
use crate::setup::Led;

/// Write Operating Mode Select: one byte, [`PATTERN_STREAMING`] and others
/// [`DLPC347X_WriteOperatingModeSelect`].
pub const WRITE_MODE: u8 = 0x05;
/// Read Operating Mode Select: one byte [`DLPC347X_ReadOperatingModeSelect`].
pub const READ_MODE: u8 = 0x06;
/// The operating mode "external pattern streaming": patterns come over the video input, and image
/// processing is not applied [`DLPC347X_OM_SENS_EXTERNAL_PATTERN`].
pub const PATTERN_STREAMING: u8 = 3;

/// Write LED Output Control Method: 0 manual, which disables CAIC (content-adaptive illumination
/// control), 1 automatic [`DLPC347X_WriteLedOutputControlMethod`].
pub const WRITE_LED_CONTROL: u8 = 0x50;
/// Read LED Output Control Method: one byte [`DLPC347X_ReadLedOutputControlMethod`].
pub const READ_LED_CONTROL: u8 = 0x51;
/// Write RGB LED Enable: bit 0 red, 1 green, 2 blue [`DLPC347X_WriteRgbLedEnable`].
pub const WRITE_LED_ENABLE: u8 = 0x52;
/// Write RGB LED Current: two bytes each for red, green, blue, in steps of the LED driver
/// [`DLPC347X_WriteRgbLedCurrent`].
pub const WRITE_LED_CURRENT: u8 = 0x54;
/// Read RGB LED Current: as written [`DLPC347X_ReadRgbLedCurrent`].
pub const READ_LED_CURRENT: u8 = 0x55;
/// Read RGB LED Max Current: the largest values that the firmware allows, as READ_LED_CURRENT
/// [`DLPC347X_ReadRgbLedMaxCurrent`].
pub const READ_LED_MAX_CURRENT: u8 = 0x5D;

/// Write Local Area Brightness Boost Control (LABB): bits 0-1 the control, 0 off; bits 4-7
/// sharpness; then a byte of strength [`DLPC347X_WriteLocalAreaBrightnessBoostControl`].
pub const WRITE_LABB: u8 = 0x80;
/// Read Local Area Brightness Boost Control: as written, then a byte of gain
/// [`DLPC347X_ReadLocalAreaBrightnessBoostControl`].
pub const READ_LABB: u8 = 0x81;

/// Write Trigger Out Configuration: bit 0 which (0 TRIG_OUT_1, 1 TRIG_OUT_2), bit 1 enable, bit 2
/// inversion; then a delay of four bytes, µs [`DLPC347X_WriteTriggerOutConfiguration`]. TRIG_OUT_1
/// marks a frame, with reference to its VSYNC; TRIG_OUT_2 is active while a pattern is exposed
/// (data sheets of the DLPC3478 and the DLPC3479, 8-bit monochrome patterns).
pub const WRITE_TRIGGER_OUT: u8 = 0x92;
/// Write Pattern Configuration: the kind of patterns, their number per frame, the LEDs (as
/// WRITE_LED_ENABLE), then four bytes each: illumination time, dark time before, dark time after,
/// µs [`DLPC347X_WritePatternConfiguration`].
pub const WRITE_PATTERNS: u8 = 0x96;
/// Read Pattern Configuration: as written [`DLPC347X_ReadPatternConfiguration`].
pub const READ_PATTERNS: u8 = 0x97;
/// Patterns of 8 bit in one colour [`DLPC347X_ST_EIGHT_BIT_MONO`].
pub const EIGHT_BIT_MONO: u8 = 2;
/// Read Validate Exposure Time: asked with the kind of streaming (0 external), the kind of patterns
/// and an illumination time of four bytes, µs; answered with a byte, bit 0 supported, and four
/// bytes each: least illumination time, least dark times before and after, µs
/// [`DLPC347X_ReadValidateExposureTime`].
pub const READ_VALID_EXPOSURE: u8 = 0x9D;

/// Read Short Status: a byte of bits [`DLPC347X_ReadShortStatus`].
pub const READ_SHORT_STATUS: u8 = 0xD0;
/// Read System Status: four bytes, a byte of bits [`DLPC347X_ReadSystemStatus`].
pub const READ_SYSTEM_STATUS: u8 = 0xD1;
/// Read Communication Status, asked with 2 for the I²C bus: a byte of errors and the opcode of the
/// command that was aborted [`DLPC347X_ReadCommunicationStatus`].
pub const READ_COMMUNICATION_STATUS: u8 = 0xD3;
/// Read Controller Device ID: one byte, see [`device_name`] [`DLPC347X_ReadControllerDeviceId`].
pub const READ_DEVICE_ID: u8 = 0xD4;
/// Read System Temperature: two bytes, 0.1 °C [`DLPC347X_ReadSystemTemperature`].
pub const READ_TEMPERATURE: u8 = 0xD6;

/// The name of a controller by its device id [`DLPC347X_ControllerDeviceId_e`]; `None` for an id
/// that TI's interface does not list.
pub fn device_name(id: u8) -> Option<&'static str> {
    Some(match id {
        0x0 => "DLPC3430",
        0x1 => "DLPC3433",
        0x2 => "DLPC3432",
        0x3 => "DLPC3434",
        0x4 => "DLPC3435",
        0x5 => "DLPC3438",
        0x6 => "DLPC3436",
        0x7 => "DLPC3437",
        0x8 => "DLPC3472",
        0x9 => "DLPC3439",
        0xA => "DLPC3440",
        0xB => "DLPC3478",
        0xC => "DLPC3479",
        0xF => "DLPC3470",
        _ => return None,
    })
}

/// Whether a controller with this id streams patterns: those that the two guides are for.
pub fn streams_patterns(id: u8) -> bool {
    matches!(id, 0xB | 0xC | 0xF)
}

/// The bit of an LED, in WRITE_LED_ENABLE and WRITE_PATTERNS.
pub fn led_bit(led: Led) -> u8 {
    1 << led_index(led)
}

/// The place of an LED among red, green, blue.
pub fn led_index(led: Led) -> usize {
    match led {
        Led::Red => 0,
        Led::Green => 1,
        Led::Blue => 2,
    }
}

/// WRITE_PATTERNS for one pattern of 8 bit in one colour per frame; times in µs.
pub fn patterns(led: Led, illumination_us: u32, dark_us: [u32; 2]) -> [u8; 16] {
    let mut bytes = [0; 16];
    bytes[..4].copy_from_slice(&[WRITE_PATTERNS, EIGHT_BIT_MONO, 1, led_bit(led)]);
    bytes[4..8].copy_from_slice(&illumination_us.to_le_bytes());
    bytes[8..12].copy_from_slice(&dark_us[0].to_le_bytes());
    bytes[12..].copy_from_slice(&dark_us[1].to_le_bytes());
    bytes
}

/// WRITE_TRIGGER_OUT for the trigger output 1 or 2: enabled, not inverted, not delayed.
pub fn trigger_out(output: u8) -> [u8; 6] {
    [WRITE_TRIGGER_OUT, (output - 1) | 1 << 1, 0, 0, 0, 0]
}

/// READ_VALID_EXPOSURE for an illumination time, µs.
pub fn valid_exposure(illumination_us: u32) -> [u8; 7] {
    let [a, b, c, d] = illumination_us.to_le_bytes();
    [READ_VALID_EXPOSURE, 0, EIGHT_BIT_MONO, a, b, c, d]
}

/// The four-byte number at `at` of an answer.
pub fn number(answer: &[u8; 13], at: usize) -> u32 {
    let mut bytes = [0; 4];
    bytes.copy_from_slice(&answer[at..at + 4]);
    u32::from_le_bytes(bytes)
}

/// The currents of the LEDs in an answer, steps.
pub fn currents(answer: [u8; 6]) -> [u16; 3] {
    let [a, b, c, d, e, f] = answer;
    [[a, b], [c, d], [e, f]].map(u16::from_le_bytes)
}

/// The temperature in an answer, °C. TI's interface reads it without a sign, and the guides' form
/// of a negative one is not known here, so that more than 150 °C is taken for not known.
pub fn celsius(answer: [u8; 2]) -> Option<f64> {
    Some(f64::from(u16::from_le_bytes(answer)) / 10.0).filter(|celsius| *celsius <= 150.0)
}

/// READ_SHORT_STATUS [`DLPC347X_ShortStatus_s`] bit 0: initialised.
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

/// The faults that both answers report ([`DLPC347X_ShortStatus_s`, `DLPC347X_SystemStatus_s`]), as
/// bits of [`fault`].
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
