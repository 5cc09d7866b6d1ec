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
//! plane by the noise of its pixels, those of each contour in its plane, and the six components of
//! the part's motion. A plane that two contours lie in moves both of them, and the motion all
//! features together: what does not change when the part is moved as a whole, like the distance of
//! two holes, has no error by the motion. As for [`Evidence::linear`](super::Evidence::linear) the
//! blocks are taken as independent.
//!
//! Along directions that the part's shape leaves open the motion has no covariance. A value of a
//! contour that depends on them is none.
//!
//! What else is uncertain of contours ([`Source`]) is propagated likewise, each input by itself;
//! a shift of all edges towards their material changes all contours at once.
//!
//! # Accuracy
//! Within 2 % where the value is 10 σ or more from a kink:
//! `errors_of_geometric_kinds_are_the_scatter_of_random_draws`.

use super::datum::DatumFrame;
use super::kind::{Kind, MAX_PLACES};
use super::reading::Found;
use super::region;
use crate::geometry::Vector;
use crate::inspect::align::{Motion, Placed, form};
use crate::inspect::contour::Source;
use crate::inspect::feature::{FittedPlane, Geometry, Parameters, Rim};
use crate::math::derivative;

/// A plane, and how it depends on what was measured.
#[derive(Clone, Copy, Debug)]
pub struct SensitivePlane<'a> {
    /// Which plane: two features with the same number share it.
    pub id: usize,
    /// The plane.
    pub plane: &'a FittedPlane,
    /// What 1 mm more of each of its cells adds to its parameters.
    pub rows: &'a [[f64; 3]],
}

/// A feature, and how it depends on what was measured.
#[derive(Clone, Copy, Debug)]
pub enum Sensitive<'a> {
    /// A plane.
    Plane(SensitivePlane<'a>),
    /// A contour.
    Contour {
        /// Which contour.
        id: usize,
        /// What was found of it.
        rim: &'a Rim,
        /// The plane that it lies in.
        plane: SensitivePlane<'a>,
    },
}

/// A gauge's value as a function of features: those that it is of, and those of its datum system.
#[derive(Clone, Copy)]
pub struct Characteristic<'a> {
    /// The kind of the gauge.
    pub kind: &'a dyn Kind,
    /// Its features, at most [`MAX_PLACES`].
    pub of: &'a [Sensitive<'a>],
    /// Those of its datum system, at most [`MAX_DATUMS`]; none: the frame as taught.
    pub datum: &'a [Sensitive<'a>],
    /// Both as taught; planes keep the point that they have where they are empty.
    pub taught: [&'a [Geometry]; 2],
}

/// Most features of a datum system.
pub const MAX_DATUMS: usize = 3;

/// A value with its errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Propagated {
    /// The value and its error by noise.
    pub found: Found,
    /// Variance by inputs that are the same when the part is measured again elsewhere.
    pub shared: f64,
    /// Variance by inputs that are others wherever the part lies.
    pub own: f64,
    /// What of `shared` is by the radii of rims.
    pub rims: f64,
}

/// One thing that is otherwise than it was found.
#[derive(Clone, Copy, Debug)]
enum Change {
    None,
    /// A plane has other parameters.
    Plane(usize, [f64; 3]),
    /// A parameter of a contour is larger.
    Parameter(usize, usize, f64),
    /// An input of a contour, by its place in the list, is off by so many standard uncertainties.
    Input(usize, usize, f64),
    /// All edges of the part lie so many standard uncertainties towards their material.
    Edges(f64),
    /// The part lies so.
    Moved(Motion),
    /// All lengths in planes of contours are larger by this share.
    Scale(f64),
}

/// A value that changes by more than this share of a motion along an open direction depends on it.
const OPEN: f64 = 1e-3;
/// Step of a motion along an open direction, mm: smaller than what matters, far above rounding.
const OPEN_STEP: f64 = 1e-3;

impl Sensitive<'_> {
    fn plane(&self) -> &SensitivePlane<'_> {
        match self {
            Self::Plane(plane) | Self::Contour { plane, .. } => plane,
        }
    }

    /// Its geometry after a change.
    fn geometry(&self, change: &Change) -> Geometry {
        match self {
            Self::Plane(SensitivePlane { id, plane, .. }) => match change {
                Change::Plane(which, parameters) if which == id => plane.geometry(*parameters),
                Change::Moved(motion) => plane.geometry(plane.moved(motion)),
                _ => plane.geometry(plane.parameters),
            },
            Self::Contour { id, rim, plane } => {
                let p = &rim.parameters;
                let normal = rim.frame.normal();
                let still = |at: Vector| at;
                let off = |offs: &Parameters, by: f64| {
                    rim.geometry(
                        &core::array::from_fn(|i| p[i] + by * offs[i]),
                        normal,
                        still,
                    )
                };
                match change {
                    Change::Plane(which, parameters) if *which == plane.id => {
                        let of = plane.plane;
                        rim.geometry(p, of.geometry(*parameters).normal(), |at| {
                            rim.seen_on(at, of, *parameters)
                        })
                    }
                    Change::Parameter(which, at, step) if which == id => {
                        let mut unit = Parameters::default();
                        unit[*at] = 1.0;
                        off(&unit, *step)
                    }
                    Change::Input(which, at, by) if which == id => off(&rim.inputs[*at].1, *by),
                    Change::Edges(by) => {
                        let own = rim.inputs.iter().find(|(own, _)| *own == Source::Edge);
                        off(&own.map_or(Parameters::default(), |(_, off)| *off), *by)
                    }
                    Change::Moved(motion) => {
                        let turned =
                            motion.apply(motion.centre + normal) - motion.apply(motion.centre);
                        rim.geometry(p, turned, |at| motion.apply(at))
                    }
                    Change::Scale(by) => rim.geometry(p, normal, |at| at * (1.0 + by)),
                    _ => rim.geometry(p, normal, still),
                }
            }
        }
    }
}

impl Characteristic<'_> {
    /// The value after a change; NaN where there is none.
    fn value(&self, change: &Change) -> f64 {
        let of: heapless::Vec<Geometry, MAX_PLACES> =
            self.of.iter().map(|of| of.geometry(change)).collect();
        let datum: heapless::Vec<Geometry, MAX_DATUMS> =
            self.datum.iter().map(|of| of.geometry(change)).collect();
        self.of_geometry(of, &datum).unwrap_or(f64::NAN)
    }

    /// The value of these geometries; none where there is none.
    fn of_geometry(
        &self,
        mut of: heapless::Vec<Geometry, MAX_PLACES>,
        datum: &[Geometry],
    ) -> Option<f64> {
        let [taught, system] = self.taught;
        match (datum, system, taught) {
            ([], _, &[first, second]) => of[1] = region::beside(of[1], of[0], [second, first]),
            (&[reference], &[before], _) => {
                for (of, taught) in of.iter_mut().zip(taught) {
                    *of = region::beside(*of, reference, [*taught, before]);
                }
            }
            _ => {}
        }
        if datum.is_empty() {
            return self.kind.value(&of);
        }
        let frame = DatumFrame::of(datum)?;
        of.iter_mut().for_each(|of| *of = frame.coordinates(of));
        if let (true, Some(before)) = (datum.len() > 1, DatumFrame::of(system)) {
            for (of, taught) in of.iter_mut().zip(taught) {
                *of = region::above(*of, before.coordinates(taught));
            }
        }
        self.kind.value(&of)
    }

    fn all(&self) -> impl Iterator<Item = &Sensitive<'_>> + Clone {
        self.of.iter().chain(self.datum)
    }

    /// The value with its errors; `None` where it is not finite, or depends on how the part lies
    /// along a direction that its shape leaves open. Lengths have the relative uncertainty `length`.
    pub fn propagate(&self, placed: Option<&Placed>, length: f64) -> Option<Propagated> {
        let found = self.value(&Change::None);
        let slope = |step, change: &dyn Fn(f64) -> Change| {
            derivative(found, step, |by| self.value(&change(by)))
        };
        let (mut pixels, mut lever) = (0.0, 0.0);
        for (at, of) in self.all().enumerate() {
            let SensitivePlane { id, plane, rows } = *of.plane();
            let before = || self.all().take(at);
            if before().any(|other| other.plane().id == id) {
                continue;
            }
            let covariance = &plane.covariance;
            let g: [f64; 3] = core::array::from_fn(|i| {
                slope(libm::sqrt(covariance[i][i]), &|by| {
                    let mut parameters = plane.parameters;
                    parameters[i] += by;
                    Change::Plane(id, parameters)
                })
            });
            let dot = |row: &[f64; 3]| g[0] * row[0] + g[1] * row[1] + g[2] * row[2];
            pixels += (0..3).map(|i| g[i] * dot(&covariance[i])).sum::<f64>();
            lever += rows.iter().map(|row| libm::fabs(dot(row))).sum::<f64>();
        }
        let (mut shared, mut own, mut rims) = (0.0, 0.0, 0.0);
        let mut is_contour = false;
        for (at, of) in self.all().enumerate() {
            let Sensitive::Contour { id, rim, .. } = *of else {
                continue;
            };
            is_contour = true;
            let is_same = |other: &Sensitive<'_>| matches!(other, Sensitive::Contour { id: of, .. } if *of == id);
            if self.all().take(at).any(is_same) {
                continue;
            }
            let covariance = &rim.covariance;
            let mut g = Parameters::default();
            for (i, g) in g.iter_mut().enumerate().take(rim.count) {
                *g = slope(libm::sqrt(covariance[i][i]), &|by| {
                    Change::Parameter(id, i, by)
                });
            }
            let row = |i: usize| (0..rim.count).map(|j| covariance[i][j] * g[j]).sum::<f64>();
            pixels += (0..rim.count).map(|i| g[i] * row(i)).sum::<f64>();
            for (input, (source, _)) in rim.inputs.iter().enumerate() {
                // That of all contours at once follows.
                if *source == Source::Edge {
                    continue;
                }
                let off = slope(1.0, &|by| Change::Input(id, input, by));
                match source.is_of_place() {
                    true => own += off * off,
                    false => shared += off * off,
                }
                if *source == Source::Rim {
                    rims += off * off;
                }
            }
        }
        if is_contour {
            let edges = slope(1.0, &Change::Edges);
            let scale = slope(1.0, &|by| Change::Scale(by * length));
            shared += edges * edges + scale * scale;
        }
        let mut motion = 0.0;
        if let Some(placed) = placed {
            let g = core::array::from_fn(|i| {
                let sigma = libm::sqrt(placed.covariance[i][i].max(0.0));
                slope(sigma, &|by| {
                    let mut way = [0.0; 6];
                    way[i] = by;
                    Change::Moved(moved(placed, &way))
                })
            });
            motion = form(&g, &placed.covariance, &g).max(0.0);
            let mut open = placed.free.iter();
            let depends = |direction: &[f64; 6]| {
                let along = |by: f64| Change::Moved(moved(placed, &direction.map(|way| way * by)));
                libm::fabs(slope(OPEN_STEP, &along)) > OPEN
            };
            if is_contour && open.any(depends) {
                return None;
            }
        }
        let finite = [found, pixels, motion, lever, shared, own];
        finite.iter().all(|x| x.is_finite()).then_some(Propagated {
            found: Found {
                value: found,
                pixels,
                motion,
                lever,
                unknown: 0.0,
            },
            shared,
            own,
            rims,
        })
    }
}

/// A motion by so much along each of the components of the covariance: shifts in mm, and turns as
/// the way of a point at the part's radius.
fn moved(placed: &Placed, &[x, y, z, about_x, about_y, about_z]: &[f64; 6]) -> Motion {
    Motion::new(
        placed.motion.centre,
        Vector::new(x, y, z),
        Vector::new(about_x, about_y, about_z) * (1.0 / placed.radius),
    )
}
