//! Answers that a head never gives, to collectors that must survive them.

use super::body::PIECE;
use super::fault::Fault;
use super::head::Head;
use super::row::{line, row};
use std::iter::{once, repeat_n};

/// Bytes of a line that is too long for anyone.
const LINE: usize = 1 << 30;

/// The lines of an answer.
pub(super) type Lines = Box<dyn Iterator<Item = Vec<u8>> + Send>;

/// The hostile answer to a request for results behind `after`, if the fault is one of that kind.
pub(super) fn lines(head: &Head, fault: Fault, after: u32) -> Option<Lines> {
    let mut head = head.clone();
    if fault == Fault::Serial {
        head = head.plant.head(head.next(), head.now_ms)?;
    }
    let header = line(&head.header());
    let seq = after.saturating_add(1);
    let made = move |seq: u32| line(&row(&head, seq));
    let rows: Lines = match fault {
        Fault::Endless => Box::new((seq..).map(made)),
        Fault::Line => Box::new(repeat_n(vec![b'1'; PIECE], LINE / PIECE)),
        Fault::Serial => Box::new(once(made(seq))),
        Fault::Falling => Box::new((seq..seq.saturating_add(3)).rev().map(made)),
        Fault::Nan => {
            let text = String::from_utf8(made(seq)).ok()?;
            let text = text.replacen(r#""value":"#, r#""value":NaN,"was":"#, 1);
            Box::new(once(text.into_bytes()))
        }
        _ => return None,
    };
    Some(Box::new(once(header).chain(rows)))
}
