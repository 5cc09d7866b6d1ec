//! The measuring task carries out a step.

use super::{OpenHead, PICTURES, StepRequest};
use crate::config::{Backend, HeadConfig};
use crate::error::Result;
use crate::head::calibration::file::CalibrationFile;
use crate::head::calibration::place::CalibrationPlace;
use crate::head::commission::{Choices, Commissioning, PLANE, PoseAction, Subject, TIMING};
use crate::head::exposing::Exposing;
use crate::head::live::{Picture, outlines};
use crate::production::{SIGN_OF_LIFE, Worker, active};
use crate::recipe::plan::Plan;
use crate::station::{Event, JobId};
use crate::storage::folder::write_whole;
use hal::frame::Frame;
use hal::head::Head;
use std::fs;
use std::panic::resume_unwind;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

impl Worker {
    /// Carries out the step that waits. The plan stays if the calibration does.
    pub(in crate::production) fn commission(&mut self, job: JobId) {
        if let Some(asked) = self.commission.take() {
            let before = self.opened.calibration.fingerprint();
            self.carry_out(job, &asked);
            let same =
                self.opened.problem.is_none() && self.opened.calibration.fingerprint() == before;
            let otherwise = |plan: &Plan| {
                let set = plan.conditions().set_otherwise(&self.opened.calibration);
                set.map(|[taught, now]| {
                    format!("the camera is set to {now}, and the active recipe was taught with {taught}: teach it again, or load another")
                })
            };
            let words = match same {
                true => self.plan.as_deref().and_then(otherwise),
                false => Some("the head has another calibration: teach the recipes anew".into()),
            };
            if let Some(words) = words
                && self.plan.take().is_some()
            {
                self.progress.warn(&words);
            }
            // Steps show patterns of their own.
            self.restore();
            self.progress.clear();
        }
        self.commission.ended();
        let recipe = self.plan.as_deref().map(active);
        self.station.event(Event::Commissioned { job, recipe });
    }

    fn carry_out(&mut self, job: JobId, asked: &StepRequest) {
        let mut kept = self.commission.kept();
        let head = self.opened.calibration.sizes();
        let name = asked.step.name;
        if kept.head != head {
            // What other devices have shown is of no use here; exposure and gain are those of this
            // camera already.
            kept = Commissioning::of(head, kept.exposing);
        }
        let before = (self.config.clone(), self.opened.exposing(&self.config));
        if let Err(failure) = self.set_exposing(asked) {
            kept.steps.insert(name.into(), failure.into());
            return self.keep(kept);
        }
        let timing = self.opened.head.timing();
        let (white, ended) = self.step(job, asked, &mut kept);
        let passed = !ended && kept.steps.get(name).is_some_and(|outcome| outcome.passed);
        if let Some((exposing, keep)) = asked.exposing {
            match passed {
                true if keep => keep_exposing(&mut kept, exposing),
                true => {}
                false => self.expose_again(before),
            }
        }
        if ended {
            // What it has found so far is not kept.
            self.opened.head.set_timing(timing);
            self.tell_head();
            return self.progress.log(&format!("the step {name} was ended"));
        }
        if self.opened.problem.is_none() {
            // The calibration in use stays so until another one is complete.
            self.opened.head.set_timing(timing);
        }
        if let Some(PoseAction::Pose(board, number)) = asked.poses {
            let pose = kept.poses.get(&number);
            let corners = pose.map_or(&[][..], |pose| &pose.corners);
            let marked: Vec<[f64; 2]> =
                corners.iter().flatten().map(|[u, v, _]| [*u, *v]).collect();
            if let Some(white) = &white {
                self.keep_picture(number, white, &marked);
            }
            self.progress.log(&format!(
                "pose {number}: {} of {} corners",
                marked.len(),
                board.columns * board.rows
            ));
        }
        self.keep(kept);
        if passed && name == PLANE {
            self.opened.adopt(&self.config);
        }
        self.tell_condition();
    }

    /// Runs the step on the head. Returns the white frame of a pose, and whether a stop, the page
    /// or the PLC has ended the step.
    fn step(
        &mut self,
        job: JobId,
        asked: &StepRequest,
        kept: &mut Commissioning,
    ) -> (Option<Frame>, bool) {
        let before = self.stored();
        let (station, pulse, bar) = (&self.station, &self.pulse, &self.progress);
        let commission = &self.commission;
        let progress = move |share: f64, words: &str| {
            pulse.beat();
            bar.tell(share, words);
            commission.tell(share, words);
            station.event(Event::Progress {
                job,
                fraction: share as f32,
                words: words.into(),
            });
        };
        progress(0.0, "beginning");
        let opened = &mut self.opened;
        let mut calibration = opened.calibration.clone();
        calibration.exposing = Some(opened.exposing(&self.config));
        let calibrated = opened.problem.is_none();
        let exact = opened
            .stage
            .as_ref()
            .is_some_and(|stage| stage.scenario().calibrated);
        let place = self.config.calibration.as_deref().unwrap_or(Path::new(""));
        let (pool, computing) = (&self.pool, &self.computing);
        let run = |head: &mut Head| {
            let mut subject = Subject {
                exact,
                calibrated: calibrated || kept.measured.is_some(),
                head,
                calibration: &mut calibration,
                before,
                place,
                poses: asked.poses,
                choices: Choices::default(),
                progress: &progress,
                white: None,
                stored: None,
                notes: Vec::new(),
            };
            let mut work = || pool.install(|| asked.step.run(&mut subject, kept));
            match asked.poses {
                // It computes for long, without a device and without telling how far it is.
                Some(PoseAction::Solve(_)) => computing.on(|| {
                    thread::scope(|scope| {
                        let solving = scope.spawn(work);
                        while !solving.is_finished() {
                            progress(0.1, "adjusting the models");
                            thread::sleep(SIGN_OF_LIFE);
                        }
                        solving.join().unwrap_or_else(|panic| resume_unwind(panic));
                    });
                }),
                _ => work(),
            }
            subject.white
        };
        let ended = Arc::new(AtomicBool::new(false));
        let (aborts, refused) = (self.aborts.clone(), ended.clone());
        let go_on = move || {
            let ends = aborts.has(job);
            refused.fetch_or(ends, Ordering::Relaxed);
            !ends
        };
        let white = opened.head.aside(0, Arc::new(go_on), run);
        (white, ended.load(Ordering::Relaxed))
    }

    /// The stored calibration, if it is of this head.
    fn stored(&self) -> Option<CalibrationFile> {
        let place = self.config.calibration.as_deref()?;
        let file = CalibrationPlace::at(place).load().ok()??.file;
        (file.sizes() == self.opened.calibration.sizes()).then_some(file)
    }

    /// Sets exposure and gain, if the step asks for it.
    fn set_exposing(&mut self, asked: &StepRequest) -> Result<()> {
        let Some((exposing, _)) = asked.exposing else {
            return Ok(());
        };
        if exposing != self.opened.exposing(&self.config) {
            let mut config = self.config.clone();
            config.expose(exposing);
            self.opened.expose(&config, exposing)?;
            self.config = config;
        }
        Ok(())
    }

    /// Takes exposure and gain back after a step that did not pass.
    fn expose_again(&mut self, (config, exposing): (HeadConfig, Exposing)) {
        if exposing != self.opened.exposing(&self.config)
            && let Err(failure) = self.opened.expose(&config, exposing)
        {
            // A head that is lost is opened again by this configuration.
            self.progress.warn(&failure.to_string());
        }
        self.config = config;
    }

    fn keep(&self, kept: Commissioning) {
        if let Err(problem) = self.commission.keep(kept) {
            self.progress.warn(&problem.to_string());
        }
    }

    /// Keeps the picture of a pose.
    fn keep_picture(&self, number: u32, white: &Frame, marked: &[[f64; 2]]) {
        let file = self.commission.picture_file(number);
        let kept = fs::create_dir_all(self.commission.state.join(PICTURES))
            .and_then(|()| write_whole(&file, &Picture::of(white).png(marked)));
        if let Err(error) = kept {
            self.progress
                .warn(&format!("write {}: {error}: free space", file.display()));
        }
    }

    /// Gives a head without a calibration what the steps have measured of it, and publishes what is
    /// known of the head.
    pub(in crate::production) fn tell_head(&mut self) {
        let kept = self.commission.kept();
        if self.opened.problem.is_some()
            && kept.head == self.opened.calibration.sizes()
            && let Some(measured) = &kept.measured
        {
            let head = &mut self.opened.head;
            head.set_timing(measured.timing.over(head.timing()));
            // The response was inverted when it was measured.
            let _ = measured.adopt(&mut self.opened.calibration);
        }
        let opened = &self.opened;
        let exposing: Exposing = opened.exposing(&self.config);
        self.commission.set_head(Some(OpenHead {
            simulated: opened.stage.is_some(),
            adjustable: self.config.backend != Backend::Replay,
            problem: opened.problem.clone(),
            calibration: opened.calibration.clone(),
            exposing,
            volume: match opened.problem {
                None => outlines(&opened.calibration),
                Some(_) => Vec::new(),
            },
            least_gain: self.config.least_gain(),
            refresh: opened.head.refresh(),
        }));
    }
}

/// Keeps exposure and gain for later starts.
fn keep_exposing(kept: &mut Commissioning, exposing: Exposing) {
    if kept.exposing != Some(exposing) {
        // Response and noise were measured with other ones.
        kept.steps.remove(TIMING);
    }
    kept.exposing = Some(exposing);
}
