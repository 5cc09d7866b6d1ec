//! A polygon in camera pixels, as the pixels inside it.

use crate::math::hull;
use alloc::vec::Vec;
use core::ops::Range;

/// The pixels whose centres lie inside a polygon (even-odd rule), as spans of rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Region {
    /// Corners (u, v).
    corners: Vec<(f64, f64)>,
    spans: Spans,
}

/// Spans of pixels from the top row down.
#[derive(Clone, Debug, Default, PartialEq)]
struct Spans {
    /// Row and columns.
    all: Vec<(usize, Range<usize>)>,
    /// The index of the first span of each row of the frame, and the number of spans.
    firsts: Vec<usize>,
}

/// An edge of a polygon that a row crosses.
#[derive(Debug)]
pub(super) struct CrossedEdge {
    from: (f64, f64),
    way: (f64, f64),
    /// The column where the row crosses it.
    u: f64,
}

/// A polygon that encloses nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RegionError {
    /// Fewer than three corners.
    #[error("a region of {0} corners: a polygon needs at least 3")]
    Corners(usize),
    /// A corner is not finite.
    #[error("corner {corner} of the region is not finite")]
    NotFinite {
        /// Which corner.
        corner: usize,
    },
    /// No pixel centre of the frame lies inside.
    #[error("the region holds no pixel of the frame: corners are (column, row) in camera pixels")]
    Empty,
}

impl Region {
    /// The pixels of a frame of `width` × `height` inside a polygon of (u, v) corners. What lies
    /// outside the frame is cut off.
    ///
    /// # Errors
    /// If the polygon has fewer than three corners, one is not finite, or no pixel lies inside.
    pub fn polygon(
        corners: &[(f64, f64)],
        width: usize,
        height: usize,
    ) -> Result<Self, RegionError> {
        if corners.len() < 3 {
            return Err(RegionError::Corners(corners.len()));
        }
        let bad = |(u, v): &(f64, f64)| !(u.is_finite() && v.is_finite());
        if let Some(corner) = corners.iter().position(bad) {
            return Err(RegionError::NotFinite { corner });
        }
        let mut spans = Spans::default();
        spans.fill(corners, (width, height), &mut Vec::new());
        if spans.all.is_empty() {
            return Err(RegionError::Empty);
        }
        Ok(Self {
            corners: corners.to_vec(),
            spans,
        })
    }

    /// Bytes that it takes.
    pub(super) fn bytes(&self) -> usize {
        let Spans { all, firsts } = &self.spans;
        size_of_val(&*self.corners) + size_of_val(&**all) + size_of_val(&**firsts)
    }

    /// Becomes another region with its corners moved by `to`, in a frame of this size (width,
    /// height); it may hold no pixel then.
    pub(super) fn become_moved(
        &mut self,
        other: &Self,
        size: (usize, usize),
        to: impl Fn((f64, f64)) -> (f64, f64),
        crossed: &mut Vec<CrossedEdge>,
    ) {
        self.corners.clear();
        self.corners
            .extend(other.corners.iter().map(|&corner| to(corner)));
        self.spans.fill(&self.corners, size, crossed);
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.spans().iter().map(|(_, columns)| columns.len()).sum()
    }

    /// Whether there are no pixels: the default region, and one that was moved out of the frame.
    pub fn is_empty(&self) -> bool {
        self.spans().is_empty()
    }

    /// The pixels as places in a row-major map of rows of `width`.
    pub fn places(&self, width: usize) -> impl Iterator<Item = usize> + '_ {
        self.spans()
            .iter()
            .flat_map(move |(row, columns)| row * width + columns.start..row * width + columns.end)
    }

    /// The rows and columns of the region's spans.
    pub fn spans(&self) -> &[(usize, Range<usize>)] {
        &self.spans.all
    }

    /// The columns and rows of the box around it.
    pub(super) fn bounds(&self) -> (Range<usize>, Range<usize>) {
        let columns = self.spans().iter().map(|(_, columns)| columns.clone());
        let rows = self.spans().iter().map(|(row, _)| *row..row + 1);
        (columns.fold(0..0, hull), rows.fold(0..0, hull))
    }

    /// The spans of row `v`.
    pub(super) fn row(&self, v: usize) -> &[(usize, Range<usize>)] {
        let Spans { all, firsts } = &self.spans;
        match firsts.get(v..v + 2) {
            Some(&[first, end]) => &all[first..end],
            _ => &[],
        }
    }
}

/// The spans of pixel centres of a frame inside a closed polygon of (u, v) corners, even-odd rule.
pub fn polygon_spans(
    corners: &[(f64, f64)],
    width: usize,
    height: usize,
) -> Vec<(usize, Range<usize>)> {
    let mut spans = Spans::default();
    spans.fill(corners, (width, height), &mut Vec::new());
    spans.all
}

impl Spans {
    /// Becomes the spans of a polygon in a frame (width, height); `crossed` is a buffer.
    fn fill(
        &mut self,
        corners: &[(f64, f64)],
        (width, height): (usize, usize),
        crossed: &mut Vec<CrossedEdge>,
    ) {
        let (mut top, mut bottom) = (height as f64, 0.0_f64);
        for (_, v) in corners {
            (top, bottom) = (top.min(*v), bottom.max(*v));
        }
        let Self { all: spans, firsts } = self;
        spans.clear();
        firsts.clear();
        // Most rows have one span; a part may move by some rows.
        let rows = ((bottom - top).max(0.0) as usize).min(height) + 1;
        if spans.capacity() < rows {
            spans.reserve(rows + rows / 8);
        }
        // The same edges are crossed until the next corner.
        let mut corner = f64::NEG_INFINITY;
        for row in 0..height {
            firsts.push(spans.len());
            let v = row as f64;
            if v < top || v > bottom {
                continue;
            }
            if v >= corner {
                crossed.clear();
                corner = f64::INFINITY;
                let mut from = corners[corners.len() - 1];
                for &to in corners {
                    if (from.1 <= v) != (to.1 <= v) {
                        let way = (to.0 - from.0, to.1 - from.1);
                        crossed.push(CrossedEdge { from, way, u: 0.0 });
                    }
                    if to.1 > v {
                        corner = corner.min(to.1);
                    }
                    from = to;
                }
            }
            for CrossedEdge { from, way, u } in crossed.iter_mut() {
                *u = from.0 + way.0 * ((v - from.1) / way.1);
            }
            if !crossed.is_sorted_by(|a, b| a.u <= b.u) {
                crossed.sort_unstable_by(|a, b| a.u.total_cmp(&b.u));
            }
            for pair in crossed.chunks_exact(2) {
                let (start, end) = (column(pair[0].u, width), column(pair[1].u, width));
                if start < end {
                    spans.push((row, start..end));
                }
            }
        }
        firsts.push(spans.len());
    }
}

/// u rounded up, inside a row of `width` pixels.
fn column(u: f64, width: usize) -> usize {
    // Casts cut off, and keep to the range of their type.
    let whole = u as usize;
    (whole + usize::from((whole as f64) < u)).min(width)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rectangle_holds_the_pixel_centres_inside_it() {
        let corners = [(1.5, 0.5), (4.5, 0.5), (4.5, 2.5), (1.5, 2.5)];
        let region = Region::polygon(&corners, 10, 10).unwrap();
        assert_eq!(region.spans(), [(1, 2..5), (2, 2..5)]);
        assert_eq!(region.len(), 6);
        assert_eq!(region.places(10).next(), Some(12));
    }

    #[test]
    fn polygons_are_cut_at_the_frame_and_may_be_concave() {
        let corners = [(-5.0, -5.0), (3.5, -5.0), (3.5, 20.0), (-5.0, 20.0)];
        let region = Region::polygon(&corners, 8, 4).unwrap();
        assert_eq!(region.len(), 4 * 4);
        // A U: two spans in its upper rows.
        let u = [
            (0.0, 0.0),
            (2.5, 0.0),
            (2.5, 3.5),
            (5.5, 3.5),
            (5.5, 0.0),
            (7.5, 0.0),
            (7.5, 6.5),
            (0.0, 6.5),
        ];
        let region = Region::polygon(&u, 8, 8).unwrap();
        assert_eq!(
            region.spans().iter().filter(|(row, _)| *row == 1).count(),
            2
        );
        assert_eq!(
            region.spans().iter().filter(|(row, _)| *row == 5).count(),
            1
        );
    }

    #[test]
    fn a_pixel_is_inside_where_an_odd_number_of_edges_is_crossed_on_its_left() {
        const SIDE: usize = 24;
        let mut state = 7_u32;
        let mut inside = 0;
        for polygon in 0..200 {
            // Quarters of pixels, so that corners meet centres of pixels.
            let mut coordinate = || {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                f64::from(state >> 25) / 4.0 - 4.0
            };
            let corners: Vec<_> = (0..3 + polygon % 6)
                .map(|_| (coordinate(), coordinate()))
                .collect();
            let mut pixels = [[false; SIDE]; SIDE];
            for (v, columns) in polygon_spans(&corners, SIDE, SIDE) {
                pixels[v][columns].fill(true);
            }
            for (v, row) in pixels.iter().enumerate() {
                for (u, &filled) in row.iter().enumerate() {
                    let next = corners.iter().cycle().skip(1);
                    let crossed = corners.iter().zip(next).filter(|&(&(u0, v0), &(u1, v1))| {
                        let y = v as f64;
                        let at = u0 + (u1 - u0) * ((y - v0) / (v1 - v0));
                        (v0 <= y) != (v1 <= y) && at <= u as f64
                    });
                    assert_eq!(filled, crossed.count() % 2 == 1, "{corners:?}");
                    inside += usize::from(filled);
                }
            }
        }
        assert!(inside > 10_000, "{inside}");
    }

    #[test]
    fn polygons_that_hold_nothing_are_refused() {
        assert_eq!(
            Region::polygon(&[(0.0, 0.0); 2], 8, 8),
            Err(RegionError::Corners(2))
        );
        let away = [(20.0, 1.0), (30.0, 1.0), (30.0, 5.0)];
        assert_eq!(Region::polygon(&away, 8, 8), Err(RegionError::Empty));
        let broken = [(0.0, 0.0), (f64::NAN, 1.0), (3.0, 5.0)];
        assert_eq!(
            Region::polygon(&broken, 8, 8),
            Err(RegionError::NotFinite { corner: 1 })
        );
    }
}
