//! Rows of samples that are read block by block, with one check for all of them.

/// Four rows of equal length.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Four<'a, T> {
    rows: [&'a [T]; 4],
    /// No row is shorter.
    length: usize,
}

impl<'a, T> Four<'a, T> {
    /// Rows that are read as far as all of them reach.
    pub fn new(rows: [&'a [T]; 4]) -> Self {
        let length = rows.iter().map(|row| row.len()).min().unwrap_or(0);
        Self { rows, length }
    }

    /// The rows.
    pub fn rows(&self) -> [&'a [T]; 4] {
        self.rows
    }

    /// Where the blocks of `pixels` samples at `at` start; all of them may be read.
    ///
    /// # Panics
    /// If a row ends before.
    #[inline(always)]
    pub(super) fn blocks(&self, at: usize, pixels: usize) -> [*const T; 4] {
        assert!(at < self.length && pixels <= self.length - at);
        let [a, b, c, d] = self.rows;
        // SAFETY: every row holds at least `length` samples, and the block ends before that, asserted above.
        unsafe {
            [
                a.as_ptr().add(at),
                b.as_ptr().add(at),
                c.as_ptr().add(at),
                d.as_ptr().add(at),
            ]
        }
    }
}
