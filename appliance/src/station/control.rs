//! The CONTROL block as the station sees it: stored registers, one write, the edges of one
//! connection, and the PLC's heartbeat.

use super::clock::Micros;
use super::triggers::Client;
use std::ops::{BitAnd, BitOr, Not};
use thiserror::Error;

bits! {
    /// CONTROL bit 0: the PLC asks for the station to be online.
    ONLINE = 0;
    /// CONTROL bit 1 ↑: measure.
    TRIGGER = 1;
    /// CONTROL bit 2 ↑: the PLC has taken the result.
    RESULT_ACK = 2;
    /// CONTROL bit 3 ↑: load the recipe of RECIPE_SELECT.
    RECIPE_LOAD = 3;
    /// CONTROL bit 4 ↑: clear latches, and the fault where possible.
    ERROR_RESET = 4;
    /// CONTROL bit 5 ↑: end the cycle, load or teach in flight.
    ABORT = 5;
    /// CONTROL bit 6: queue every result until it is acknowledged, from now on: the mode ends with
    /// [`UNBUFFERED`] alone.
    BUFFERED = 6;
    /// CONTROL bit 7 ↑: teach the recipe of RECIPE_SELECT.
    TEACH = 7;
    /// CONTROL bit 8 ↑: end BUFFERED mode.
    UNBUFFERED = 8;
}

/// CONTROL bits that must be 0.
pub const RESERVED: u16 = 0xFE00;
/// The bits that act on their rising edge.
pub const EDGES: u16 =
    TRIGGER | RESULT_ACK | RECIPE_LOAD | ERROR_RESET | ABORT | TEACH | UNBUFFERED;

/// RECIPE_SELECT: take the recipe whose key is PART_NUMBER.
pub const BY_PART_NUMBER: u16 = 0xFFFF;
/// The highest recipe number.
pub const MAX_RECIPE: u16 = 9999;

/// What the PLC last wrote, whatever connection it came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ControlRegisters {
    /// Register 0.
    pub control: u16,
    /// Register 1.
    pub token: u16,
    /// Register 2.
    pub recipe_select: u16,
    /// Register 3.
    pub plc_heartbeat: u16,
    /// Registers 4–5.
    pub part_id: u32,
    /// Registers 6–7.
    pub press_stroke: u32,
    /// Registers 8–23: 32 ASCII characters, NUL padded.
    pub part_number: [u8; 32],
}

impl Default for ControlRegisters {
    fn default() -> Self {
        Self {
            control: ONLINE,
            token: 0,
            recipe_select: 0,
            plc_heartbeat: 0,
            part_id: 0,
            press_stroke: 0,
            part_number: [0; 32],
        }
    }
}

impl ControlRegisters {
    /// PART_NUMBER as text: up to the first NUL, without spaces around it; characters that are not
    /// ASCII become `?`.
    pub fn part_number_text(&self) -> String {
        let written = self.part_number.iter().take_while(|&&byte| byte != 0);
        let text: String = written
            .map(|&byte| {
                if byte.is_ascii_graphic() || byte == b' ' {
                    char::from(byte)
                } else {
                    '?'
                }
            })
            .collect();
        text.trim().to_owned()
    }

    /// The registers after a write.
    pub fn written(mut self, write: &ControlWrite) -> Self {
        self.control = write.control.onto(self.control);
        self.token = write.token.unwrap_or(self.token);
        self.recipe_select = write.recipe_select.unwrap_or(self.recipe_select);
        self.plc_heartbeat = write.plc_heartbeat.unwrap_or(self.plc_heartbeat);
        self.part_id = write.part_id.onto(self.part_id);
        self.press_stroke = write.press_stroke.onto(self.press_stroke);
        for (pair, word) in self.part_number.chunks_exact_mut(2).zip(write.part_number) {
            if let Some(word) = word {
                pair.copy_from_slice(&word.to_be_bytes());
            }
        }
        self
    }
}

/// A value whose bits in `mask` are written: half a 32-bit item, or one coil.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Masked<T> {
    /// The bits that the write names.
    pub mask: T,
    /// Their values; the other bits mean nothing.
    pub value: T,
}

impl<T> Masked<T>
where
    T: Copy + Default + Not<Output = T> + BitAnd<Output = T> + BitOr<Output = T>,
{
    /// All bits.
    pub fn all(value: T) -> Self {
        Self {
            mask: !T::default(),
            value,
        }
    }

    /// `old` with the written bits replaced.
    pub fn onto(self, old: T) -> T {
        (old & !self.mask) | (self.value & self.mask)
    }
}

/// One write of the PLC, taken as one unit: only what it names changes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ControlWrite {
    /// CONTROL; a coil names one bit.
    pub control: Masked<u16>,
    /// TRIGGER_TOKEN.
    pub token: Option<u16>,
    /// RECIPE_SELECT.
    pub recipe_select: Option<u16>,
    /// PLC_HEARTBEAT.
    pub plc_heartbeat: Option<u16>,
    /// PART_ID, possibly one half of it.
    pub part_id: Masked<u32>,
    /// PRESS_STROKE, possibly one half of it.
    pub press_stroke: Masked<u32>,
    /// PART_NUMBER, register by register.
    pub part_number: [Option<u16>; 16],
}

/// Why a write was not applied; nothing of it was.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum RefusedWrite {
    /// A bit that must be 0 was set.
    #[error("wrote CONTROL {0:#06x}: bits 8 to 15 are reserved, write 0 to them")]
    ReservedBits(u16),
    /// Not a recipe number.
    #[error(
        "wrote RECIPE_SELECT {0}: write 0 to leave the recipe, 1 to 9999, or 65535 to select by PART_NUMBER"
    )]
    RecipeNumber(u16),
}

impl ControlWrite {
    /// Checks the values.
    ///
    /// # Errors
    /// A reserved CONTROL bit is set, or RECIPE_SELECT is neither 0, 1–9999 nor 65535.
    pub fn check(&self) -> Result<(), RefusedWrite> {
        let bits = self.control.value & self.control.mask;
        if bits & RESERVED != 0 {
            return Err(RefusedWrite::ReservedBits(bits));
        }
        match self.recipe_select {
            Some(number) if number > MAX_RECIPE && number != BY_PART_NUMBER => {
                Err(RefusedWrite::RecipeNumber(number))
            }
            _ => Ok(()),
        }
    }
}

/// The levels that one connection has written to CONTROL, so that its edges are its own.
///
/// A connection's first write of a bit only sets the reference level: a 1 that an old session left
/// behind does not fire.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ConnectionEdges {
    client: Client,
    known: u16,
    level: u16,
}

impl ConnectionEdges {
    /// A connection of this client.
    pub fn of(client: Client) -> Self {
        Self {
            client,
            ..Self::default()
        }
    }

    /// Whose connection it is.
    pub fn client(&self) -> Client {
        self.client
    }

    /// Takes the write's CONTROL bits and answers with those that rose against this connection's
    /// own last level.
    pub fn rise(&mut self, control: Masked<u16>) -> u16 {
        let rising = control.value & control.mask & self.known & !self.level & EDGES;
        self.level = control.onto(self.level);
        self.known |= control.mask;
        rising
    }
}

/// What the PLC last wrote, and when its heartbeat last changed.
#[derive(Debug, Clone, Default)]
pub(super) struct Plc {
    /// The CONTROL block.
    pub(super) registers: ControlRegisters,
    /// The last change of PLC_HEARTBEAT; `None` until the PLC uses it.
    heard: Option<Micros>,
}

impl Plc {
    pub(super) fn write(&mut self, write: &ControlWrite, now: Micros) {
        let before = self.registers;
        self.registers = before.written(write);
        if self.registers.plc_heartbeat != before.plc_heartbeat {
            self.heard = Some(now);
        }
    }

    /// Whether a bit of CONTROL is set.
    pub(super) fn holds(&self, bit: u16) -> bool {
        self.registers.control & bit != 0
    }

    /// Whether PLC_HEARTBEAT has stood still for longer than `limit`.
    pub(super) fn is_lost(&self, limit: Micros, now: Micros) -> bool {
        self.heard.is_some_and(|heard| now.since(heard) > limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_write_of_a_connection_sets_the_level_and_fires_nothing() {
        let mut edges = ConnectionEdges::default();
        assert_eq!(edges.rise(Masked::<u16>::all(0x00FF)), 0);
        assert_eq!(edges.rise(Masked::<u16>::all(0x0001)), 0);
        assert_eq!(edges.rise(Masked::<u16>::all(0x0003)), TRIGGER);
        assert_eq!(
            edges.rise(Masked::<u16>::all(0x0003)),
            0,
            "a level that stays high is no edge"
        );
    }

    #[test]
    fn a_coil_knows_only_its_own_bit() {
        let mut edges = ConnectionEdges::default();
        assert_eq!(
            edges.rise(Masked {
                mask: TRIGGER,
                value: 0
            }),
            0
        );
        assert_eq!(
            edges.rise(Masked {
                mask: ABORT,
                value: ABORT
            }),
            0
        );
        assert_eq!(
            edges.rise(Masked {
                mask: TRIGGER,
                value: TRIGGER
            }),
            TRIGGER
        );
    }

    #[test]
    fn levels_never_count_as_edges() {
        let mut edges = ConnectionEdges::default();
        edges.rise(Masked::<u16>::all(0));
        assert_eq!(edges.rise(Masked::<u16>::all(ONLINE | BUFFERED)), 0);
    }

    #[test]
    fn reserved_bits_and_odd_recipe_numbers_are_refused_with_their_numbers() {
        let bits = ControlWrite {
            control: Masked::<u16>::all(0x0201),
            ..Default::default()
        };
        assert_eq!(bits.check(), Err(RefusedWrite::ReservedBits(0x0201)));
        for (number, fine) in [
            (0, true),
            (1, true),
            (9999, true),
            (10_000, false),
            (0xFFFE, false),
            (0xFFFF, true),
        ] {
            let write = ControlWrite {
                recipe_select: Some(number),
                ..Default::default()
            };
            assert_eq!(write.check().is_ok(), fine, "recipe {number}");
        }
    }

    #[test]
    fn half_a_part_id_leaves_the_other_half() {
        let before = ControlRegisters {
            part_id: 0x1111_2222,
            ..Default::default()
        };
        let write = ControlWrite {
            part_id: Masked {
                mask: 0xFFFF,
                value: 0x3333,
            },
            ..Default::default()
        };
        assert_eq!(before.written(&write).part_id, 0x1111_3333);
    }

    #[test]
    fn a_part_number_ends_at_its_first_nul() {
        let mut registers = ControlRegisters::default();
        registers.part_number[..9].copy_from_slice(b" AB-12\0xy");
        assert_eq!(registers.part_number_text(), "AB-12");
    }

    #[test]
    fn a_heartbeat_that_never_changed_is_never_lost() {
        let mut plc = Plc::default();
        let write = |plc_heartbeat| ControlWrite {
            plc_heartbeat: Some(plc_heartbeat),
            ..ControlWrite::default()
        };
        let (limit, late) = (Micros(10), Micros(100));
        plc.write(&write(0), Micros(1));
        assert!(!plc.is_lost(limit, late));
        plc.write(&write(5), Micros(2));
        plc.write(&write(5), Micros(50));
        assert!(plc.is_lost(limit, Micros(13)) && !plc.is_lost(limit, Micros(12)));
    }
}
