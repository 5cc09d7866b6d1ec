//! Settings of a head of real devices: which camera, which projector, which lines.
//!
//! Each back-end opens its device from one of these: `libcamera` from [`CameraSetup`], `kms` from
//! [`ProjectorSetup`], `gpio` from [`TriggerSetup`] and [`LinesSetup`]. They exist in every build,
//! whatever its features, so that a configuration can be read and checked on a computer that has
//! none of the devices.

use std::path::PathBuf;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::bounded;
use crate::bounds::{Longest, MAX_NAME, MAX_PATH, MAX_SIDE};
use crate::camera::Starts;

/// Least gain of a real camera: the amplifier of a sensor does not make less of its samples.
pub const NO_GAIN: f64 = 1.0;
/// Largest gain of any camera.
pub const MOST_GAIN: f64 = 64.0;

bounded! {
    /// Which camera, and how it exposes. Nothing changes while it runs. The defaults are those of
    /// the reference head: one refresh of 60 Hz is exposed, then 1118 lines of 14.8 µs are read out
    /// in 16.56 ms.
    pub struct CameraSetup: Default {
        /// libcamera's id; none = the only camera that is there.
        pub id: Option<String> = Longest(MAX_NAME),
        /// Pixels per row of the sensor's picture; none = the sensor's. A frame of a colour sensor
        /// has half.
        pub width: Option<u32> = 1..=MAX_SIDE,
        /// Rows; none = the sensor's.
        pub height: Option<u32> = 1..=MAX_SIDE,
        /// Exposure, µs: whole refreshes of the projector.
        pub exposure_us: u32 = 1..=1_000_000 => 16_667,
        /// From the start of one exposure to the start of the next, µs: the shortest possible time
        /// of a triggered camera, the fixed time of one that runs by itself.
        pub period_us: u32 => 33_333,
        /// Gain, 1 = none.
        pub gain: f64 = NO_GAIN..=MOST_GAIN => 1.0,
        /// From the end of an exposure until its frame can be fetched, without any delay, µs.
        pub delivery_us: u32 = 0..=1_000_000 => 20_000,
        /// Whether the luminance of a YUV format will do where the camera offers no raw one.
        pub luma: bool,
    }
}

/// The kinds of controllers of projectors that can be set up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ControllerKind {
    /// None: the projector shows what it gets, or is set up by hand.
    #[default]
    None,
    /// TI's DLPC3470, DLPC3478 or DLPC3479 over I²C.
    Dlpc347x,
}

/// An LED of a projector.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Led {
    /// Red.
    Red,
    /// Green.
    Green,
    /// Blue.
    Blue,
}

bounded! {
    /// Which projector, and in which mode; by default any, in its preferred mode, without a
    /// controller to set up.
    pub struct ProjectorSetup: Default {
        /// The card's device file, such as "/dev/dri/card1"; none = the only one with a connector
        /// that fits.
        pub card: Option<PathBuf> = Longest(MAX_PATH),
        /// The kernel's name of the connector, such as "HDMI-A-1" or "DPI-1"; none = the only one
        /// that is connected.
        pub connector: Option<String> = Longest(MAX_NAME),
        /// Columns of the mode; none = the preferred mode's.
        pub width: Option<u32> = 1..=MAX_SIDE,
        /// Rows of the mode; none = the preferred mode's.
        pub height: Option<u32> = 1..=MAX_SIDE,
        /// Refreshes per second; none = the preferred mode's.
        pub refresh_hz: Option<f64> = 1.0..=1000.0,
        /// The kind of its controller.
        pub controller: ControllerKind,
        /// Device file of the controller's I²C bus.
        pub controller_bus: PathBuf = Longest(MAX_PATH) => "/dev/i2c-1".into(),
        /// The controller's address on the bus, 7 bits. Addresses outside these bounds are reserved
        /// (I²C-bus specification, UM10204, section 3.1.12).
        pub controller_address: u8 = 8..=119 => 0x1B,
        /// The LED that patterns are shown with.
        pub led: Led => Led::Blue,
        /// Its current in steps of the LED's driver; none = as the projector's firmware sets it.
        pub led_current: Option<u16> = 0..=1023,
    }
}

bounded! {
    /// The line that starts an exposure of the camera. The defaults are those of the reference head:
    /// a pulse of 16 653 µs exposes for 16 667 µs, and a transistor inverts it for the camera.
    pub struct TriggerSetup: Default {
        /// Label of the GPIO chip.
        pub chip: String = Longest(MAX_NAME) => "pinctrl-rp1".into(),
        /// Name of the line; none = the camera runs by itself, or the projector triggers it.
        pub line: Option<String> = Longest(MAX_NAME),
        /// Whether the projector's trigger output is wired to the camera.
        pub by_projector: bool,
        /// How long a pulse lasts, µs. Many cameras expose for as long as the pulse lasts; a pulse
        /// shorter than half the exposure is assumed to start the exposure only.
        pub pulse_us: u32 = 1..=1_000_000 => 16_653,
        /// Whether the line is low during a pulse and high when idle.
        pub active_low: bool,
    }
}

impl TriggerSetup {
    /// Who starts exposures.
    #[must_use]
    pub fn starts(&self) -> Starts {
        match (&self.line, self.by_projector) {
            (Some(_), _) => Starts::OnTrigger,
            (None, true) => Starts::ByProjector,
            (None, false) => Starts::ByItself,
        }
    }

    /// Whether the camera waits for triggers.
    #[must_use]
    pub fn wired(&self) -> bool {
        self.starts() != Starts::ByItself
    }

    /// How long a pulse lasts.
    #[must_use]
    pub fn pulse(&self) -> Duration {
        Duration::from_micros(u64::from(self.pulse_us))
    }
}

bounded! {
    /// The lines between the station and a press or another machine that starts it by wire. Each is
    /// used only if it is named.
    pub struct LinesSetup: Default {
        /// Label of the GPIO chip.
        pub chip: String = Longest(MAX_NAME) => "pinctrl-rp1".into(),
        /// In: starts a cycle.
        pub start: Option<String> = Longest(MAX_NAME),
        /// Whether the start line is active when low.
        pub start_active_low: bool => true,
        /// How long the start line must keep its level before a start counts, ms.
        pub debounce_ms: u32 = 0..=1000 => 5,
        /// Out: the station is measuring.
        pub busy: Option<String> = Longest(MAX_NAME),
        /// Out: the last part passed.
        pub ok: Option<String> = Longest(MAX_NAME),
        /// Out: the station cannot measure.
        pub fault: Option<String> = Longest(MAX_NAME),
        /// Whether busy, ok and fault are low when they are on.
        pub outputs_active_low: bool,
    }
}

impl LinesSetup {
    /// Whether any line is named.
    #[must_use]
    pub fn any(&self) -> bool {
        [&self.start, &self.busy, &self.ok, &self.fault]
            .into_iter()
            .any(Option::is_some)
    }

    /// How long the start line must keep its level before a start counts.
    #[must_use]
    pub fn debounce(&self) -> Duration {
        Duration::from_millis(u64::from(self.debounce_ms))
    }
}
