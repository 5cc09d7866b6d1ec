//! The driver of a projector's controller, against the simulated one.

use crate::controller::{ControllerBus, Registers};
use embedded_hal::i2c::{ErrorKind as BusKind, ErrorType, I2c, NoAcknowledgeSource, Operation};
use hal::dlpc347x::{Controlled, Controller};
use hal::error::{Error, ErrorKind};
use hal::projector::{Flip, Projector, Raster};
use hal::projector::{fault, processing};
use hal::setup::Led;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};
use std::time::Duration;

const ADDRESS: u8 = 0x1B;
const REFRESH: Duration = Duration::from_micros(16_667);

fn bus() -> ControllerBus {
    ControllerBus::new(ADDRESS, Registers::default())
}

fn open(bus: &ControllerBus) -> Result<Controller<ControllerBus>, Error> {
    Controller::open(bus.clone(), ADDRESS, Led::Blue)
}

/// A display without a projector behind it.
struct Screen;

impl Projector for Screen {
    fn size(&self) -> (u32, u32) {
        (8, 8)
    }

    fn refresh(&self) -> Duration {
        REFRESH
    }

    fn load_behind(&mut self, _: usize, _: Vec<Raster>) -> Result<(), Error> {
        Ok(())
    }

    fn queue(&mut self, _: usize) -> Result<(), Error> {
        Ok(())
    }

    fn poll_flip(&mut self) -> Result<Option<Flip>, Error> {
        Ok(None)
    }

    fn blank(&mut self) -> Result<(), Error> {
        Ok(())
    }
}

fn controlled(bus: &ControllerBus) -> Result<Controlled<ControllerBus>, Error> {
    Controlled::new(Box::new(Screen), open(bus)?, None, Duration::ZERO)
}

#[test]
fn each_setting_has_arrived_and_the_state_is_that_of_the_controller() {
    let bus = bus();
    let mut controller = open(&bus).unwrap();
    let before = controller.state().unwrap();
    let video = processing::VIDEO | processing::CAIC | processing::LABB | processing::SHARPNESS;
    assert_eq!(before.processing, video);
    controller.set_up(Some(600), REFRESH).unwrap();
    let set = bus.registers();
    assert_eq!((set.mode, set.led_control, set.leds), (3, 0, 0b100));
    assert_eq!((set.labb, set.currents[2]), ([0, 0], 600));
    // Enabled, not inverted, no delay; bit 0 is the output.
    assert_eq!(set.triggers, [[0b10, 0, 0, 0, 0], [0b11, 0, 0, 0, 0]]);
    // One pattern of 8 bit in blue per frame, as long as the refresh allows: 16,667 − 171 − 31 µs.
    let times = [16_465_u32, 171, 31].map(u32::to_le_bytes).concat();
    assert_eq!(set.patterns[..], [&[2, 1, 0b100], &times[..]].concat());
    assert_eq!(set.errors, [0, 0], "a command was not understood");
    let state = controller.state().unwrap();
    assert_eq!((state.processing, state.faults), (0, 0));
    assert_eq!((state.device, state.led_current), ("DLPC3478", 600));
    assert_eq!(state.temperature_c, Some(41.2));
}

#[test]
fn every_controller_for_patterns_is_accepted_and_every_other_is_named() {
    for id in 0..=u8::MAX {
        let bus = bus();
        bus.change(|registers| registers.id = id);
        match open(&bus) {
            Ok(_) => assert!([0x0B, 0x0C, 0x0F].contains(&id), "{id:02x}h"),
            Err(error) => {
                assert_eq!(error.kind(), ErrorKind::Unsupported);
                let words = error.to_string();
                assert!(words.contains(&format!("{id:02x}h")), "{words}");
                assert!(words.contains("controller = \"none\""), "{words}");
            }
        }
    }
}

#[test]
fn each_fault_of_the_controller_has_its_bit() {
    type Change = fn(&mut Registers);
    let faults: [(Change, u16); 10] = [
        (|r| r.system_status[0] = 1, fault::DMD),
        (|r| r.system_status[0] = 4, fault::DMD),
        (|r| r.system_status[1] |= 0b10_0000, fault::LED),
        (|r| r.system_status[2] = 0b01, fault::SEQUENCE),
        (|r| r.system_status[2] = 0b100, fault::SUPPLY),
        (|r| r.system_status[2] = 5 << 3, fault::PATTERN_TIMING),
        (|r| r.system_status[3] = 1 << 4, fault::CONFIGURATION),
        (|r| r.system_status[3] = 1 << 5, fault::WATCHDOG),
        (|r| r.short_status |= 1 << 5, fault::FLASH),
        (|r| r.system_status[1] = 0b111, 0),
    ];
    for (change, expected) in faults {
        let bus = bus();
        let mut controller = open(&bus).unwrap();
        bus.change(change);
        assert_eq!(controller.state().unwrap().faults, expected);
    }
    let bus = bus();
    bus.change(|registers| registers.temperature = 0xFFFF);
    let state = open(&bus).unwrap().state().unwrap();
    assert_eq!(state.temperature_c, None);
}

#[test]
fn what_the_projector_cannot_do_is_refused_with_its_limit() {
    let bus = bus();
    let mut controller = open(&bus).unwrap();
    let error = controller.set_up(Some(651), REFRESH).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Unsupported);
    assert!(error.to_string().contains("650"), "{error}");
    bus.change(|registers| registers.least_us[0] = 20_000);
    let error = controller.set_up(None, REFRESH).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Unsupported);
    assert!(error.to_string().contains("16667 µs"), "{error}");
}

#[test]
fn a_disturbed_transfer_is_repeated_and_settings_without_effect_are_an_error() {
    let bus = bus();
    bus.disturb(|it| it.not_acknowledged = 2);
    let mut controller = open(&bus).unwrap();
    bus.disturb(|it| it.deaf = true);
    let error = controller.set_up(None, REFRESH).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Protocol);
    assert!(error.to_string().contains("CAIC"), "{error}");
    bus.disturb(|it| it.deaf = false);
    controller.set_up(None, REFRESH).unwrap();
}

#[test]
fn a_controller_that_is_missing_elsewhere_or_still_starting_is_gone_until_it_is_there() {
    let bus = bus();
    let wrong = Controller::open(bus.clone(), 0x1D, Led::Blue)
        .err()
        .unwrap();
    let unplugged = {
        bus.disturb(|it| it.unplugged = true);
        let error = open(&bus).err().unwrap();
        bus.disturb(|it| it.unplugged = false);
        error
    };
    bus.change(|registers| registers.short_status = 0x80);
    let starting = open(&bus).err().unwrap();
    for (error, word) in [(wrong, "0x1d"), (unplugged, "0x1b"), (starting, "started")] {
        assert_eq!(error.kind(), ErrorKind::Disconnected);
        let words = error.to_string();
        assert!(
            words.contains(word) && words.contains("I²C wires"),
            "{words}"
        );
    }
    bus.change(|registers| registers.short_status = 0x81);
    assert!(open(&bus).is_ok());
}

#[test]
fn a_projector_that_is_unplugged_or_switched_off_and_on_is_gone_and_is_set_up_again() {
    let bus = bus();
    let projector = controlled(&bus).unwrap();
    assert_eq!(projector.present(), Ok(()));
    assert_eq!(projector.controller().unwrap().processing, 0);

    bus.disturb(|it| it.unplugged = true);
    let gone = projector.present().unwrap_err();
    assert_eq!(gone.kind(), ErrorKind::Disconnected);
    assert!(controlled(&bus).is_err(), "nothing to set up");
    bus.power_cycle();
    bus.disturb(|it| it.unplugged = false);
    let video = projector.present().unwrap_err();
    assert_eq!(video.kind(), ErrorKind::Disconnected);
    assert!(video.to_string().contains("switched off and on"), "{video}");

    let again = controlled(&bus).unwrap();
    assert_eq!(again.present(), Ok(()));
    assert_eq!(bus.registers().mode, 3);
}

#[test]
fn a_short_answer_ends_in_an_error_or_in_a_fault_and_never_in_a_pass() {
    for bytes in 0..4 {
        let bus = bus();
        let projector = controlled(&bus).unwrap();
        bus.disturb(|it| it.answered_bytes = bytes);
        // The rest of the bytes reads as FFh.
        let well = projector.present().is_ok() && projector.controller().unwrap().faults == 0;
        // Four bytes hold the whole status; of the other answers only the currents are longer.
        assert!(!well, "{bytes} bytes of an answer passed");
        bus.disturb(|it| it.answered_bytes = usize::MAX);
        assert_eq!(projector.present(), Ok(()));
    }
}

/// A bus on which anything may happen.
struct Noise(Xoshiro256PlusPlus);

impl ErrorType for Noise {
    type Error = BusKind;
}

impl I2c for Noise {
    fn transaction(&mut self, _: u8, operations: &mut [Operation<'_>]) -> Result<(), BusKind> {
        for operation in operations {
            if let Operation::Read(into) = operation {
                self.0.fill_bytes(into);
                // What lets the driver come further than its first question.
                if into.len() == 1 && self.0.next_u32().is_multiple_of(2) {
                    into[0] = [0x0B, 0x81, 0x03, 0x00][self.0.next_u32() as usize % 4];
                }
            }
        }
        match self.0.next_u32() % 16 {
            0 => Err(BusKind::NoAcknowledge(NoAcknowledgeSource::Data)),
            1 => Err(BusKind::Bus),
            _ => Ok(()),
        }
    }
}

#[test]
fn random_bytes_end_in_errors_with_a_remedy_and_never_in_a_panic() {
    let mut opened = 0;
    for seed in 0..20_000 {
        let noise = Noise(Xoshiro256PlusPlus::seed_from_u64(seed));
        let all = || {
            let mut controller = Controller::open(noise, ADDRESS, Led::Green)?;
            opened += 1;
            controller.set_up(Some(5), REFRESH)?;
            controller.state()
        };
        if let Err(error) = all() {
            assert!(error.to_string().contains(": "), "{error}");
        }
    }
    assert!(opened > 100, "only {opened} came further than the id");
}
