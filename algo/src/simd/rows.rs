//! Rows of samples that are read block by block, with one bounds check for several rows.

/// Any number of rows that are read up to one length.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rows<'a, T> {
    rows: &'a [&'a [T]],
    /// No row is shorter.
    length: usize,
}

impl<'a, T> Rows<'a, T> {
    /// Rows that are read up to `length`.
    ///
    /// # Panics
    /// If a row ends before.
    pub fn new(rows: &'a [&'a [T]], length: usize) -> Self {
        for row in rows {
            assert!(row.len() >= length);
        }
        Self { rows, length }
    }

    /// The first columns.
    ///
    /// # Panics
    /// If there are fewer.
    pub fn part(self, length: usize) -> Self {
        assert!(length <= self.length);
        Self { length, ..self }
    }

    /// How many rows.
    #[inline(always)]
    pub fn count(&self) -> usize {
        self.rows.len()
    }

    /// The rows, of which there are N.
    ///
    /// # Panics
    /// If there are fewer.
    #[inline(always)]
    pub fn all<const N: usize>(&self) -> [&'a [T]; N] {
        let mut rows = [self.row(0); N];
        let mut at = 1;
        while at < N {
            rows[at] = self.row(at);
            at += 1;
        }
        rows
    }

    /// Row `at`. All have the same length, so that the compiler merges the checks of their blocks.
    ///
    /// # Panics
    /// If there are fewer rows.
    #[inline(always)]
    pub fn row(&self, at: usize) -> &'a [T] {
        // SAFETY: every row holds at least `length` samples, asserted by `new` and `part`.
        unsafe { self.rows[at].get_unchecked(..self.length) }
    }
}

/// The block of `pixels` at `at`.
///
/// # Panics
/// If it does not end within the row.
#[inline(always)]
pub(super) fn block<T>(row: &[T], at: usize, pixels: usize) -> &[T] {
    assert_fits(at, pixels, row.len());
    // SAFETY: the block ends within the row, asserted above.
    unsafe { row.get_unchecked(at..at + pixels) }
}

/// As [`block`], to be written.
#[inline(always)]
pub(super) fn block_mut<T>(row: &mut [T], at: usize, pixels: usize) -> &mut [T] {
    assert_fits(at, pixels, row.len());
    // SAFETY: the block ends within the row, asserted above.
    unsafe { row.get_unchecked_mut(at..at + pixels) }
}

/// Asserts that a block of `pixels` at `at` ends within `length`. Always in this form, so that the
/// compiler merges the checks of all rows of one length.
#[inline(always)]
fn assert_fits(at: usize, pixels: usize, length: usize) {
    assert!(length >= pixels && at <= length - pixels);
}
