//! A body that is made while it is sent, never held as a whole, and may be slow or end too early.

use hyper::body::{Body, Bytes, Frame};
use std::future::Future as _;
use std::io;
use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::time::{Sleep, sleep};

/// Bytes of a piece, unless it is a slow body's.
pub(super) const PIECE: usize = 64 << 10;

/// What follows the piece that was made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Then {
    /// Another piece.
    More,
    /// The end.
    End,
}

type Make = Box<dyn FnMut(&mut Vec<u8>) -> Then + Send>;

/// A body of pieces.
pub(super) struct Pieces {
    make: Option<Make>,
    /// Bytes that are made and not sent.
    left: Bytes,
    slow: Option<Slow>,
    /// Bytes after which the connection breaks off.
    cut: Option<usize>,
}

struct Slow {
    bytes: usize,
    pause: Duration,
    sleep: Pin<Box<Sleep>>,
}

impl Pieces {
    /// A body of what `make` appends, until it says that this was the end.
    pub(super) fn new(make: impl FnMut(&mut Vec<u8>) -> Then + Send + 'static) -> Self {
        Self {
            make: Some(Box::new(make)),
            left: Bytes::new(),
            slow: None,
            cut: None,
        }
    }

    /// A body that is known.
    pub(super) fn whole(bytes: impl Into<Bytes>) -> Self {
        Self {
            make: None,
            left: bytes.into(),
            slow: None,
            cut: None,
        }
    }

    /// The same, so many bytes at a time with a pause before each.
    pub(super) fn slowly(mut self, bytes: usize, pause: Duration) -> Self {
        let sleep = Box::pin(sleep(pause));
        self.slow = Some(Slow {
            bytes,
            pause,
            sleep,
        });
        self
    }

    /// The same until so many bytes; then the connection breaks off.
    pub(super) fn cut_after(mut self, bytes: usize) -> Self {
        self.cut = Some(bytes);
        self
    }

    fn refill(&mut self) {
        while self.left.is_empty()
            && let Some(make) = &mut self.make
        {
            let mut piece = Vec::with_capacity(PIECE + PIECE / 4);
            if make(&mut piece) == Then::End {
                self.make = None;
            }
            self.left = piece.into();
        }
    }
}

impl Body for Pieces {
    type Data = Bytes;
    type Error = io::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, io::Error>>> {
        let mut most = usize::MAX;
        if let Some(slow) = &mut self.slow {
            if slow.sleep.as_mut().poll(context).is_pending() {
                return Poll::Pending;
            }
            slow.sleep = Box::pin(sleep(slow.pause));
            most = slow.bytes;
        }
        if self.cut == Some(0) {
            return Poll::Ready(Some(Err(io::ErrorKind::ConnectionAborted.into())));
        }
        self.refill();
        if self.left.is_empty() {
            return Poll::Ready(None);
        }
        let most = most
            .min(self.left.len())
            .min(self.cut.unwrap_or(usize::MAX));
        if let Some(cut) = &mut self.cut {
            *cut -= most;
        }
        Poll::Ready(Some(Ok(Frame::data(self.left.split_to(most)))))
    }
}
