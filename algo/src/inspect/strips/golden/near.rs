//! What lines of sight meet, interpolated between nodes.
//!
//! Between nodes [`SPACING`] px apart what a line of sight meets on a plane is quadratic along
//! columns and along rows in good approximation: with 0.4 mm per px and a perspective that changes
//! the scale by a tenth over the frame, the error is some 10⁻⁶ mm, and far below a thousandth of a
//! turn where the width of fringes doubles within 50 px. A node costs a projection, a place between
//! nodes a few products.

use alloc::vec::Vec;

/// Pixels from node to node.
const SPACING: f64 = 8.0;

/// N values at nodes over a part of the frame.
#[derive(Clone, Debug, Default)]
pub struct Near<const N: usize> {
    left: f64,
    top: f64,
    /// Nodes of a row: an odd number.
    columns: usize,
    /// Row-major.
    nodes: Vec<[f64; N]>,
}

/// Nodes of three rows, interpolated to a row of pixels.
pub type NodeRow<const N: usize> = Vec<[f64; N]>;

impl<const N: usize> Near<N> {
    /// Over the pixels from `low` to `high`, of what `exact` says; empty where it does not know one
    /// of the nodes.
    pub fn new(
        low: (f64, f64),
        high: (f64, f64),
        exact: impl Fn(f64, f64) -> Option<[f64; N]>,
    ) -> Self {
        // Casts keep to the range of their type.
        let count = |low: f64, high: f64| {
            let pairs = libm::ceil((high - low) / (2.0 * SPACING)).max(1.0) as usize;
            2 * pairs + 1
        };
        let (columns, rows) = (count(low.0, high.0), count(low.1, high.1));
        let node = |at: usize| {
            let (column, row) = ((at % columns) as f64, (at / columns) as f64);
            exact(low.0 + column * SPACING, low.1 + row * SPACING)
        };
        let nodes: Option<Vec<_>> = (0..columns * rows).map(node).collect();
        Self {
            left: low.0,
            top: low.1,
            columns,
            nodes: nodes.unwrap_or_default(),
        }
    }

    /// The values at (u, v); `None` beside the nodes.
    #[inline]
    pub fn at(&self, u: f64, v: f64) -> Option<[f64; N]> {
        let (column, across) = self.column(u)?;
        let (row, beneath) = self.row(v)?;
        let mut sums = [0.0; N];
        for (line, beneath) in beneath.iter().enumerate() {
            let start = (row + line) * self.columns + column;
            let nodes = self.nodes.get(start..start + 3)?;
            for (node, across) in nodes.iter().zip(across) {
                let weight = beneath * across;
                for (sum, value) in sums.iter_mut().zip(node) {
                    *sum += weight * value;
                }
            }
        }
        Some(sums)
    }

    /// The nodes at row `v` of pixels, for [`Self::in_row`]; none beside the nodes.
    pub fn take_row(&self, v: f64, out: &mut NodeRow<N>) {
        out.clear();
        let Some((row, beneath)) = self.row(v) else {
            return;
        };
        let start = row * self.columns;
        let Some(nodes) = self.nodes.get(start..start + 3 * self.columns) else {
            return;
        };
        let [upper, middle, lower] = [0, 1, 2].map(|line| &nodes[line * self.columns..]);
        for column in 0..self.columns {
            out.push(core::array::from_fn(|i| {
                beneath[0] * upper[column][i]
                    + beneath[1] * middle[column][i]
                    + beneath[2] * lower[column][i]
            }));
        }
    }

    /// The values at column `u` of a row that was taken; `None` beside the nodes.
    #[inline]
    pub fn in_row(&self, row: &NodeRow<N>, u: f64) -> Option<[f64; N]> {
        let (column, across) = self.column(u)?;
        let nodes = row.get(column..column + 3)?;
        Some(core::array::from_fn(|i| {
            across[0] * nodes[0][i] + across[1] * nodes[1][i] + across[2] * nodes[2][i]
        }))
    }

    /// The first of the three nodes about a column, and their weights.
    #[inline]
    fn column(&self, u: f64) -> Option<(usize, [f64; 3])> {
        three(u - self.left, self.columns)
    }

    #[inline]
    fn row(&self, v: f64) -> Option<(usize, [f64; 3])> {
        three(v - self.top, self.nodes.len() / self.columns.max(1))
    }
}

/// The first of the three nodes about a place, px from the first of all, and their weights; `None`
/// beside them.
#[inline]
fn three(from_first: f64, count: usize) -> Option<(usize, [f64; 3])> {
    let (at, last) = (from_first / SPACING, count.checked_sub(3)?);
    if !(at >= 0.0 && at <= (last + 2) as f64) {
        return None;
    }
    // Casts cut off.
    let first = (at as usize / 2 * 2).min(last);
    Some((first, weights(at - first as f64)))
}

/// The weights of values at 0, 1 and 2 (J. L. Lagrange).
#[inline]
fn weights(at: f64) -> [f64; 3] {
    [
        (1.0 - at) * (2.0 - at) / 2.0,
        at * (2.0 - at),
        at * (at - 1.0) / 2.0,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quadratic_is_met_exactly_inside_and_nothing_is_known_outside() {
        let exact = |u: f64, v: f64| Some([0.4 * u + 1e-3 * v * v, 0.4 * v - 1e-3 * u * v]);
        let near = Near::new((3.0, 5.0), (70.0, 21.0), exact);
        let mut row = Vec::new();
        for (u, v) in [(3.0, 5.0), (19.0, 21.0), (20.5, 13.25), (70.0, 20.9)] {
            near.take_row(v, &mut row);
            let expected = exact(u, v).unwrap();
            for found in [near.at(u, v), near.in_row(&row, u)] {
                let off = |i: usize| (found.unwrap()[i] - expected[i]).abs();
                assert!(off(0) < 1e-9 && off(1) < 1e-9, "{u} {v} {found:?}");
            }
        }
        for (u, v) in [(2.9, 6.0), (4.0, 4.9), (90.0, 6.0), (4.0, 40.0)] {
            near.take_row(v, &mut row);
            assert_eq!((near.at(u, v), near.in_row(&row, u)), (None, None));
        }
        let dark = Near::new((0.0, 0.0), (9.0, 9.0), |u, _| (u < 8.0).then_some([0.0]));
        assert_eq!(dark.at(1.0, 1.0), None);
    }
}
