//! The lines of an answer, each bounded in length and time, and the ways in which reading them fails.

use crate::answer::{MOST_LINE, Wrong};
use crate::http::{ANSWERING, HttpError, next, within};
use hyper::body::Incoming;

/// Why a question failed.
#[derive(Debug, thiserror::Error)]
pub(super) enum Trouble {
    /// No answer, or none that says 200.
    #[error(transparent)]
    Http(#[from] HttpError),
    /// An answer that no head gives.
    #[error(transparent)]
    Wrong(#[from] Wrong),
    /// An answer without its end.
    #[error("the answer ends in the middle of a line")]
    Cut,
}

/// Reads a body line by line.
pub(super) struct Lines {
    body: Incoming,
    buffer: Vec<u8>,
    /// Where the next line begins.
    from: usize,
}

impl Lines {
    pub(super) fn of(body: Incoming) -> Self {
        Self {
            body,
            buffer: Vec::new(),
            from: 0,
        }
    }

    /// Whether the next line has arrived already.
    pub(super) fn has_next(&self) -> bool {
        self.buffer[self.from..].contains(&b'\n')
    }

    /// The next line, without its end; none at the end of the answer.
    ///
    /// # Errors
    /// [`Trouble`]
    pub(super) async fn next(&mut self) -> Result<Option<&[u8]>, Trouble> {
        let end = within(ANSWERING, self.end_of_line()).await?;
        let from = std::mem::replace(&mut self.from, end.map_or(0, |end| end + 1));
        Ok(end.map(|end| &self.buffer[from..end]))
    }

    /// Where the next line ends.
    async fn end_of_line(&mut self) -> Result<Option<usize>, Trouble> {
        let mut looked = self.from;
        loop {
            let found = self.buffer[looked..].iter().position(|&byte| byte == b'\n');
            let end = found.map_or(self.buffer.len(), |at| looked + at);
            if end - self.from > MOST_LINE {
                return Err(Wrong::Long.into());
            }
            if found.is_some() {
                return Ok(Some(end));
            }
            self.buffer.drain(..self.from);
            self.from = 0;
            looked = self.buffer.len();
            match next(&mut self.body).await? {
                Some(piece) => self.buffer.extend_from_slice(&piece),
                None if self.buffer.is_empty() => return Ok(None),
                None => return Err(Trouble::Cut),
            }
        }
    }
}
