//! TI's controllers DLPC3470, DLPC3478 and DLPC3479 of projectors for structured light, over I²C.
//!
//! Such a controller starts as one for video: it shows colours one after the other, and adapts
//! brightness to the content of a picture, so that a grey level does not give the same light in
//! every pattern. [`Controller::set_up`] chooses external pattern streaming: each frame of the
//! video input is one pattern of 8 bit in one colour. Commands and layouts are in `command`.
//!
//! [`Controlled`] is a projector on a display connector whose controller was set up, and is watched.
//!
//! A read is a write of the command, with a stop, and then a read, as in TI's own programs; so
//! nothing else may talk to this controller in between. Every call is tried three times.

#[cfg(feature = "i2c")]
pub mod bus;
mod command;

use crate::clock::monotonic;
use crate::error::{DeviceKind, Error};
use crate::projector::{ControllerState, processing};
use crate::projector::{Flip, Projector, Raster};
use crate::setup::Led;
use crate::units::Timestamp;
use command as c;
use embedded_hal::i2c::{Error as _, I2c};
use std::cell::RefCell;
use std::time::Duration;

/// How often a call is tried: a disturbed transfer need not end a measurement.
const ATTEMPTS: u32 = 3;

/// A controller that answers at its address with a known id.
pub struct Controller<I> {
    bus: I,
    address: u8,
    device: &'static str,
    led: Led,
}

impl<I: I2c> Controller<I> {
    /// Finds the controller at an address of 7 bits: 0x1B, or 0x1D if its address pin is high (36h
    /// and 3Ah with the bit for reading; DLPU072, table 1-1, for this family). `led` is the colour
    /// that patterns are shown in.
    ///
    /// # Errors
    /// `Disconnected` if nothing answers or it is still starting, `Unsupported` if it is another
    /// controller.
    pub fn open(bus: I, address: u8, led: Led) -> Result<Self, Error> {
        let mut found = Self {
            bus,
            address,
            device: "controller",
            led,
        };
        let [id] = found.read("its id", &[c::READ_DEVICE_ID])?;
        let name = c::device_name(id);
        found.device = name
            .filter(|_| c::streams_patterns(id))
            .ok_or_else(|| {
                let name = name.unwrap_or("unknown controller");
                let attempt = format!("streaming patterns with the {name} (id {id:02x}h) at I²C address {address:#04x}");
                Error::unsupported(attempt, "it is no DLPC3470, DLPC3478 or DLPC3479: name its bus and address, or set head.projector.controller = \"none\"")
            })?;
        let [short] = found.read("its status", &[c::READ_SHORT_STATUS])?;
        if !c::is_started(short) {
            return Err(found.gone(&format!("it has not started (status {short:02x}h)")));
        }
        Ok(found)
    }

    /// Sets the controller up for patterns: CAIC and LABB off, one LED, with this `current` if one
    /// is given, both trigger outputs, one pattern of 8 bit per refresh that is exposed as long as
    /// the controller allows. Each setting is read back.
    ///
    /// # Errors
    /// `Disconnected` if it does not answer, `Unsupported` if the current or the refresh is beyond
    /// its limits, `Protocol` if a setting did not take.
    pub fn set_up(&mut self, current: Option<u16>, refresh: Duration) -> Result<(), Error> {
        self.write("switch CAIC off", &[c::WRITE_LED_CONTROL, 0])?;
        self.write("switch LABB off", &[c::WRITE_LABB, 0, 0])?;
        let leds = [c::WRITE_LED_ENABLE, c::led_bit(self.led)];
        self.write("choose the LED", &leds)?;
        if let Some(current) = current {
            self.set_current(current)?;
        }
        for output in [1, 2] {
            self.write("set a trigger output", &c::trigger_out(output))?;
        }
        let (illumination, dark) = self.exposure(refresh)?;
        let patterns = c::patterns(self.led, illumination, dark);
        self.write("choose patterns of 8 bit", &patterns)?;
        let mode = [c::WRITE_MODE, c::PATTERN_STREAMING];
        self.write("choose pattern streaming", &mode)?;
        self.took(&patterns[1..4])
    }

    /// Its condition, read from it now.
    ///
    /// # Errors
    /// `Disconnected` if it does not answer.
    pub fn state(&mut self) -> Result<ControllerState, Error> {
        let [short] = self.read("its status", &[c::READ_SHORT_STATUS])?;
        let system = self.read("its system status", &[c::READ_SYSTEM_STATUS])?;
        let [mode] = self.read("its mode", &[c::READ_MODE])?;
        let [control] = self.read("its LED control", &[c::READ_LED_CONTROL])?;
        let [labb, ..] = self.read::<3>("its LABB control", &[c::READ_LABB])?;
        let currents = c::currents(self.read("its LED current", &[c::READ_LED_CURRENT])?);
        let temperature = self.read("its temperature", &[c::READ_TEMPERATURE])?;
        let mut processed = 0;
        for (on, bit) in [
            (mode != c::PATTERN_STREAMING, processing::VIDEO),
            (control != 0, processing::CAIC),
            (labb & 0b11 != 0, processing::LABB),
            (labb >> 4 != 0, processing::SHARPNESS),
        ] {
            processed |= if on { bit } else { 0 };
        }
        Ok(ControllerState {
            device: self.device,
            processing: processed,
            faults: c::faults(short, system),
            temperature_c: c::celsius(temperature),
            led_current: currents[c::led_index(self.led)],
        })
    }

    fn set_current(&mut self, current: u16) -> Result<(), Error> {
        let most = self.read("the largest LED current", &[c::READ_LED_MAX_CURRENT])?;
        let most = c::currents(most)[c::led_index(self.led)];
        if current > most {
            return Err(Error::unsupported(
                format!("an LED current of {current} steps"),
                format!(
                    "the projector's firmware allows {most}: set head.projector.led_current to at most that"
                ),
            ));
        }
        let mut bytes = [0; 7];
        bytes[0] = c::WRITE_LED_CURRENT;
        let at = 1 + 2 * c::led_index(self.led);
        bytes[at..at + 2].copy_from_slice(&current.to_le_bytes());
        self.write("set the LED current", &bytes)
    }

    /// The longest illumination of one pattern per refresh, and the dark times before and after,
    /// µs. The controller says how long it must be dark for an illumination time; the rest of the
    /// refresh is the illumination time that it is asked about next.
    fn exposure(&mut self, refresh: Duration) -> Result<(u32, [u32; 2]), Error> {
        let refresh_us = u32::try_from(refresh.as_micros()).unwrap_or(u32::MAX);
        let mut asked = refresh_us;
        for _ in 0..4 {
            let answer: [u8; 13] = self.read("an illumination time", &c::valid_exposure(asked))?;
            let dark = [c::number(&answer, 5), c::number(&answer, 9)];
            let room = refresh_us.saturating_sub(dark[0].saturating_add(dark[1]));
            if answer[0] & 1 == 1 && asked <= room {
                return Ok((asked, dark));
            }
            asked = room.min(asked);
        }
        Err(Error::unsupported(
            format!("exposing one pattern of 8 bit in a refresh of {refresh_us} µs"),
            "choose a mode that the controller supports: up to 120 Hz on a DLPC3478, 60 Hz on a DLPC3479",
        ))
    }

    /// Checks that the settings took.
    fn took(&mut self, patterns: &[u8]) -> Result<(), Error> {
        let state = self.state()?;
        let set: [u8; 15] = self.read("its patterns", &[c::READ_PATTERNS])?;
        let [.., sequence, _] = self.read::<4>("its system status", &[c::READ_SYSTEM_STATUS])?;
        let wrong = match c::timing_error(sequence) {
            Some(words) => words.to_owned(),
            None if state.processing != 0 => {
                let on: Vec<&str> = processing::words(state.processing).collect();
                format!("{} stayed on", on.join(", "))
            }
            None if &set[..3] != patterns => {
                format!(
                    "its patterns are {:02x?} instead of {patterns:02x?}",
                    &set[..3]
                )
            }
            None => return Ok(()),
        };
        let [errors, opcode] = self.read("its errors", &[c::READ_COMMUNICATION_STATUS, 2])?;
        let attempt = format!(
            "setting up the {} for patterns ({wrong}; errors {errors:02x}h at command {opcode:02x}h)",
            self.device
        );
        Err(Error::protocol(
            attempt,
            "switch the projector off and on; if it stays so, its firmware is not for pattern streaming",
        ))
    }

    fn write(&mut self, what: &str, bytes: &[u8]) -> Result<(), Error> {
        let address = self.address;
        self.tried(what, bytes, |bus| bus.write(address, bytes))
    }

    fn read<const N: usize>(&mut self, what: &str, request: &[u8]) -> Result<[u8; N], Error> {
        let (address, mut answer) = (self.address, [0; N]);
        let what = format!("read {what}");
        self.tried(&what, request, |bus| {
            bus.write(address, request)?;
            bus.read(address, &mut answer)
        })?;
        Ok(answer)
    }

    fn tried(
        &mut self,
        what: &str,
        bytes: &[u8],
        mut call: impl FnMut(&mut I) -> Result<(), I::Error>,
    ) -> Result<(), Error> {
        let mut failed = None;
        for _ in 0..ATTEMPTS {
            match call(&mut self.bus) {
                Ok(()) => return Ok(()),
                Err(error) => failed = Some(error.kind()),
            }
        }
        let opcode = bytes.first().copied().unwrap_or_default();
        let kind = failed.map_or_else(String::new, |kind| kind.to_string());
        Err(self.gone(&format!("{what}, command {opcode:02x}h: {kind}")))
    }

    fn gone(&self, what: &str) -> Error {
        Error::Disconnected {
            device: DeviceKind::Projector,
            attempt: format!(
                "talking to the projector's {} at I²C address {:#04x} ({what})",
                self.device, self.address
            ),
            remedy: "check the projector's power and the I²C wires, and head.projector.controller_bus and controller_address".into(),
        }
    }
}

/// A projector together with its controller. It is present as long as the controller answers and
/// streams patterns: one that was switched off and on shows video again, and has to be set up
/// again.
pub struct Controlled<I> {
    projector: Box<dyn Projector>,
    polled: RefCell<Polled<I>>,
    period: Duration,
}

/// A controller, and what it said of itself when it was last asked.
struct Polled<I> {
    controller: Controller<I>,
    state: ControllerState,
    at: Timestamp,
}

impl<I: I2c> Controlled<I> {
    /// Sets the controller up for the refresh of a projector; [`Projector::present`] asks it at
    /// most once in a `period`.
    ///
    /// # Errors
    /// As [`Controller::set_up`].
    pub fn new(
        projector: Box<dyn Projector>,
        mut controller: Controller<I>,
        current: Option<u16>,
        period: Duration,
    ) -> Result<Self, Error> {
        controller.set_up(current, projector.refresh())?;
        let polled = Polled {
            state: controller.state()?,
            at: monotonic(),
            controller,
        };
        Ok(Self {
            projector,
            polled: RefCell::new(polled),
            period,
        })
    }
}

impl<I: I2c> Polled<I> {
    /// Asks for the controller's condition.
    fn poll(&mut self) -> Result<(), Error> {
        self.state = self.controller.state()?;
        self.at = monotonic();
        match self.state.processing {
            0 => Ok(()),
            _ => Err(self.controller.gone("it does not stream patterns any more: it was switched off and on, or another program has set it up")),
        }
    }
}

impl<I: I2c + Send> Projector for Controlled<I> {
    fn size(&self) -> (u32, u32) {
        self.projector.size()
    }

    fn refresh(&self) -> Duration {
        self.projector.refresh()
    }

    fn present(&self) -> Result<(), Error> {
        self.projector.present()?;
        let mut polled = self.polled.borrow_mut();
        if monotonic().since(polled.at) < self.period {
            return Ok(());
        }
        polled.poll()
    }

    fn starts_dark(&self) -> bool {
        self.projector.starts_dark()
    }

    fn controller(&self) -> Option<ControllerState> {
        Some(self.polled.borrow().state.clone())
    }

    fn load_behind(&mut self, kept: usize, rasters: Vec<Raster>) -> Result<(), Error> {
        self.projector.load_behind(kept, rasters)
    }

    fn queue(&mut self, index: usize) -> Result<(), Error> {
        self.projector.queue(index)
    }

    fn poll_flip(&mut self) -> Result<Option<Flip>, Error> {
        self.projector.poll_flip()
    }

    fn blank(&mut self) -> Result<(), Error> {
        self.projector.blank()
    }
}
