//! The condition of a projector's controller, as far as a head can ask for it.

/// What a controller says of itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ControllerState {
    /// Its name.
    pub device: &'static str,
    /// What it still does to pictures, as bits of [`processing`]; 0 = it shows patterns as they
    /// are.
    pub processing: u16,
    /// Its faults, as bits of [`fault`].
    pub faults: u16,
    /// Its temperature, °C; none = not known.
    pub temperature_c: Option<f64>,
    /// The current of the LED that is on, in steps of its driver (10 bits).
    pub led_current: u16,
}

/// Bits of [`ControllerState::processing`].
pub mod processing {
    /// It shows video, colour after colour, and not patterns.
    pub const VIDEO: u16 = 1 << 0;
    /// It adapts gain and LED currents to the content of the whole picture.
    pub const CAIC: u16 = 1 << 1;
    /// It boosts the brightness of dark areas.
    pub const LABB: u16 = 1 << 2;
    /// It sharpens edges.
    pub const SHARPNESS: u16 = 1 << 3;

    /// The words of the bits that are set.
    pub fn words(bits: u16) -> impl Iterator<Item = &'static str> {
        super::set(
            bits,
            &[
                "video mode",
                "adaptive brightness (CAIC)",
                "area brightness boost (LABB)",
                "sharpening",
            ],
        )
    }
}

/// Bits of [`ControllerState::faults`].
pub mod fault {
    /// The micromirror device or its interface.
    pub const DMD: u16 = 1 << 0;
    /// An LED.
    pub const LED: u16 = 1 << 1;
    /// The sequence of bit planes.
    pub const SEQUENCE: u16 = 1 << 2;
    /// The supply voltage is low.
    pub const SUPPLY: u16 = 1 << 3;
    /// Times of patterns or triggers are not supported.
    pub const PATTERN_TIMING: u16 = 1 << 4;
    /// The firmware is for another product.
    pub const CONFIGURATION: u16 = 1 << 5;
    /// The controller's watchdog expired.
    pub const WATCHDOG: u16 = 1 << 6;
    /// The flash memory.
    pub const FLASH: u16 = 1 << 7;

    /// The words of the bits that are set.
    pub fn words(bits: u16) -> impl Iterator<Item = &'static str> {
        super::set(
            bits,
            &[
                "micromirror device",
                "LED",
                "sequence",
                "low supply voltage",
                "timing of patterns",
                "product configuration",
                "watchdog",
                "flash memory",
            ],
        )
    }
}

fn set(bits: u16, words: &'static [&'static str]) -> impl Iterator<Item = &'static str> {
    let words = words.iter().enumerate();
    words.filter_map(move |(bit, word)| (bits >> bit & 1 == 1).then_some(*word))
}
