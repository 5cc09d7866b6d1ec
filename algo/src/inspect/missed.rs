//! What golden's straight lines between pixels miss of a bent surface: by how much a good part
//! deviates that lies elsewhere than golden.
//!
//! # Idea
//! Production compares a displaced part with golden between four pixels, by bilinear interpolation.
//! A smooth surface lies off these straight lines where it is bent, most in the middle between
//! pixels, and a part may lie so that any place is in the middle. So the error is worked out there,
//! from golden alone, for all placements at once.
//!
//! # Equations
//! With heights a, b, c, d of four pixels in a row, the cubic in the middle between b and c (R. Keys,
//! *Cubic convolution interpolation*, IEEE Trans. ASSP 29, 1981) less the straight line is (−a + b +
//! c − d)/16. Of a motion by half a pixel along, down or both, the means of this over the square
//! about a pixel are m_u, m_v and m_u + m_v but for the product of both bends; the largest of their
//! magnitudes counts. Each is along the normal ([`normal_shares`](super::normal_shares)).
//!
//! # Shapes and units
//! Row-major maps over the camera's frame, mm.
//!
//! # Accuracy
//! Of a cylinder it is s²/8R with s the way of a pixel across it
//! (`a_cylinder_is_missed_by_its_sagitta`). Parts in front of the simulated head are compared with
//! it in `tests/suite/every_part.rs`.

use super::table::IntegralTable;
use super::weight::Weight;
use crate::pipeline::KnownSurface;

/// Golden with what is missed of it.
#[derive(Clone, Debug)]
pub struct Missed {
    /// Of the compared pixels: their number, and what is missed along and down.
    sums: IntegralTable<3>,
}

impl Missed {
    /// What is missed of a surface where it is compared; `shares` of a height difference lie along
    /// the normal.
    pub fn new(surface: &KnownSurface, shares: &[f32], weights: &[Weight]) -> Self {
        let (width, heights) = (surface.width, &surface.height);
        let middle = |place: usize, stride: usize| {
            let first = place.checked_sub(stride)?;
            let mut four = [0.0; 4];
            for (nm, at) in four.iter_mut().zip((first..).step_by(stride)) {
                let height = heights.get(at).filter(|height| height.is_known())?;
                *nm = f64::from(height.nm());
            }
            let [a, b, c, d] = four;
            Some((b - a + c - d) * (1e-6 / 16.0))
        };
        let sums = IntegralTable::new(width, heights.len(), |place| {
            let weight = weights[place];
            let share = f64::from(shares[place]) * weight.share();
            let (along, down) = (middle(place, 1)?, middle(place, width)?);
            weight
                .compared()
                .then_some([1.0, share * along, share * down])
        });
        Self { sums }
    }

    /// The largest mean over the square of `side` pixels about a pixel, mm; 0 where less than half
    /// of it is compared.
    pub fn at(&self, place: usize, side: usize) -> f64 {
        let means = self.sums.means(place, side);
        means.map_or(0.0, |[_, along, down]| {
            let all = [along, down, along + down].map(libm::fabs);
            all.into_iter().fold(0.0, f64::max)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::{AbsolutePhase, Height};
    use alloc::vec;
    use alloc::vec::Vec;

    const SIZE: usize = 40;

    fn surface(height: impl Fn(f64, f64) -> f64) -> KnownSurface {
        let heights = (0..SIZE * SIZE).map(|at| height((at % SIZE) as f64, (at / SIZE) as f64));
        let height: Vec<_> = heights.map(Height::from_mm).collect();
        KnownSurface {
            width: SIZE,
            phase: vec![AbsolutePhase::UNKNOWN; height.len()],
            height,
        }
    }

    fn missed(surface: &KnownSurface) -> Missed {
        let shares = vec![1.0; SIZE * SIZE];
        Missed::new(surface, &shares, &vec![Weight::FULL; SIZE * SIZE])
    }

    #[test]
    fn a_cylinder_is_missed_by_its_sagitta() {
        let middle = (SIZE / 2) * SIZE + SIZE / 2;
        let radius = 10.0;
        let pixel = 0.4;
        let along = move |u: f64| {
            let x = pixel * (u - (SIZE / 2) as f64);
            libm::sqrt(radius * radius - x * x)
        };
        let sagitta = pixel * pixel / (8.0 * radius);
        for of in [
            missed(&surface(|u, _| along(u))),
            missed(&surface(|_, v| along(v))),
        ] {
            for side in [3, 5, 9] {
                let found = of.at(middle, side);
                assert!((found / sagitta - 1.0).abs() < 0.02, "{found} {sagitta}");
            }
        }
        let both = missed(&surface(|u, v| along(u) + along(v)));
        assert!((both.at(middle, 3) / sagitta - 2.0).abs() < 0.02);
        let saddle = missed(&surface(|u, v| along(u) - along(v)));
        assert!((saddle.at(middle, 3) / sagitta - 1.0).abs() < 0.02);
    }

    #[test]
    fn a_plane_is_not_missed_and_a_crease_most_in_small_squares_at_it() {
        let plane = missed(&surface(|u, v| 0.3 * u - 0.2 * v));
        assert!(plane.at(20 * SIZE + 20, 3) < 1e-6);
        let crease = missed(&surface(|u, _| (u - 20.0).abs()));
        let [small, large, away] =
            [(20, 3), (20, 9), (27, 3)].map(|(u, side)| crease.at(20 * SIZE + u, side));
        // (−1 + 0 + 1 − 2)/16 on both sides of it, over three and over nine columns.
        let expected = [0.25 / 3.0, 0.25 / 9.0, 0.0];
        for (found, expected) in [small, large, away].into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-6, "{found} for {expected}");
        }
    }
}
