//! A body that is made while it is sent, never held as a whole, and may be slow or end too early.

use super::fault::Fault;
use http_body_util::StreamBody;
use hyper::body::{Bytes, Frame};
use std::io;
use std::time::Duration;
use tokio::sync::mpsc;
use tokio::time::sleep;
use tokio_stream::wrappers::ReceiverStream;

/// Bytes of a piece.
pub(super) const PIECE: usize = 64 << 10;
/// A slow head sends so many bytes, then pauses: 10 kB/s.
const SLOW: usize = 1000;
const PAUSE: Duration = Duration::from_millis(100);
/// A head that breaks off has sent so many bytes: the header and some of a result.
const CUT: usize = 700;

/// What is sent.
pub(super) type Body = StreamBody<ReceiverStream<Result<Frame<Bytes>, io::Error>>>;

/// A body of lines, on a head with a fault or without one.
pub(super) fn body(
    mut lines: impl Iterator<Item = Vec<u8>> + Send + 'static,
    fault: Option<Fault>,
) -> Body {
    let (sender, pieces) = mpsc::channel(1);
    let (most, mut left) = match fault {
        Some(Fault::Slow) => (SLOW, usize::MAX),
        Some(Fault::Cut) => (usize::MAX, CUT),
        _ => (usize::MAX, usize::MAX),
    };
    tokio::spawn(async move {
        while let Some(piece) = piece(&mut lines) {
            for part in piece.chunks(most) {
                if fault == Some(Fault::Slow) {
                    sleep(PAUSE).await;
                }
                let part = Bytes::copy_from_slice(&part[..part.len().min(left)]);
                left -= part.len();
                if sender.send(Ok(Frame::data(part))).await.is_err() {
                    return;
                }
                if left == 0 {
                    let broken = Err(io::ErrorKind::ConnectionAborted.into());
                    return drop(sender.send(broken).await);
                }
            }
        }
    });
    StreamBody::new(ReceiverStream::new(pieces))
}

fn piece(lines: &mut impl Iterator<Item = Vec<u8>>) -> Option<Vec<u8>> {
    let mut piece = lines.next()?;
    while piece.len() < PIECE
        && let Some(line) = lines.next()
    {
        piece.extend(line);
    }
    Some(piece)
}
