//! The PLC: its registers and heartbeat, and one write of it. Fields act first, then the CONTROL
//! bits in their order, the trigger last.

use super::clock::Micros;
use super::control::{self, ControlRegisters, ControlWrite};
use super::event::{Effect, Effects};
use super::machine::{Station, push};
use super::refusal::reject;
use super::state::State;
use super::turns::Client;

/// What the PLC last wrote, and when its heartbeat last changed.
#[derive(Debug, Clone, Default)]
pub(super) struct Plc {
    /// The CONTROL block.
    pub(super) registers: ControlRegisters,
    /// The last change of PLC_HEARTBEAT; `None` until the PLC uses it.
    heard: Option<Micros>,
}

impl Plc {
    fn write(&mut self, write: &ControlWrite, now: Micros) {
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

impl Station {
    /// Takes a write; `rising` are the CONTROL bits that rose on its connection.
    pub(super) fn written(
        &mut self,
        write: &ControlWrite,
        rising: u16,
        client: Client,
        effects: &mut Effects,
    ) {
        self.plc.write(write, self.clock.now());
        let rose = |bit: u16| rising & bit != 0;
        if rose(control::ERROR_RESET) {
            self.reset(effects);
        }
        if rose(control::ABORT) {
            self.abort(effects);
        }
        if matches!(self.state, State::Ready | State::Offline) {
            self.state = self.rest();
        }
        if rose(control::RESULT_ACK) {
            self.results.acknowledge();
        }
        if rose(control::RECIPE_LOAD) {
            self.plc_load(effects);
        }
        if rose(control::TEACH) {
            self.plc_teach(effects);
        }
        let token = self.requests.new_token(write.token);
        if rose(control::TRIGGER) || token.is_some() {
            self.triggered(token.unwrap_or(0), client, effects);
        }
    }

    /// Takes a trigger, or counts it as missed.
    fn triggered(&mut self, token: u16, client: Client, effects: &mut Effects) {
        let now = self.clock.now();
        match self.refusal() {
            None if self.turns.may(client, now) => {
                self.turns.granted(client);
                self.begin(token, effects);
            }
            None => self.requests.miss(reject::NOT_READY),
            Some(reason) => {
                if reason == reject::NOT_READY {
                    self.turns.rejected(client, now);
                }
                self.requests.miss(reason);
            }
        }
    }

    /// Asks the worker to end its job early; a station that stops has done so already.
    pub(super) fn abort(&self, effects: &mut Effects) {
        if let Some(job) = self.state.job()
            && !matches!(self.state, State::Stopping { .. })
        {
            push(effects, Effect::Abort { job });
        }
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
