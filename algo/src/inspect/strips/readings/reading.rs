//! Stage 5, gauge: the reading of one gauge, and why it has none.

use super::contours::{ContourFit, FoundFeature};
use super::evaluation::{CellBuffers, Evaluation, NoiseOf, PartFeatures};
use super::findings::Missing;
use super::planes::PlaneFit;
use super::uncertainty::Taken;
use crate::inspect::contour::State;
use crate::inspect::contour::shape::Outline;
use crate::inspect::feature::{Geometry, cells};
use crate::inspect::gauge::{
    Basis, Characteristic, Evidence, Facts, MAX_DATUMS, MAX_PLACES, OfRim, Propagated, Reading,
    Sensitive,
};
use crate::inspect::strips::accumulate::squares::extreme::Extreme;
use crate::inspect::strips::accumulate::squares::rivals::rivals;
use crate::inspect::strips::accumulate::{Gauge, StripSums, add_up, coverage};
use crate::inspect::strips::align::PoseField;

impl Evaluation<'_> {
    /// The reading of a gauge of a part that was measured so.
    pub fn reading(
        &self,
        gauge: usize,
        taken: Taken,
        pose: &PoseField,
        sums: &mut [StripSums],
        noise_of: NoiseOf<'_>,
        found: &mut PartFeatures,
    ) -> Option<Reading> {
        let PartFeatures {
            cells,
            fits,
            contours,
            joints,
        } = found;
        match self.gauges.list[gauge].measure.facts().basis {
            Basis::Pixels => {
                let pixels = self.gauges.region(pose, gauge)?.len();
                let (mut covered, mut variance) = (0, 0);
                for strip in sums {
                    covered += strip.counts.covered[gauge];
                    variance += strip.counts.variance[gauge];
                }
                (pixels > 0).then(|| Reading {
                    value: covered as f64 / pixels as f64,
                    sigma: Some(coverage::sigma(variance, pixels)),
                    ..Reading::default()
                })
            }
            Basis::Squares(_) => {
                let mut largest: Option<Reading> = None;
                let squares = self.gauges.squares.iter().enumerate();
                for (at, squares) in squares.filter(|(_, squares)| squares.gauge == gauge) {
                    for below in 1..sums.len() {
                        if let [above, below] = &mut sums[below - 1..=below] {
                            below.squares.extremes[at].join(&mut above.squares.extremes[at]);
                        }
                    }
                    let found = rivals(sums.iter().map(|strip| &strip.squares.extremes[at]));
                    let found = (&found[..], squares.side);
                    let noise_of = |square: &Extreme| noise_of(square, squares.side);
                    let (placed, gauge) = (pose.placed.as_ref(), (gauge, taken));
                    let next = self.plan.budget.deviation(found, noise_of, placed, gauge);
                    let less = |next: &Reading| {
                        largest.is_some_and(|of| libm::fabs(next.value) < libm::fabs(of.value))
                    };
                    largest = next.filter(|next| !less(next)).or(largest);
                }
                largest
            }
            Basis::Motion(component) => {
                let (value, sigma) = pose.placed.as_ref()?.component(component as usize)?;
                let budget = &self.plan.budget;
                let systematic = libm::hypot(
                    sigma
                        * libm::sqrt(
                            budget.golden_variance(taken.noisier) / budget.spot_variance(),
                        ),
                    value * budget.calibration.length,
                );
                Some(Reading {
                    value,
                    sigma: Some(sigma),
                    systematic,
                    // A motion is what the part differs by from golden.
                    compared: systematic,
                    ..Reading::default()
                })
            }
            Basis::Cells(_) | Basis::Region => self.of_cells(gauge, taken, pose, sums, cells),
            Basis::Geometry => self.of_geometry(gauge, taken, pose, (fits, contours)),
            Basis::Rim => self.of_rim(gauge, contours),
            Basis::Section => {
                let Gauge { of, measure, .. } = &self.gauges.list[gauge];
                let feature = *of.first()?;
                let found = joints.iter().find(|joint| joint.is_of(feature))?;
                found.reading(
                    measure.kind(),
                    self.plan.budget.golden_variance(taken.noisier),
                )
            }
        }
    }

    /// The reading of a gauge of cells.
    fn of_cells(
        &self,
        gauge: usize,
        taken: Taken,
        pose: &PoseField,
        sums: &[StripSums],
        buffers: &mut CellBuffers,
    ) -> Option<Reading> {
        let measure = &self.gauges.list[gauge].measure;
        let Facts {
            basis, compares, ..
        } = measure.facts();
        let side = basis.cell_side()?;
        let patches = &self.gauges.patches_of[gauge];
        let (&first, &last) = (patches.first()?, patches.last()?);
        buffers.cells.clear();
        buffers.weights.clear();
        let [patch, other] = [first, last].map(|at| &self.gauges.patches[at]);
        self.gather(first, side, sums, buffers);
        let count = buffers.cells.len();
        if patches.len() > 1 {
            // Both regions' cells behind each other: the motion moves them together.
            self.gather(last, side, sums, buffers);
        }
        let CellBuffers { cells, weights, .. } = buffers;
        if compares {
            for cell in &mut *cells {
                cell.deviation *= cell.taught.normal;
                cell.taught = cell.taught.along_normal();
            }
        }
        // A region without cells as a square of its area.
        let smoothed = self.plan.budget.square_variance(match side {
            0 => patch.pixels().isqrt() as usize,
            side => side,
        });
        let noise = taken.noisier * taken.noisier * smoothed;
        let [pixel, from] = [patch, other].map(|of| of.pixel_variance(compares) * noise);
        let placed = pose.placed.as_ref();
        let mut found = measure.kind().find(Evidence {
            all: cells,
            count,
            columns: patch.grid.columns(),
            sigma: libm::sqrt(pixel) / side.max(1) as f64,
            variances: [pixel, from],
            placed,
            room: weights,
        })?;
        let budget = &self.plan.budget;
        if compares {
            found.pixels *= budget.cells_together(side);
        }
        let reading = budget.reading_of(found, (taken, smoothed), placed);
        Some(match compares {
            true => Reading {
                systematic: reading.compared,
                ..reading
            },
            false => reading,
        })
    }

    /// The reading of a gauge of the geometry of features.
    fn of_geometry(
        &self,
        gauge: usize,
        taken: Taken,
        pose: &PoseField,
        (fits, contours): (&[PlaneFit], &[ContourFit]),
    ) -> Option<Reading> {
        let budget = &self.plan.budget;
        let gauge = &self.gauges.list[gauge];
        let of: heapless::Vec<_, MAX_PLACES> = sensitive(&gauge.of, fits, contours)?;
        let datum: heapless::Vec<_, MAX_DATUMS> = sensitive(&gauge.datum, fits, contours)?;
        let taught: heapless::Vec<_, MAX_PLACES> = self.taught(&gauge.of).unwrap_or_default();
        let before: heapless::Vec<_, MAX_DATUMS> = self.taught(&gauge.datum).unwrap_or_default();
        let value = Characteristic {
            kind: gauge.measure.kind(),
            of: &of,
            datum: &datum,
            taught: [&taught, &before],
        };
        let placed = pose.placed.as_ref();
        let propagated = |value: Characteristic<'_>| {
            let propagated = value.propagate(placed, budget.calibration.length)?;
            let reading = budget.reading_of(propagated.found, (taken, 1.0), placed);
            Some((propagated, reading))
        };
        let (
            Propagated {
                found,
                shared,
                own,
                rims,
            },
            of,
        ) = propagated(value)?;
        // Where golden says where a plane's point lies, golden's error is in the value: as much as it would be
        // if the point were found from this part.
        let has_plane = value.of.iter().any(|of| matches!(of, Sensitive::Plane(_)));
        let mut golden = 0.0;
        if has_plane {
            let taught = [&[][..]; 2];
            let (alone, reading) = propagated(Characteristic { taught, ..value })?;
            if alone.found.pixels != found.pixels {
                golden = reading.compared;
            }
        }
        let with = |error: f64, inputs: f64| {
            let error = libm::hypot(error, golden);
            libm::sqrt(error * error + inputs)
        };
        Some(Reading {
            systematic: with(of.systematic, shared + own),
            // Where golden was measured its own inputs were others, too.
            compared: with(of.compared, 2.0 * own),
            rims: libm::sqrt(rims),
            ..of
        })
    }

    /// The geometry of features as taught, of contours where they are and which way they go; `None` where
    /// it is not known.
    fn taught<const N: usize>(&self, features: &[usize]) -> Option<heapless::Vec<Geometry, N>> {
        let geometry = |at: &usize| {
            let contours = self.plan.contours.as_ref();
            let contour = contours.and_then(|all| {
                let expected = all.all.iter().find(|expected| expected.feature == *at)?;
                let frame = all.frame(expected, &self.plan.planes[expected.plane])?;
                let Outline { shape, parameters } = &expected.outline;
                let contour = (expected.kind, &**shape, parameters);
                Some(frame.geometry(contour, frame.normal(), |mark| mark))
            });
            let plane = || {
                self.plan
                    .planes
                    .iter()
                    .find(|fit| fit.feature == *at)?
                    .geometry()
            };
            contour.or_else(plane)
        };
        features.iter().map(geometry).collect()
    }

    /// The reading of a gauge of the points of a contour.
    fn of_rim(&self, gauge: usize, contours: &[ContourFit]) -> Option<Reading> {
        let Gauge { of, measure, .. } = &self.gauges.list[gauge];
        let feature = *of.first()?;
        let found = contours.iter().find(|contour| contour.is_of(feature))?;
        let kind = measure.kind();
        let of = match (&found.rim, found.is_absent()) {
            (Some(rim), _) => kind.of_rim(rim)?,
            (None, true) => OfRim {
                value: kind.of_absent()?,
                ..OfRim::default()
            },
            (None, false) => return None,
        };
        Some(Reading {
            value: of.value,
            sigma: Some(libm::sqrt(of.variance)),
            systematic: of.unknown,
            ..Reading::default()
        })
    }

    /// Why a gauge has no value, where these features were found.
    pub fn missing(&self, gauge: usize, features: &[FoundFeature], sums: &[StripSums]) -> Missing {
        let of = &self.gauges.list[gauge];
        let own = &self.gauges.patches_of[gauge];
        if !own.is_empty() {
            let mut shares = [1.0; MAX_PLACES];
            for (share, &patch) in shares.iter_mut().zip(own) {
                let had = self.gauges.patches[patch].pixels();
                let cells = sums.iter().flat_map(|strip| &strip.counts.cells[patch]);
                let has: i64 = cells.map(|sum| sum.count).sum();
                *share = has as f64 / f64::from(had.max(1));
            }
            return Missing::Cells(shares);
        }
        let needed = |feature: &FoundFeature| {
            of.of
                .iter()
                .chain(&of.datum)
                .any(|&at| at == feature.feature)
        };
        let lost = |feature: &&FoundFeature| needed(feature) && feature.state != State::Found;
        // What is absent makes a part bad only if nothing else is unseen.
        let mut all = features.iter().filter(lost);
        let first = all.clone().find(|feature| feature.state == State::Unseen);
        match first.or(all.next()) {
            Some(feature) => Missing::Feature(feature.feature),
            None if of.measure.facts().basis == Basis::Geometry => Missing::Open,
            None => Missing::Nothing,
        }
    }

    /// Appends the cells of a patch.
    fn gather(&self, at: usize, side: usize, strips: &[StripSums], buffers: &mut CellBuffers) {
        let patch = &self.gauges.patches[at];
        let CellBuffers {
            sums, cells: out, ..
        } = buffers;
        add_up(strips, at, patch.grid.len(), sums);
        let least = (side > 0).then(|| patch.grid.least());
        cells(sums, &patch.taught, least, out);
    }
}

/// What values of these features depend on; `None` where one was not found.
fn sensitive<'a, const N: usize>(
    features: &[usize],
    fits: &'a [PlaneFit],
    contours: &'a [ContourFit],
) -> Option<heapless::Vec<Sensitive<'a>, N>> {
    let sensitive = |at: &usize| {
        if let Some(contour) = contours.iter().find(|contour| contour.is_of(*at)) {
            return contour.sensitive(fits);
        }
        let fit = fits.iter().find(|fit| fit.feature == *at)?;
        Some(Sensitive::Plane(fit.sensitive()?))
    };
    features.iter().map(sensitive).collect()
}
