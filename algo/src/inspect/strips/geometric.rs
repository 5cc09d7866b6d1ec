//! Stage 5, gauge: contours of features, and the readings of gauges of geometry.

use super::contours::{ContourFit, FoundFeature, REACH_MM, Signal};
use super::fits::Fit;
use super::gauges::{Gauge, MAX_FEATURES};
use super::plan::Production;
use super::pose::PoseField;
use super::strip::Strips;
use super::uncertainty::Made;
use crate::inspect::align::Placed;
use crate::inspect::contour::State;
use crate::inspect::contour::shape::Outline;
use crate::inspect::feature::Geometry;
use crate::inspect::gauge::{
    Characteristic, MAX_DATUMS, MAX_PLACES, OfRim, Propagated, Reading, Sensitive,
};
use crate::pipeline::for_each;
use alloc::vec::Vec;

impl Production {
    /// The planes and contours that gauges need.
    pub(super) fn features(&self, strips: &Strips) -> heapless::Vec<FoundFeature, MAX_FEATURES> {
        let own = |fit: &&Fit| !strips.contours.iter().any(|of| of.is_of(&[fit.feature]));
        let planes = strips.fits.iter().filter(own).map(|fit| {
            let geometry = fit.geometry();
            FoundFeature {
                feature: fit.feature,
                state: match geometry {
                    Some(_) => State::Found,
                    None => State::Unseen,
                },
                found: fit.share(&self.gauges.patches[fit.patch]),
                rim: None,
                lost: None,
                geometry,
            }
        });
        let contours = strips.contours.iter().filter_map(|of| of.of.clone());
        let sections = strips.sections.iter().filter_map(|of| of.of.clone());
        planes.chain(contours).chain(sections).collect()
    }

    /// Finds the contours of features in their planes, one per task; those that were not found once
    /// more where the others say that they are.
    pub(super) fn find_contours(&self, strips: &mut Strips, light: Signal<'_>) {
        let Some(contours) = &self.contours else {
            return;
        };
        let Strips {
            fits,
            pose,
            contours: found,
            ..
        } = strips;
        let (fits, placed) = (&fits[..], pose.placed.as_ref());
        let work: Vec<_> = found.iter_mut().zip(&contours.all).collect();
        let reach_mm = self.contour_reach_mm(placed);
        for_each(work, |_, (found, expected)| {
            let plane = &fits[expected.plane];
            let expected = (contours, expected);
            found.find(expected, &self.golden, plane, (placed, reach_mm), light);
        });
    }

    /// How far from its place on a part that lies so a contour may be, mm: a part is known to lie
    /// within the placement tolerance where nothing tells more.
    pub(super) fn contour_reach_mm(&self, placed: Option<&Placed>) -> f64 {
        let is_open = placed.is_some_and(|placed| !placed.free.is_empty());
        REACH_MM + if is_open { self.tolerance_mm } else { 0.0 }
    }

    /// Finds the joints of sections in the points of all strips, one per task.
    pub(super) fn find_sections(&self, strips: &mut Strips) {
        let (found, strips) = (&mut strips.sections, &strips.strips);
        let work: Vec<_> = found.iter_mut().zip(&self.sections.all).collect();
        for_each(work, |at, (found, expected)| {
            let points = strips.iter().map(|strip| &strip.sections.all[at][..]);
            found.find(expected, points, &self.budget);
        });
    }

    /// The reading of a gauge of the geometry of features; `noisier` is the ratio of σ_z to that as
    /// taught.
    pub(super) fn of_geometry(
        &self,
        gauge: usize,
        noisier: f64,
        pose: &PoseField,
        (fits, contours): (&[Fit], &[ContourFit]),
    ) -> Option<Reading> {
        let budget = &self.budget;
        let Gauge { of, datum, measure } = &self.gauges.list[gauge];
        let of: heapless::Vec<_, MAX_PLACES> = sensitive(of, fits, contours)?;
        let datum: heapless::Vec<_, MAX_DATUMS> = sensitive(datum, fits, contours)?;
        let Gauge {
            of: places,
            datum: system,
            ..
        } = &self.gauges.list[gauge];
        let taught: heapless::Vec<_, MAX_PLACES> = self.taught(places).unwrap_or_default();
        let before: heapless::Vec<_, MAX_DATUMS> = self.taught(system).unwrap_or_default();
        let value = Characteristic {
            kind: measure.kind(),
            of: &of,
            datum: &datum,
            taught: [&taught, &before],
        };
        let placed = pose.placed.as_ref();
        let propagated = value.propagate(placed, budget.calibration.length)?;
        let Propagated {
            found,
            shared,
            own,
            rims,
        } = propagated;
        let of = budget.reading_of(found, Made::OfHeights, (noisier, 1.0), placed);
        // Where golden says where a plane's point lies, golden's error is in the value: as much as it would be
        // if the point were found from this part.
        let has_plane = value.of.iter().any(|of| matches!(of, Sensitive::Plane(_)));
        let golden = match has_plane {
            false => 0.0,
            true => {
                let alone = Characteristic {
                    taught: [&[]; 2],
                    ..value
                };
                let alone = alone.propagate(placed, budget.calibration.length)?.found;
                let error = budget.reading_of(alone, Made::OfDeviations, (noisier, 1.0), placed);
                if alone.pixels == found.pixels {
                    0.0
                } else {
                    error.compared
                }
            }
        };
        let of = Reading {
            systematic: libm::hypot(of.systematic, golden),
            compared: libm::hypot(of.compared, golden),
            ..of
        };
        // Where golden was measured its own inputs were others, too.
        let with = |error: f64, inputs: f64| libm::sqrt(error * error + inputs);
        Some(Reading {
            systematic: with(of.systematic, shared + own),
            compared: with(of.compared, 2.0 * own),
            rims: libm::sqrt(rims),
            ..of
        })
    }

    /// The geometry of features as taught, of contours where they are and which way they go; `None` where
    /// it is not known.
    fn taught<const N: usize>(&self, features: &[usize]) -> Option<heapless::Vec<Geometry, N>> {
        let geometry = |at: &usize| {
            let contours = self.contours.as_ref();
            let contour = contours.and_then(|all| {
                let expected = all.all.iter().find(|expected| expected.feature == *at)?;
                let frame = all.frame(expected, &self.planes[expected.plane])?;
                let Outline { shape, parameters } = &expected.outline;
                let contour = (expected.kind, &**shape, parameters);
                Some(frame.geometry(contour, frame.normal(), |mark| mark))
            });
            let plane = || {
                self.planes
                    .iter()
                    .find(|fit| fit.feature == *at)?
                    .geometry()
            };
            contour.or_else(plane)
        };
        features.iter().map(geometry).collect()
    }

    /// The reading of a gauge of the points of a contour.
    pub(super) fn of_rim(&self, gauge: usize, contours: &[ContourFit]) -> Option<Reading> {
        let Gauge { of, measure, .. } = &self.gauges.list[gauge];
        let found = contours.iter().find(|contour| contour.is_of(of))?;
        let kind = measure.kind();
        let of = match (&found.rim, found.is_absent()) {
            (Some(rim), _) => kind.of_rim(rim)?,
            (None, true) => OfRim {
                value: kind.of_absent()?,
                variance: 0.0,
                unknown: 0.0,
            },
            (None, false) => return None,
        };
        Some(Reading {
            value: of.value,
            sigma: Some(libm::sqrt(of.variance)),
            expected: None,
            systematic: of.unknown,
            compared: 0.0,
            rims: 0.0,
            square: None,
        })
    }
}

/// What values of these features depend on; `None` where one was not found.
fn sensitive<'a, const N: usize>(
    features: &[usize],
    fits: &'a [Fit],
    contours: &'a [ContourFit],
) -> Option<heapless::Vec<Sensitive<'a>, N>> {
    let sensitive = |at: &usize| {
        if let Some(contour) = contours.iter().find(|contour| contour.is_of(&[*at])) {
            return contour.sensitive(fits);
        }
        let fit = fits.iter().find(|fit| fit.feature == *at)?;
        Some(Sensitive::Plane(fit.sensitive()?))
    };
    features.iter().map(sensitive).collect()
}
