//! The contours of a part as taught: where each is expected, and what light its face has.

use super::face::Face;
use super::light::{GoldenSignal, Levels, Signal};
use super::trace::{Traced, ground_below, trace};
use crate::geometry::Vector;
use crate::inspect::contour::shape::Outline;
use crate::inspect::contour::{Fringes, PlaneSpot, PlaneView, Setup, State, find};
use crate::inspect::feature::{Feature, FeatureKind, PlaneFrame};
use crate::inspect::strips::accumulate::Unmeasurable;
use crate::inspect::strips::golden::{Golden, Near};
use crate::inspect::strips::readings::planes::PlaneFit;
use crate::math::complex::Complex;
use alloc::vec::Vec;

/// How far a contour may lie from its place on a part whose motion is known, mm.
pub const REACH_MM: f64 = 0.5;
/// The same on golden, where only its outline is known, px and mm.
const FIRST_REACH_PX: f64 = 3.0;
const FIRST_REACH_MM: f64 = 0.75;
/// A floor within this distance of the part's ground is that ground, mm.
const NEAR_MM: f64 = 0.3;

/// The contours that gauges are of.
#[derive(Clone, Debug)]
pub struct Contours {
    pub all: Vec<ExpectedContour>,
    pub levels: Levels,
    pub signal: GoldenSignal,
    /// σ of a sample, counts.
    noise: f64,
    /// The least modulation that is trusted, counts.
    least: f64,
}

/// A contour as it is expected.
#[derive(Clone, Debug)]
pub struct ExpectedContour {
    /// Which feature.
    pub feature: usize,
    /// What it is.
    pub kind: FeatureKind,
    /// Which of the planes that are fitted has its face.
    pub plane: usize,
    /// Its shape, in the frame of its plane.
    pub outline: Outline,
    /// x and y of the origin of that frame, as taught.
    origin: (f64, f64),
    /// The modulation of its face in golden's signal, counts.
    modulation: f64,
    /// Radius of its rim, mm.
    pub rim: f64,
    thickness: Option<f64>,
    floor: Option<f64>,
    /// Whether its floor is what the part lies on, which stays where the part is moved.
    is_on_ground: bool,
    deepest: f64,
}

/// What light and sequence are known by.
#[derive(Clone, Debug)]
pub struct Known {
    pub levels: Levels,
    pub signal: GoldenSignal,
    pub noise: f64,
    pub least: f64,
}

impl Contours {
    /// The contours of some features, each with the plane of its face among the fitted ones.
    ///
    /// # Errors
    /// If golden has no such contour in a feature's region, or its sequence has no quadrature.
    pub fn new(
        wanted: impl Iterator<Item = (usize, usize)>,
        (features, planes): (&[Feature], &[PlaneFit]),
        golden: &Golden,
        known: Known,
    ) -> Result<Self, Unmeasurable> {
        let Known {
            levels,
            signal,
            noise,
            least,
        } = known;
        let mut contours = Self {
            all: Vec::new(),
            levels,
            signal,
            noise,
            least,
        };
        for (feature, plane) in wanted {
            if !contours.levels.demodulate() {
                return Err(Unmeasurable::NoQuadrature { feature });
            }
            let taught = contours.taught(&features[feature], &planes[plane], golden);
            let expected = taught.ok_or(Unmeasurable::NoContour { feature })?;
            contours.all.push(ExpectedContour {
                feature,
                plane,
                ..expected
            });
        }
        Ok(contours)
    }

    fn taught(&self, of: &Feature, plane: &PlaneFit, golden: &Golden) -> Option<ExpectedContour> {
        let geometry = plane.geometry()?;
        let (normal, point) = (geometry.normal, geometry.point);
        // About the region's middle first, then about the contour's.
        let view = |origin: Vector| Face {
            triangulator: &golden.triangulator,
            size: golden.size(),
            frame: PlaneFrame::new(origin, normal),
            levels: &self.levels,
            golden: &self.signal,
            light: Signal::Golden,
            near: Near::default(),
        };
        let about = view(point);
        let (x, y) = trace(of.kind, &of.region, golden, &about)?.outline.middle();
        let origin = about.frame.point(x, y);
        let face = view(origin);
        let Traced {
            outline,
            face: places,
            floor,
        } = trace(of.kind, &of.region, golden, &face)?;
        let modulation = self.modulation(&face, &places)?;
        let range = golden.triangulator.range();
        let mut expected = ExpectedContour {
            feature: 0,
            kind: of.kind,
            plane: 0,
            outline,
            origin: (origin.x, origin.y),
            modulation,
            rim: of.rim,
            thickness: plane.thickness,
            floor,
            is_on_ground: floor
                .zip(ground_below(golden, &face.frame))
                .is_some_and(|(floor, ground)| libm::fabs(floor - ground) < NEAR_MM),
            deepest: (origin.z - range.low).max(0.0),
        };
        let pixel = face.spot_size(0.0, 0.0)?;
        let reach_mm = FIRST_REACH_MM.max(FIRST_REACH_PX * pixel);
        let setup = self.setup(&expected, &face, golden, reach_mm)?;
        let Outline { shape, parameters } = &expected.outline;
        let found = find(&**shape, parameters, &face, &setup);
        if found.state != State::Found && !self.signal.lenient {
            return None;
        }
        expected.outline = expected.outline.with(&found.parameters);
        Some(expected)
    }

    /// The modulation of a face that these places see, counts: the middle of the light that is in
    /// phase with it.
    fn modulation(&self, face: &Face<'_>, places: &[usize]) -> Option<f64> {
        let width = face.size().0;
        let light = places.iter().filter_map(|&place| {
            let (u, v) = (place % width, place / width);
            let PlaneSpot { phase, .. } = face.spot(u as f64, v as f64)?;
            let back = Complex::turned(-self.signal.ratio * phase);
            Some((face.signal((u, v), 0)? * back).re)
        });
        let mut light: Vec<f64> = light.collect();
        light.sort_unstable_by(f64::total_cmp);
        light.get(light.len() / 2).copied()
    }

    /// The frame of a contour's plane, whose parameters were measured, in the frame as taught.
    pub fn frame(&self, of: &ExpectedContour, plane: &PlaneFit) -> Option<PlaneFrame> {
        let geometry = plane.geometry()?;
        let (normal, point) = (geometry.normal, geometry.point);
        let (x, y) = of.origin;
        let below = normal.x * (x - point.x) + normal.y * (y - point.y);
        let origin = Vector::new(x, y, point.z - below / normal.z);
        Some(PlaneFrame::new(origin, normal))
    }

    /// What is known of light, material and camera where a contour's plane lies as in `face`.
    pub fn setup(
        &self,
        of: &ExpectedContour,
        face: &Face<'_>,
        golden: &Golden,
        reach_mm: f64,
    ) -> Option<Setup> {
        let device = |centre: Vector| face.frame.coordinates(centre);
        let own: Vec<(f64, usize)> = self.levels.fringes().collect();
        let (levels, noise): (Vec<(f64, usize)>, f64) = match face.light {
            // As much light as all levels have together.
            Signal::Golden => {
                let all: usize = own.iter().map(|(_, shifts)| shifts).sum();
                let share = self.signal.shifts as f64 / all.max(1) as f64;
                let one = (self.signal.ratio, self.signal.shifts);
                (Vec::from([one]), self.noise * libm::sqrt(share))
            }
            _ => (own, self.noise),
        };
        let taught = match face.light {
            Signal::Golden => of.modulation,
            _ => of.modulation * self.signal.brighter,
        };
        let levels = levels.into_iter().map(|(ratio, shifts)| Fringes {
            ratio,
            shifts,
            taught,
        });
        Some(Setup {
            camera: device(face.triangulator.camera().centre()),
            projector: device(face.triangulator.projector().centre()),
            turns_per_mm: face.turns_per_mm(0.0, 0.0)?,
            levels: levels.collect(),
            noise,
            least: self.least,
            thickness: of.thickness,
            floor: match of.is_on_ground {
                true => ground_below(golden, &face.frame).map(|below| below.max(0.0)),
                false => of.floor,
            },
            deepest: of.deepest,
            reach: reach_mm,
        })
    }
}
