//! A result, and its line as JSON.

use super::figures::{mixed, push_millionths, push_whole};
use super::gauge::{REASON, decision};
use super::head::{Clock, Head};

/// Of so many results one has a gauge without a value, or cannot be judged at all.
const UNSEEN: u64 = 500;
const FAILED: u64 = 3000;
/// Results after which the recipe of a head that makes two parts changes.
const CHANGEOVER: u32 = 500;
/// ERROR_CODE of a result without a measurement: frames that fit no pattern.
const NO_MEASUREMENT: u16 = 302;
/// RESULT flags: the full sequence, a simulated head, a doubtful decision.
const FLAGS: u16 = 1 << 3 | 1 << 5;
const DOUBTFUL: u16 = 1 << 7;

/// A result of a head.
#[derive(Clone, Debug, Default)]
pub(super) struct Found {
    pub seq: u32,
    pub recipe: u16,
    pub part_id: u32,
    pub verdict: &'static str,
    pub error_code: u16,
    pub flags: u16,
    pub exposure_us: u32,
    pub processing_us: u32,
    /// Share of the regions that was resolved, ‰.
    pub coverage: u16,
    /// Shifts in µm, turns in thousandths of a degree; `None` where the part was not aligned.
    pub placement: Option<[i64; 5]>,
    /// Values in millionths and bits of the decision, in the order of the slots; empty where nothing
    /// was measured.
    pub gauges: Vec<(Option<i64>, u16)>,
}

impl Found {
    /// Works out result `seq` of a head, into memory that is used again.
    pub(super) fn of(&mut self, head: &Head<'_>, seq: u32) {
        let character = head.character();
        let luck = mixed(mixed(character.key) ^ u64::from(seq));
        self.seq = seq;
        self.recipe = recipe(head.number, seq);
        self.part_id = head.number.wrapping_mul(1_000_000).wrapping_add(seq);
        self.exposure_us = 87_000 + (luck % 8_000) as u32;
        self.processing_us = 5_000 + (luck >> 16) as u32 % 3_000;
        self.gauges.clear();
        self.flags = FLAGS;
        if luck % FAILED == 1 {
            (self.verdict, self.error_code) = ("INVALID", NO_MEASUREMENT);
            (self.coverage, self.placement) = (0, None);
            return;
        }
        self.error_code = 0;
        self.coverage = 900 + (luck >> 24) as u16 % 100;
        let part = |shift: u32| (luck >> shift) as i64 % 256 - 128;
        self.placement = (luck % 64 != 2).then(|| [16, 24, 32, 40, 48].map(part));
        let unseen = luck
            .is_multiple_of(UNSEEN)
            .then_some((luck >> 40) as usize % head.plant.gauges.len());
        let (mut failed, mut doubtful) = (false, false);
        for (place, gauge) in head.plant.gauges.iter().enumerate() {
            if unseen == Some(place) {
                self.gauges.push((None, 0));
                continue;
            }
            let value = gauge.value(character, seq);
            let bits = gauge.decision(value);
            failed |= bits & (decision::LOW | decision::HIGH) != 0;
            doubtful |= bits & decision::DOUBTFUL != 0;
            self.gauges.push((Some(value), bits));
        }
        self.flags |= if doubtful { DOUBTFUL } else { 0 };
        self.verdict = match (unseen, failed) {
            (Some(_), _) => "INVALID",
            (None, true) => "FAIL",
            (None, false) => "PASS",
        };
    }

    /// Appends its line for `GET /api/results`.
    pub(super) fn line(&self, out: &mut Vec<u8>, head: &Head<'_>, start: &Start) {
        out.extend_from_slice(&start.0);
        push_whole(out, u64::from(self.seq));
        out.extend_from_slice(br#","at_unix_ms":"#);
        match head.clock() {
            Clock::None => out.extend_from_slice(b"null"),
            _ => push_whole(out, head.at_ms(self.seq)),
        }
        let mut text = |text: &str| out.extend_from_slice(text.as_bytes());
        text(r#","clock":""#);
        text(head.clock().word());
        text(r#"","recipe":"#);
        whole(out, self.recipe, r#","fingerprint":""#);
        out.extend_from_slice(start.fingerprint(self.recipe));
        out.extend_from_slice(br#"","part_id":"#);
        whole(out, self.part_id, r#","press_stroke":"#);
        whole(out, self.seq, r#","verdict":""#);
        out.extend_from_slice(self.verdict.as_bytes());
        out.extend_from_slice(br#"","error_code":"#);
        whole(out, self.error_code, r#","flags":"#);
        whole(out, self.flags, r#","exposure_us":"#);
        whole(out, self.exposure_us, r#","processing_us":"#);
        whole(out, self.processing_us, r#","coverage":"#);
        push_millionths(out, i64::from(self.coverage) * 1000);
        out.extend_from_slice(br#","placement":"#);
        match self.placement {
            Some(parts) => {
                for (place, part) in parts.into_iter().enumerate() {
                    out.push(if place == 0 { b'[' } else { b',' });
                    push_millionths(out, part * 1000);
                }
                // The turn about z of a round part is not determined.
                out.extend_from_slice(b",null]");
            }
            None => out.extend_from_slice(b"null"),
        }
        out.extend_from_slice(br#","gauges":["#);
        for (place, (gauge, (value, bits))) in
            head.plant.gauges.iter().zip(&self.gauges).enumerate()
        {
            if place > 0 {
                out.push(b',');
            }
            out.extend_from_slice(&gauge.before);
            match value {
                Some(value) => push_millionths(out, *value),
                None => out.extend_from_slice(b"null"),
            }
            out.extend_from_slice(&gauge.behind);
            push_whole(out, u64::from(*bits));
            match value {
                Some(_) => out.extend_from_slice(br#","reason":null}"#),
                None => {
                    out.extend_from_slice(br#","reason":""#);
                    out.extend_from_slice(REASON.as_bytes());
                    out.extend_from_slice(br#""}"#);
                }
            }
        }
        out.extend_from_slice(b"]}\n");
    }
}

fn whole(out: &mut Vec<u8>, number: impl Into<u64>, then: &str) {
    push_whole(out, number.into());
    out.extend_from_slice(then.as_bytes());
}

/// What all lines of an answer begin with, and the fingerprints of the recipes.
pub(super) struct Start(Vec<u8>, [[u8; 8]; 2]);

impl Start {
    /// Of a head, with its serial number and the id of its history.
    pub(super) fn of(head: &Head<'_>) -> Self {
        let (serial, history) = (head.serial(), head.history());
        let mut fingerprints = [[b'0'; 8]; 2];
        for (recipe, bytes) in (1..).zip(&mut fingerprints) {
            bytes.copy_from_slice(fingerprint(head, recipe).as_bytes());
        }
        let words = format!(r#"{{"serial":"{serial}","history":"{history}","seq":"#);
        Self(words.into_bytes(), fingerprints)
    }

    fn fingerprint(&self, recipe: u16) -> &[u8] {
        &self.1[usize::from(recipe == 2)]
    }
}

/// The recipe of result `seq`: one head in four makes two parts in turns.
pub(super) fn recipe(head: u32, seq: u32) -> u16 {
    let second = head.is_multiple_of(4) && (seq / CHANGEOVER) % 2 == 1;
    if second { 2 } else { 1 }
}

/// The first 8 hexadecimal digits of a recipe's fingerprint: the same recipe on all heads.
pub(super) fn fingerprint(head: &Head<'_>, recipe: u16) -> String {
    format!(
        "{:08x}",
        mixed(mixed(head.plant.seed) ^ u64::from(recipe)) as u32
    )
}
