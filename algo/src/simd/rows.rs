//! Rows of samples that are read block by block, with one bounds check for several rows.

/// Four rows of equal length.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Four<'a, T> {
    rows: [&'a [T]; 4],
    /// No row is shorter.
    length: usize,
}

impl<'a, T> Four<'a, T> {
    /// Rows that are read up to `length`.
    ///
    /// # Panics
    /// If a row ends before.
    pub fn new(rows: [&'a [T]; 4], length: usize) -> Self {
        for row in rows {
            assert!(row.len() >= length);
        }
        Self { rows, length }
    }

    /// The rows.
    pub fn rows(&self) -> [&'a [T]; 4] {
        self.rows
    }

    /// The starts of the blocks of `pixels` samples at `at`, all of which may be read.
    ///
    /// # Panics
    /// If a block does not end within the rows.
    #[inline(always)]
    pub(super) fn blocks(&self, at: usize, pixels: usize) -> [*const T; 4] {
        assert_fits(at, pixels, self.length);
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

/// Asserts that a block of `pixels` at `at` ends within `length`. Always in this form, so that the compiler merges the checks of
/// all rows of one length.
#[inline(always)]
fn assert_fits(at: usize, pixels: usize, length: usize) {
    assert!(length >= pixels && at <= length - pixels);
}
