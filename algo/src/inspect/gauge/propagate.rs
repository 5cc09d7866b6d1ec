//! The error of a value that is a function of the geometry of features, by numeric propagation.
//!
//! # Equations
//! With q what the value f depends on, block by block, and C the covariance of a block,
//!
//! ```text
//! σ² = Σ gᵀ C g        gᵢ = [f(qᵢ + uᵢ) − f(qᵢ − uᵢ)] / 2uᵢ        uᵢ = √Cᵢᵢ
//! ```
//!
//! (JCGM 100:2008, 5.1.3 note 2, with 5.2.2 for covariances). The blocks are the parameters of each
//! feature, by the noise of its pixels, and the six components of the part's motion, which moves
//! all features together: what does not change when the part is moved as a whole, like the distance
//! of two parallel planes, has no error by the motion. As for
//! [`Evidence::linear`](super::Evidence::linear) the blocks are taken as independent.
//!
//! # Accuracy
//! Within 2 % where the value is 10 σ or more from a kink:
//! `errors_of_geometric_kinds_are_the_scatter_of_random_draws`.

use super::kind::{Kind, MAX_PLACES};
use super::reading::Found;
use crate::geometry::Vector;
use crate::inspect::align::{Motion, Placed, form};
use crate::inspect::feature::{FittedPlane, Geometry};
use crate::math::derivative::derivative;

/// A feature, and how it depends on what was measured.
#[derive(Clone, Copy, Debug)]
pub struct Sensitive<'a> {
    /// The feature.
    pub plane: &'a FittedPlane,
    /// What 1 mm more of each of its cells adds to its parameters.
    pub rows: &'a [[f64; 3]],
}

/// The value of features, at most [`MAX_PLACES`], with its errors; `None` where it is not finite.
pub fn propagate(kind: &dyn Kind, of: &[Sensitive<'_>], placed: Option<&Placed>) -> Option<Found> {
    let mut here = [Geometry::default(); MAX_PLACES];
    let here = here.get_mut(..of.len())?;
    for (geometry, Sensitive { plane, .. }) in here.iter_mut().zip(of) {
        *geometry = plane.geometry(plane.parameters);
    }
    let here = &*here;
    let value = |of: &[Geometry]| kind.value(of).unwrap_or(f64::NAN);
    let found = value(here);
    let (mut pixels, mut lever) = (0.0, 0.0);
    for (at, Sensitive { plane, rows }) in of.iter().enumerate() {
        let covariance = &plane.covariance;
        let g: [f64; 3] = core::array::from_fn(|i| {
            derivative(found, libm::sqrt(covariance[i][i]), |step| {
                let mut parameters = plane.parameters;
                parameters[i] += step;
                let mut changed = [Geometry::default(); MAX_PLACES];
                let changed = &mut changed[..here.len()];
                changed.copy_from_slice(here);
                changed[at] = plane.geometry(parameters);
                value(changed)
            })
        });
        let dot = |row: &[f64; 3]| g[0] * row[0] + g[1] * row[1] + g[2] * row[2];
        pixels += (0..3).map(|i| g[i] * dot(&covariance[i])).sum::<f64>();
        lever += rows.iter().map(|row| libm::fabs(dot(row))).sum::<f64>();
    }
    let motion = placed.map_or(0.0, |placed| {
        let g = core::array::from_fn(|i| {
            let sigma = libm::sqrt(placed.covariance[i][i].max(0.0));
            derivative(found, sigma, |step| {
                let motion = component(placed, i, step);
                let mut moved = [Geometry::default(); MAX_PLACES];
                for (geometry, Sensitive { plane, .. }) in moved.iter_mut().zip(of) {
                    *geometry = plane.geometry(plane.moved(&motion));
                }
                value(&moved[..of.len()])
            })
        });
        form(&g, &placed.covariance, &g).max(0.0)
    });
    let finite = [found, pixels, motion, lever].iter().all(|x| x.is_finite());
    finite.then_some(Found {
        value: found,
        pixels,
        motion,
        lever,
    })
}

/// A motion along one of the components of the covariance: a shift in mm, or a turn as the way of a
/// point at the part's radius.
fn component(placed: &Placed, at: usize, way: f64) -> Motion {
    let mut all = [0.0; 6];
    all[at] = way;
    let [x, y, z, about_x, about_y, about_z] = all;
    Motion::new(
        placed.motion.centre,
        Vector::new(x, y, z),
        Vector::new(about_x, about_y, about_z) * (1.0 / placed.radius),
    )
}
