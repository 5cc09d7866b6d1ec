//! What lines of sight meet on a plane, interpolated between nodes.
//!
//! Between nodes [`SPACING`] px apart what a line of sight meets is quadratic along columns and
//! along rows in good approximation: with 0.4 mm per px and a perspective that changes the scale by
//! a tenth over the frame, the error is some 10⁻⁶ mm, and far below a thousandth of a turn where the
//! width of fringes doubles within 50 px. A node costs a projection into the projector, a place
//! between nodes a few products.

use crate::inspect::contour::Spot;
use alloc::vec::Vec;

/// Pixels from node to node.
const SPACING: f64 = 8.0;

/// Nodes over a part of the frame.
#[derive(Clone, Debug, Default)]
pub struct Near {
    left: f64,
    top: f64,
    /// Nodes of a row: an odd number.
    columns: usize,
    /// x, y and phase of the nodes, row-major.
    nodes: Vec<[f64; 3]>,
}

impl Near {
    /// Over the pixels from `low` to `high`, of what `exact` says; empty where it does not know one
    /// of the nodes.
    pub fn new(
        low: (f64, f64),
        high: (f64, f64),
        exact: impl Fn(f64, f64) -> Option<Spot>,
    ) -> Self {
        // Casts keep to the range of their type.
        let count = |low: f64, high: f64| {
            let pairs = libm::ceil((high - low) / (2.0 * SPACING)).max(1.0) as usize;
            2 * pairs + 1
        };
        let (columns, rows) = (count(low.0, high.0), count(low.1, high.1));
        let node = |at: usize| {
            let (column, row) = ((at % columns) as f64, (at / columns) as f64);
            let Spot { x, y, phase } = exact(low.0 + column * SPACING, low.1 + row * SPACING)?;
            Some([x, y, phase])
        };
        let nodes: Option<Vec<_>> = (0..columns * rows).map(node).collect();
        Self {
            left: low.0,
            top: low.1,
            columns,
            nodes: nodes.unwrap_or_default(),
        }
    }

    /// What the line of sight through (u, v) meets; `None` beside the nodes.
    #[inline]
    pub fn at(&self, u: f64, v: f64) -> Option<Spot> {
        let (along, down) = ((u - self.left) / SPACING, (v - self.top) / SPACING);
        if !(along >= 0.0 && down >= 0.0) {
            return None;
        }
        // The middle of the three nodes; casts cut off.
        let (column, row) = (along as usize / 2 * 2, down as usize / 2 * 2);
        if column + 2 >= self.columns {
            return None;
        }
        let first = row * self.columns + column;
        let (across, beneath) = (weights(along - column as f64), weights(down - row as f64));
        let mut sums = [0.0; 3];
        for (line, beneath) in beneath.iter().enumerate() {
            let start = first + line * self.columns;
            let nodes = self.nodes.get(start..start + 3)?;
            for (node, across) in nodes.iter().zip(across) {
                let weight = beneath * across;
                for (sum, value) in sums.iter_mut().zip(node) {
                    *sum += weight * value;
                }
            }
        }
        let [x, y, phase] = sums;
        Some(Spot { x, y, phase })
    }
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
        let exact = |u: f64, v: f64| {
            Some(Spot {
                x: 0.4 * u + 1e-3 * v * v,
                y: 0.4 * v - 1e-3 * u * v,
                phase: 0.1 * u + 1e-3 * u * u,
            })
        };
        let near = Near::new((3.0, 5.0), (70.0, 21.0), exact);
        for (u, v) in [(3.0, 5.0), (19.0, 21.0), (20.5, 13.25), (70.0, 20.9)] {
            let (found, true_one) = (near.at(u, v).unwrap(), exact(u, v).unwrap());
            let off = [
                found.x - true_one.x,
                found.y - true_one.y,
                found.phase - true_one.phase,
            ];
            assert!(off.iter().all(|off| off.abs() < 1e-9), "{u} {v} {off:?}");
        }
        for (u, v) in [(2.9, 6.0), (4.0, 4.9), (90.0, 6.0), (4.0, 40.0)] {
            assert_eq!(near.at(u, v), None);
        }
        let dark = Near::new((0.0, 0.0), (9.0, 9.0), |u, _| {
            (u < 8.0).then_some(Spot {
                x: 0.0,
                y: 0.0,
                phase: 0.0,
            })
        });
        assert_eq!(dark.at(1.0, 1.0), None);
    }
}
