//! A simulated projector controller for structured light, at one address of an I²C bus.
//!
//! It knows TI's command tables by itself (software programmer's guides DLPU075 and DLPU081) and
//! nothing of the driver that it judges. It can be unplugged, switched off and on, disturbed, and
//! be another controller than expected.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use embedded_hal::i2c::{ErrorKind, ErrorType, I2c, NoAcknowledgeSource, Operation};

/// A command: opcode, number of parameters, number of bytes in its answer (0 for a write).
const COMMANDS: [(u8, usize, usize); 21] = [
    (0x05, 1, 0),
    (0x06, 0, 1),
    (0x50, 1, 0),
    (0x51, 0, 1),
    (0x52, 1, 0),
    (0x53, 0, 1),
    (0x54, 6, 0),
    (0x55, 0, 6),
    (0x5D, 0, 6),
    (0x80, 2, 0),
    (0x81, 0, 3),
    (0x92, 5, 0),
    (0x93, 1, 5),
    (0x96, 15, 0),
    (0x97, 0, 15),
    (0x9D, 6, 13),
    (0xD0, 0, 1),
    (0xD1, 0, 4),
    (0xD3, 1, 2),
    (0xD4, 0, 1),
    (0xD6, 0, 2),
];

/// What can go wrong, set by a test.
#[derive(Clone, Debug)]
pub struct Disturbances {
    /// No device answers at any address.
    pub unplugged: bool,
    /// So many of the next transfers are not acknowledged.
    pub not_acknowledged: u32,
    /// Answers have so many bytes at most; the idle bus reads as FFh after them.
    pub answered_bytes: usize,
    /// Writes are acknowledged and have no effect.
    pub deaf: bool,
}

/// The registers of a controller.
#[derive(Clone, Debug)]
pub struct Registers {
    /// Device id: 0Bh is a DLPC3478, 0Ch a DLPC3479, 0Fh a DLPC3470.
    pub id: u8,
    /// Short status; 81h once it has started.
    pub short_status: u8,
    /// System status.
    pub system_status: [u8; 4],
    /// Temperature, 0.1 °C.
    pub temperature: u16,
    /// Operating mode: 0 external video, 3 external patterns.
    pub mode: u8,
    /// LED output control: 1 is CAIC.
    pub led_control: u8,
    /// Enabled LEDs.
    pub leds: u8,
    /// LED currents, red, green, blue.
    pub currents: [u16; 3],
    /// The largest LED currents.
    pub largest: [u16; 3],
    /// LABB control and strength.
    pub labb: [u8; 2],
    /// Trigger outputs: flags and delay of each.
    pub triggers: [[u8; 5]; 2],
    /// Pattern configuration.
    pub patterns: [u8; 15],
    /// Least illumination time, dark time before and after, µs.
    pub least_us: [u32; 3],
    /// Communication errors and the opcode that was aborted.
    pub errors: [u8; 2],
}

impl Default for Registers {
    /// The registers after power-on: those of a DLPC3478 that shows video and adapts its
    /// brightness.
    fn default() -> Self {
        Self {
            id: 0x0B,
            short_status: 0x81,
            system_status: [0, 0b111, 0, 0],
            temperature: 412,
            mode: 0,
            led_control: 1,
            leds: 0b111,
            currents: [300, 310, 320],
            largest: [700, 700, 650],
            labb: [0x61, 0x40],
            triggers: [[0; 5]; 2],
            patterns: [0; 15],
            least_us: [1818, 171, 31],
            errors: [0; 2],
        }
    }
}

/// A bus with a simulated controller. Clones are the same bus.
#[derive(Clone)]
pub struct ControllerBus(Arc<Mutex<State>>);

struct State {
    address: u8,
    registers: Registers,
    disturbances: Disturbances,
    answer: Vec<u8>,
}

impl ControllerBus {
    /// A bus with a controller at an address of 7 bits.
    pub fn new(address: u8, registers: Registers) -> Self {
        let disturbances = Disturbances {
            unplugged: false,
            not_acknowledged: 0,
            answered_bytes: usize::MAX,
            deaf: false,
        };
        Self(Arc::new(Mutex::new(State {
            address,
            registers,
            disturbances,
            answer: Vec::new(),
        })))
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The controller's registers now.
    pub fn registers(&self) -> Registers {
        self.lock().registers.clone()
    }

    /// Changes its registers, as nature or another program would.
    pub fn change(&self, change: impl FnOnce(&mut Registers)) {
        change(&mut self.lock().registers);
    }

    /// Changes what goes wrong.
    pub fn disturb(&self, change: impl FnOnce(&mut Disturbances)) {
        change(&mut self.lock().disturbances);
    }

    /// Switches the projector off and on: it shows video again.
    pub fn power_cycle(&self) {
        self.lock().registers = Registers::default();
    }
}

impl ErrorType for ControllerBus {
    type Error = ErrorKind;
}

impl I2c for ControllerBus {
    fn transaction(
        &mut self,
        address: u8,
        operations: &mut [Operation<'_>],
    ) -> Result<(), ErrorKind> {
        let mut state = self.lock();
        let silent = state.disturbances.unplugged || address != state.address;
        if silent || state.disturbances.not_acknowledged > 0 {
            state.disturbances.not_acknowledged =
                state.disturbances.not_acknowledged.saturating_sub(1);
            return Err(ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address));
        }
        for operation in operations {
            match operation {
                Operation::Write(bytes) => state.take(bytes),
                Operation::Read(into) => {
                    let answered = state.answer.iter().take(state.disturbances.answered_bytes);
                    let answered = answered.copied().chain(std::iter::repeat(0xFF));
                    into.iter_mut()
                        .zip(answered)
                        .for_each(|(to, from)| *to = from);
                }
            }
        }
        Ok(())
    }
}

impl State {
    /// Takes a command.
    fn take(&mut self, bytes: &[u8]) {
        let [opcode, parameters @ ..] = bytes else {
            return;
        };
        let mut commands = COMMANDS.iter();
        let error = match commands.find(|(known, ..)| known == opcode) {
            None => 1 << 0,
            Some((_, count, _)) if *count != parameters.len() => 1 << 5,
            Some((_, _, 0)) if self.disturbances.deaf => 0,
            Some((_, _, 0)) => self.registers.write(*opcode, parameters),
            Some((_, _, length)) => {
                self.answer = self.registers.read(*opcode, parameters);
                self.answer.resize(*length, 0);
                0
            }
        };
        if error != 0 {
            self.registers.errors = [error, *opcode];
        }
    }
}

impl Registers {
    /// Carries a write out; returns the communication error, 0 if there is none.
    fn write(&mut self, opcode: u8, parameters: &[u8]) -> u8 {
        const INVALID_VALUE: u8 = 1 << 1;
        let byte = parameters[0];
        match opcode {
            0x05 if byte <= 5 || byte == 0xFF => self.mode = byte,
            0x50 if byte <= 1 => self.led_control = byte,
            0x52 if byte <= 0b111 => self.leds = byte,
            0x54 => {
                let currents = parameters.chunks_exact(2);
                let currents = currents.map(|pair| u16::from(pair[0]) | u16::from(pair[1]) << 8);
                for ((to, most), current) in
                    self.currents.iter_mut().zip(self.largest).zip(currents)
                {
                    *to = current.min(most);
                }
            }
            0x80 if byte & 0b11 <= 2 => self.labb = [byte, parameters[1]],
            0x92 => self.triggers[usize::from(byte & 1)].copy_from_slice(parameters),
            0x96 => {
                self.patterns.copy_from_slice(parameters);
                let times = parameters[3..].chunks_exact(4).map(long);
                // Illumination, dark time before, dark time after.
                let unsupported = times
                    .zip(self.least_us)
                    .position(|(time, least)| time < least);
                let sensing = unsupported.map_or(0, |at| at as u8 + 1);
                self.system_status[2] = self.system_status[2] & 0b111 | sensing << 3;
            }
            _ => return INVALID_VALUE,
        }
        0
    }

    fn read(&self, opcode: u8, parameters: &[u8]) -> Vec<u8> {
        let words = |currents: [u16; 3]| currents.into_iter().flat_map(u16::to_le_bytes).collect();
        match opcode {
            0x06 => vec![self.mode],
            0x51 => vec![self.led_control],
            0x53 => vec![self.leds],
            0x55 => words(self.currents),
            0x5D => words(self.largest),
            0x81 => vec![self.labb[0], self.labb[1], 0],
            0x93 => self.triggers[usize::from(parameters[0] & 1)].to_vec(),
            0x97 => self.patterns.to_vec(),
            0x9D => {
                let external_mono = parameters[..2] == [0, 2];
                let supported = external_mono && long(&parameters[2..]) >= self.least_us[0];
                let times = self.least_us.into_iter().flat_map(u32::to_le_bytes);
                [u8::from(supported)].into_iter().chain(times).collect()
            }
            0xD0 => vec![self.short_status],
            0xD1 => self.system_status.to_vec(),
            0xD3 => self.errors.to_vec(),
            0xD4 => vec![self.id],
            0xD6 => self.temperature.to_le_bytes().to_vec(),
            _ => Vec::new(),
        }
    }
}

/// Four bytes, the least significant first.
fn long(bytes: &[u8]) -> u32 {
    let bytes = bytes.iter().rev();
    bytes.fold(0, |number, byte| number << 8 | u32::from(*byte))
}
