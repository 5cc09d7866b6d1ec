//! One write of the PLC: fields act first, then the CONTROL bits in their order, the trigger last.

use super::control::{self, ControlWrite};
use super::event::{Effect, Effects};
use super::machine::{Station, push};
use super::refusal::reject;
use super::state::State;
use super::turns::Client;

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
        let mut buffering = self.plc.holds(control::BUFFERED) && self.results.buffer();
        if rose(control::UNBUFFERED) {
            buffering |= self.results.buffered.take().is_some();
        }
        if rose(control::RESULT_ACK) {
            buffering |= self.results.acknowledge();
        }
        if buffering {
            push(effects, Effect::Buffered(self.results.buffered));
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
        if let Some(job) = self.job()
            && !matches!(self.state, State::Stopping { .. })
        {
            push(effects, Effect::Abort { job });
        }
    }
}
