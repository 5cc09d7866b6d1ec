//! The PLC: its registers and heartbeat.

use super::clock::Micros;
use super::control::{ControlRegisters, ControlWrite};

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
