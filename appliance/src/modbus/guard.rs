//! The guard of one connection: passes on complete, well-formed frames one at a time and enforces
//! both time-outs.
//!
//! It stands between the socket and `tokio-modbus`, whose server has no time-outs, closes the
//! connection on a request that contradicts itself, and panics on an FC15 whose quantity exceeds
//! its bytes. A flawed request is replaced by an empty one of the same function, and its exception
//! is left for the service in [`FrameFlaw`]. This is sound because the library asks for more bytes
//! only after it has answered, and the guard never hands out more than one frame.

use std::future::Future;
use std::pin::Pin;
use std::sync::atomic::Ordering;
use std::task::{Context, Poll, ready};
use std::time::Duration;
use std::{io, iter};

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Instant, Sleep};

use super::clients::ConnectionPlace;
use super::service::{FrameFlaw, MAX_READ_WRITE, MAX_WRITE, MAX_WRITE_BITS};

/// Transaction, protocol and length: the bytes needed to know the frame's length.
const HEADER: usize = 6;
/// Longest frame: header, unit id and a PDU of 253 bytes.
const MAX_FRAME: usize = HEADER + 1 + 253;
/// Modbus exceptions 1 and 3.
const ILLEGAL_FUNCTION: u8 = 1;
const ILLEGAL_VALUE: u8 = 3;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Waiting {
    /// For the first byte of a request.
    Idle,
    /// For the rest of a request.
    Frame,
    /// For the client to take the answer.
    Answer,
}

/// A transport that passes on complete frames and closes the connection after a time-out.
pub struct Guard<T> {
    stream: T,
    /// Held while the connection is open; another client may displace it.
    place: ConnectionPlace,
    flaw: FrameFlaw,
    idle: Duration,
    frame: Duration,
    waiting: Waiting,
    deadline: Pin<Box<Sleep>>,
    input: [u8; MAX_FRAME],
    filled: usize,
    /// A complete frame for the library, and how many bytes of it the library has read.
    output: Vec<u8>,
    read: usize,
}

impl<T> Guard<T> {
    /// Guards `stream`: `idle` between two requests, `frame` to finish a started frame or to take
    /// an answer.
    pub fn new(
        stream: T,
        place: ConnectionPlace,
        flaw: FrameFlaw,
        idle: Duration,
        frame: Duration,
    ) -> Self {
        Self {
            stream,
            place,
            flaw,
            idle,
            frame,
            waiting: Waiting::Idle,
            deadline: Box::pin(tokio::time::sleep(idle)),
            input: [0; MAX_FRAME],
            filled: 0,
            output: Vec::with_capacity(MAX_FRAME),
            read: 0,
        }
    }

    /// Starts the time-out of a wait, unless it already runs.
    fn wait_for(&mut self, waiting: Waiting) {
        if self.waiting != waiting {
            self.waiting = waiting;
            let limit = if waiting == Waiting::Idle {
                self.idle
            } else {
                self.frame
            };
            self.deadline.as_mut().reset(Instant::now() + limit);
        }
    }

    /// Pending, or an error if this wait has timed out or another client has displaced this one.
    fn poll_deadline<R>(&mut self, context: &mut Context<'_>) -> Poll<io::Result<R>> {
        if self.place.poll_displaced(context).is_ready() {
            return Poll::Ready(Err(io::Error::from(io::ErrorKind::ConnectionAborted)));
        }
        ready!(self.deadline.as_mut().poll(context));
        Poll::Ready(Err(io::Error::from(io::ErrorKind::TimedOut)))
    }

    /// The length of the frame whose header was received.
    fn frame_length(&self) -> io::Result<usize> {
        let [_, _, p1, p0, l1, l0, ..] = self.input;
        let length = usize::from(u16::from_be_bytes([l1, l0]));
        if (p1, p0) != (0, 0) || !(2..=MAX_FRAME - HEADER).contains(&length) {
            return Err(io::Error::new(
                io::ErrorKind::InvalidData,
                "the header is not that of a Modbus TCP frame",
            ));
        }
        Ok(HEADER + length)
    }

    /// Puts the complete frame, or its empty replacement, into `output`.
    fn pass_on(&mut self) {
        self.place.spoke();
        let frame = self.input.get(..self.filled).unwrap_or_default();
        let (head, pdu) = frame.split_at_checked(HEADER + 1).unwrap_or_default();
        let exception = check(pdu).err();
        self.output.clear();
        self.output.extend_from_slice(head);
        match exception.and(pdu.first()) {
            None => self.output.extend_from_slice(pdu),
            Some(&function) => {
                let pdu = stand_in(function);
                let length = u16::try_from(pdu.len() + 1).unwrap_or(0).to_be_bytes();
                if let Some(place) = self.output.get_mut(4..6) {
                    place.copy_from_slice(&length);
                }
                self.output.extend(pdu);
            }
        }
        self.flaw.store(exception.unwrap_or(0), Ordering::Relaxed);
        self.filled = 0;
        self.read = 0;
    }
}

/// The shortest request of a function that the library can decode, in place of a flawed one.
fn stand_in(function: u8) -> Vec<u8> {
    let zeros = match function {
        43 => return vec![43, 14, 1, 0],
        17 => 0,
        15 | 16 => 5,
        22 => 6,
        23 => 9,
        _ => 4,
    };
    iter::once(function)
        .chain(iter::repeat_n(0, zeros))
        .collect()
}

/// Checks that a request does not contradict itself: length, byte count, quantity of a write, coil
/// value. The error is the exception to answer with.
fn check(pdu: &[u8]) -> Result<(), u8> {
    // A write's quantity and byte count agree with each other and with the bytes that came.
    let counts =
        |quantity: [u8; 2], bytes: u8, rest: &[u8], most: usize, expected: fn(usize) -> usize| {
            let quantity = usize::from(u16::from_be_bytes(quantity));
            (1..=most).contains(&quantity)
                && usize::from(bytes) == rest.len()
                && rest.len() == expected(quantity)
        };
    match *pdu {
        [1..=4 | 6, _, _, _, _] | [5, _, _, 0x00 | 0xFF, 0x00] | [43, 14, 1..=4, _] => Ok(()),
        [15, _, _, q1, q0, bytes, ref rest @ ..]
            if counts([q1, q0], bytes, rest, MAX_WRITE_BITS, |n| n.div_ceil(8)) =>
        {
            Ok(())
        }
        [16, _, _, q1, q0, bytes, ref rest @ ..]
            if counts([q1, q0], bytes, rest, MAX_WRITE, |n| 2 * n) =>
        {
            Ok(())
        }
        [23, _, _, _, _, _, _, q1, q0, bytes, ref rest @ ..]
            if counts([q1, q0], bytes, rest, MAX_READ_WRITE, |n| 2 * n) =>
        {
            Ok(())
        }
        [1..=6 | 15 | 16 | 23, ..] | [43, 14, ..] => Err(ILLEGAL_VALUE),
        // Functions that the library decodes and the service refuses: their length must not matter.
        [17 | 22 | 43, ..] => Err(ILLEGAL_FUNCTION),
        _ => Ok(()),
    }
}

impl<T: AsyncRead + Unpin> AsyncRead for Guard<T> {
    fn poll_read(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let this = self.get_mut();
        loop {
            let left = this.output.get(this.read..).unwrap_or_default();
            if !left.is_empty() {
                let count = left.len().min(buffer.remaining());
                buffer.put_slice(left.get(..count).unwrap_or_default());
                this.read += count;
                return Poll::Ready(Ok(()));
            }
            this.wait_for(if this.filled == 0 {
                Waiting::Idle
            } else {
                Waiting::Frame
            });
            let wanted = if this.filled < HEADER {
                HEADER
            } else {
                this.frame_length()?
            };
            let Some(place) = this.input.get_mut(this.filled..wanted) else {
                return Poll::Ready(Err(io::Error::from(io::ErrorKind::InvalidData)));
            };
            let mut part = ReadBuf::new(place);
            match Pin::new(&mut this.stream).poll_read(context, &mut part) {
                Poll::Ready(Ok(())) => {}
                Poll::Ready(Err(error)) => return Poll::Ready(Err(error)),
                Poll::Pending => return this.poll_deadline(context),
            }
            let count = part.filled().len();
            if count == 0 {
                return Poll::Ready(Ok(()));
            }
            this.filled += count;
            if this.filled > HEADER && this.filled == this.frame_length()? {
                this.pass_on();
            }
        }
    }
}

impl<T: AsyncWrite + Unpin> AsyncWrite for Guard<T> {
    fn poll_write(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let this = self.get_mut();
        this.wait_for(Waiting::Answer);
        match Pin::new(&mut this.stream).poll_write(context, bytes) {
            Poll::Ready(result) => Poll::Ready(result),
            Poll::Pending => this.poll_deadline(context),
        }
    }

    fn poll_flush(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.get_mut().stream).poll_flush(context)
    }

    fn poll_shutdown(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.get_mut().stream).poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_requests_that_agree_with_themselves_pass() {
        let fine: [&[u8]; 8] = [
            &[3, 0, 0, 0, 1],
            &[5, 0, 1, 0xFF, 0],
            &[15, 0, 0, 0, 9, 2, 1, 1],
            &[16, 0, 0, 0, 1, 2, 0, 1],
            &[23, 0, 0, 0, 1, 0, 0, 0, 1, 2, 0, 1],
            &[43, 14, 4, 2],
            &[99, 1, 2, 3],
            &[3, 0, 0, 0, 0],
        ];
        for pdu in fine {
            assert_eq!(check(pdu), Ok(()), "{pdu:?}");
        }
        let flawed: [&[u8]; 9] = [
            &[3, 0, 0, 0],
            &[3, 0, 0, 0, 1, 0],
            &[5, 0, 1, 0xFF, 1],
            &[15, 0, 0, 0, 9, 1, 1],
            &[16, 0, 0, 0x80, 1, 2, 0, 1],
            &[16, 0, 0, 0, 2, 2, 0, 1],
            &[16, 0, 0, 0, 1, 2, 0],
            &[23, 0, 0, 0, 1, 0, 0, 0, 1, 2, 0],
            &[43, 14, 9, 0],
        ];
        for pdu in flawed {
            assert_eq!(
                (check(pdu), stand_in(pdu[0]).first()),
                (Err(ILLEGAL_VALUE), pdu.first()),
                "{pdu:?}"
            );
        }
        for pdu in [&[17_u8, 5][..], &[22], &[43, 13, 0]] {
            assert_eq!(check(pdu), Err(ILLEGAL_FUNCTION), "{pdu:?}");
        }
    }
}
