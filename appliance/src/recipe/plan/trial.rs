//! Plans a recipe before it is used: whether it can be used on a head, and what it measures of
//! golden. The plan is dropped.
//!
//! Golden is also judged as a displaced part would be, as production would.

use super::inspect::{Found, Laps};
use super::{Plan, PlanError};
use crate::head::calibration::Calibration;
use crate::recipe::{Demands, FeatureView, Recipe, Refusal};
use crate::station::Inspection;
use crate::system::headway::Headway;
use algo::geometry::Vector;
use algo::inspect::{Drawing, Findings, Input, Maps, Motion, Signal};
use algo::phase::Trust;
use algo::pipeline::PhaseMap;
use algo::units::Modulation;
use std::sync::{Mutex, PoisonError};

/// One recipe is tried at a time: planning takes up to 31 bytes per pixel beside the recipe itself.
static ONE: Mutex<()> = Mutex::new(());

impl Plan {
    /// Plans a recipe on threads of its own, with the caller's priority, so that the computing
    /// threads are left to the measurement.
    ///
    /// # Errors
    /// As [`Plan::new`].
    pub fn try_out(recipe: Recipe, calibration: &Calibration) -> Result<(), PlanError> {
        alone(recipe, |recipe| {
            Self::new(recipe, calibration, false).map(drop)
        })
    }

    /// What the recipe measures of golden, that is, of a part that lies as taught and is seen
    /// without noise by the first of its sequences; σ is that of one measurement. `head` has the
    /// models that it was taught with. A `lenient` plan also has contours of which golden shows too
    /// little. On threads as [`Plan::try_out`].
    ///
    /// # Errors
    /// As [`Plan::again`].
    pub fn golden(
        recipe: Recipe,
        head: &Calibration,
        lenient: bool,
        headway: Headway<'_>,
    ) -> Result<Golden, PlanError> {
        alone(recipe, |recipe| golden(recipe, head, lenient, headway))
    }

    /// Whether production can be planned with a recipe, by every one of its sequences. `head` has the models that it
    /// was taught with. On threads as [`Plan::try_out`].
    ///
    /// # Errors
    /// As [`Plan::again`].
    pub fn check(
        recipe: Recipe,
        head: &Calibration,
        headway: Headway<'_>,
    ) -> Result<(), PlanError> {
        let join = |recipe| Plan::join(recipe, head, (false, None), headway);
        alone(recipe, join).map(drop)
    }
}

/// How golden is planned, by one of the sequences alone.
#[derive(Clone, Copy, Debug)]
pub(super) struct OfGolden {
    /// By which.
    pub sequence: usize,
    /// Whether contours are looked for of which golden shows too little.
    pub lenient: bool,
}

/// Golden, measured like a part.
#[derive(Debug)]
pub struct Golden {
    /// With the sequence that it was measured by, alone.
    plan: Plan,
    /// What was found.
    pub findings: Findings,
}

impl Golden {
    /// Golden judged as a part is, by a recipe that has other limits at most, and what became of
    /// the features that its gauges need.
    pub fn judged(&mut self, demands: Demands) -> (Inspection, Vec<FeatureView<'_>>) {
        self.plan.demands = demands;
        let plan = &self.plan;
        let found = Ok(self.findings.clone().into());
        let inspection = plan.judged((0, &[]), found, &mut Laps::now());
        let strips = plan.strips();
        let drawing = Drawing::new(plan.production(), &strips);
        let seen = plan.demands.seen(&inspection, &drawing);
        drop(strips);
        (inspection, seen)
    }
}

/// Does something with a recipe on threads of its own, one recipe at a time.
fn alone<T: Send>(
    recipe: Recipe,
    work: impl FnOnce(Recipe) -> Result<T, PlanError> + Send,
) -> Result<T, PlanError> {
    let number = recipe.id.number;
    let _alone = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    let threads = rayon::ThreadPoolBuilder::new().build();
    let threads = threads.map_err(|error| PlanError::Unfit {
        number,
        reason: format!("it cannot be tried out: {error}: end other programs").into(),
    })?;
    threads.install(|| work(recipe))
}

fn golden(
    recipe: Recipe,
    head: &Calibration,
    lenient: bool,
    headway: Headway<'_>,
) -> Result<Golden, PlanError> {
    let number = recipe.id.number;
    let unfit = |reason: Refusal| PlanError::Unfit { number, reason };
    // Two frames compare pictures, and golden's is by the sequence behind them.
    let planned = recipe.sequences.iter().position(|of| !of.is_pair());
    let sequence = planned.ok_or_else(|| unfit("it has no sequence".into()))?;
    let light = recipe.light(sequence);
    let only = OfGolden { sequence, lenient };
    let plan = Plan::join(recipe, head, (false, Some(only)), headway.part(0.0, 0.6))?;
    let production = plan.production();
    let (map, decoder) = (production.map(), production.decoder());
    let surface = production.cubics().surface();
    let mut phases = PhaseMap::new(surface.width, map.len() / surface.width.max(1));
    let least = decoder.least_modulation().counts(decoder.full_scale());
    let lit = |light: Modulation| light.counts(decoder.full_scale()) >= least;
    for (at, &phase) in map.iter().enumerate() {
        phases.trust[at] = match (phase.is_known(), lit(light[at])) {
            (false, _) => Trust::Unexpected,
            (true, false) => Trust::Dark,
            (true, true) => {
                (phases.phase[at], phases.modulation[at]) = (phase, light[at]);
                Trust::Resolved
            }
        };
    }
    headway.done(0.65);
    let input = Input::Phases(&phases);
    let mut strips = plan.strips();
    let placed = production.place(input, &mut strips);
    let found = placed
        .and_then(|placed| {
            headway.done(0.8);
            let input = (input, Signal::Golden);
            production.inspect_placed(input, &mut strips, placed, Maps::default())
        })
        .map_err(|error| unfit(error.into()))?;
    drop(strips);
    Ok(Golden {
        plan,
        findings: found,
    })
}

impl Plan {
    /// Judges the part as taught after a motion, by one sequence after the other as production
    /// does. `light` is golden's modulation by each of the plan's sequences; other seeds give other
    /// noise. `None` for sequences of two frames.
    pub(in crate::recipe) fn inspect_rendered(
        &self,
        motion: &Motion,
        light: &[Vec<Modulation>],
        seed: u64,
    ) -> Option<Inspection> {
        for (sequence, run) in self.runs.iter().enumerate() {
            if run.pair.is_some() {
                return None;
            }
            let phases = run
                .production
                .rendered(motion, &light[sequence], Some(seed));
            let mut laps = Laps::now();
            let mut strips = self.strips();
            let input = (Input::Phases(&phases), Signal::None);
            let placed = run.production.place_rendered(&phases, &mut strips, motion);
            let findings = placed.and_then(|placed| {
                run.production
                    .inspect_placed(input, &mut strips, placed, Maps::default())
            });
            drop(strips);
            let found = findings.map(Found::from).map_err(Refusal::from);
            let inspection = self.judged((sequence, &[]), found, &mut laps);
            if inspection.step_up.is_none() {
                return Some(inspection);
            }
        }
        None
    }

    /// Corners of the box around the part as taught; none if parts are not aligned.
    pub(in crate::recipe) fn corners(&self) -> &[Vector] {
        self.production().corners()
    }
}
