//! What became of requests: triggers of any source (PLC, page, start line) counted as accepted or
//! missed, the last token of the PLC, why the last request was rejected.

/// The counters and latches of requests.
#[derive(Debug, Clone, Default)]
pub(super) struct Requests {
    /// Accepted triggers.
    pub(super) triggers: u32,
    /// Rejected triggers.
    pub(super) missed: u32,
    /// Whether a trigger was rejected since the last ERROR_RESET.
    pub(super) missed_latch: bool,
    /// The last accepted token.
    pub(super) last_token: u16,
    /// Why the last rejected request was rejected ([`super::reject`]); 0 before the first.
    pub(super) reject_reason: u16,
}

impl Requests {
    /// The token of a write if it is a trigger: neither 0 nor the last accepted one, whatever
    /// connection that came from. So a write that is sent again does not measure again, until
    /// another token is accepted or the daemon is started again.
    pub(super) fn new_token(&self, written: Option<u16>) -> Option<u16> {
        written.filter(|&token| token != 0 && token != self.last_token)
    }

    /// Counts an accepted trigger; `token` is 0 for an edge.
    pub(super) fn accept(&mut self, token: u16) {
        self.triggers = self.triggers.wrapping_add(1);
        if token != 0 {
            self.last_token = token;
        }
    }

    /// Counts a rejected trigger.
    pub(super) fn miss(&mut self, reason: u16) {
        self.reject(reason);
        self.missed = self.missed.wrapping_add(1);
        self.missed_latch = true;
    }

    /// Notes why a request of any kind was rejected.
    pub(super) fn reject(&mut self, reason: u16) {
        self.reject_reason = reason;
    }

    /// ERROR_RESET clears the latch; counters and token stay.
    pub(super) fn reset(&mut self) {
        self.missed_latch = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_is_new_until_it_is_accepted_and_an_edge_leaves_it() {
        let mut requests = Requests::default();
        requests.miss(1);
        assert_eq!(requests.new_token(Some(7)), Some(7));
        requests.accept(7);
        requests.accept(0);
        assert_eq!((requests.new_token(Some(7)), requests.triggers), (None, 2));
        assert_eq!(requests.new_token(Some(0)), None);
    }
}
