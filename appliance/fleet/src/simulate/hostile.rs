//! Answers that a head never gives, to collectors that must survive them.

use super::body::{PIECE, Pieces, Then};
use super::fault::Fault;
use super::head::{Head, Plant};
use super::row::{Found, Start};
use std::sync::Arc;

/// Bytes of a line that is too long for anyone.
const LINE: usize = 1 << 30;

/// The hostile answer to a request for results behind `after`, if the fault is one of that kind.
pub(super) fn body(
    plant: &Arc<Plant>,
    head: &Head<'_>,
    fault: Fault,
    after: u32,
) -> Option<Pieces> {
    let start = Start::of(head);
    let line = |seq: u32| {
        let (mut found, mut out) = (Found::default(), Vec::new());
        found.of(head, seq);
        found.line(&mut out, head, &start);
        out
    };
    let header = head.header().into_bytes();
    let seq = after.saturating_add(1);
    Some(match fault {
        Fault::Endless => {
            let (plant, number, now_ms) = (plant.clone(), head.number, head.now_ms());
            let (mut next, mut found) = (seq, Found::default());
            let mut header = Some(header);
            Pieces::new(move |out| {
                out.append(&mut header.take().unwrap_or_default());
                let Some(head) = plant.head(number, now_ms) else {
                    return Then::End;
                };
                let start = Start::of(&head);
                while out.len() < PIECE {
                    found.of(&head, next);
                    found.line(out, &head, &start);
                    next = next.wrapping_add(1).max(1);
                }
                Then::More
            })
        }
        Fault::Line => {
            let (mut header, mut left) = (Some(header), LINE);
            Pieces::new(move |out| {
                out.append(&mut header.take().unwrap_or_default());
                out.resize(out.len() + PIECE, b'1');
                left = left.saturating_sub(PIECE);
                if left == 0 { Then::End } else { Then::More }
            })
        }
        Fault::Serial => {
            let other = head
                .plant
                .head(head.number % head.plant.heads + 1, head.now_ms())?;
            let (mut found, mut out) = (Found::default(), other.header().into_bytes());
            found.of(&other, seq);
            found.line(&mut out, &other, &Start::of(&other));
            Pieces::whole(out)
        }
        Fault::Falling => {
            let lines = [
                header,
                line(seq.saturating_add(2)),
                line(seq.saturating_add(1)),
                line(seq),
            ];
            Pieces::whole(lines.concat())
        }
        Fault::Nan => {
            let text = String::from_utf8_lossy(&line(seq)).replacen(
                r#""value":"#,
                r#""value":NaN,"was":"#,
                1,
            );
            Pieces::whole([header, text.into_bytes()].concat())
        }
        _ => return None,
    })
}
