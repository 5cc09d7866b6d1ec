//! Live pictures: taken by the measuring task while it has nothing else to do, only when somebody
//! asks.
//!
//! The patterns to show are loaded once, behind those of the active recipe, so that a trigger finds
//! its patterns in the projector. A trigger that comes ends the exposure within a refresh. Figures
//! and PNG are worked out on the asking thread, which should have a low priority.

use super::Commission;
use crate::head::commission::settled;
use crate::head::examine::{SETTLE, picture};
use crate::head::live::{Figures, Fringes, Picture, Show, rasters};
use crate::production::{Order, Worker};
use hal::error::Error;
use serde_json::{Value, json};
use std::sync::mpsc::{Sender, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Longest wait for the measuring task.
const PATIENCE: Duration = Duration::from_secs(5);

/// Why there is no live picture, in words with the remedy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct NotNow(pub String);

/// A request for a picture, which the measuring task answers.
pub struct Look {
    show: Show,
    shift: usize,
    answer: SyncSender<Result<Picture, NotNow>>,
}

/// What was seen last.
#[derive(Default)]
struct LastPicture {
    number: u64,
    figures: Option<Value>,
}

/// Live pictures. Cheap to clone.
#[derive(Clone)]
pub struct Live {
    orders: Sender<Order>,
    commission: Commission,
    /// The last pictures of fringes; locked while a picture is taken, so others who ask wait.
    fringes: Arc<Mutex<Fringes>>,
    /// Locked only for moments.
    seen: Arc<Mutex<LastPicture>>,
}

impl Live {
    /// Live pictures of the head whose measuring task takes these orders.
    pub fn new(orders: Sender<Order>, commission: Commission) -> Self {
        Self {
            orders,
            commission,
            fringes: Arc::default(),
            seen: Arc::default(),
        }
    }

    /// Has one picture taken, and works out its PNG and figures; returns its number with the PNG.
    /// Others who ask wait.
    ///
    /// # Errors
    /// The measuring task has something else to do, or the head failed.
    pub fn look(&self, show: Show) -> Result<(u64, Vec<u8>), NotNow> {
        let mut fringes = self.fringes.lock().unwrap_or_else(PoisonError::into_inner);
        let head = self.commission.head();
        let head = head.ok_or_else(|| NotNow("take a picture: no head is open".into()))?;
        if !head.adjustable {
            let words = "take a picture: recordings show nothing live";
            return Err(NotNow(words.into()));
        }
        let (answer, picture) = sync_channel(1);
        let shift = fringes.next(show);
        // If the measuring task is gone, the sender of the answer is dropped.
        drop(self.orders.send(Order::Look(Look {
            show,
            shift,
            answer,
        })));
        let picture = picture
            .recv_timeout(PATIENCE)
            .unwrap_or_else(|_| Err(busy()))?;
        let png = picture.png(&[]);
        let mut figures = json!(Figures::of(&picture));
        figures["show"] = json!(show.word());
        figures["exposure_us"] = json!(head.exposing.exposure_us);
        figures["gain"] = json!(head.exposing.gain);
        fringes.add(show, picture);
        figures["modulation_8"] = json!(fringes.modulation(8));
        figures["modulation_12"] = json!(fringes.modulation(12));
        let mut seen = self.seen();
        seen.number += 1;
        figures["number"] = json!(seen.number);
        seen.figures = Some(figures);
        Ok((seen.number, png))
    }

    /// The figures of the last picture.
    pub fn figures(&self) -> Option<Value> {
        self.seen().figures.clone()
    }

    fn seen(&self) -> MutexGuard<'_, LastPicture> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn busy() -> NotNow {
    NotNow("take a picture: a cycle, a load, a teach or a step is under way, or the head is lost: try again when the station is ready".into())
}

impl Worker {
    /// Takes a live picture, unless an order has come since it was asked for.
    pub(in crate::production) fn look(&mut self, look: Look) {
        let taken = self.looked(&look);
        let answer = match taken {
            Ok(Some(picture)) => Ok(picture),
            Ok(None) => Err(busy()),
            Err(error) => Err(NotNow(error.to_string())),
        };
        // The requester may have given up.
        let _ = look.answer.send(answer);
    }

    fn looked(&mut self, look: &Look) -> Result<Option<Picture>, Error> {
        let station = self.station.clone();
        let at_rest = move || !station.snapshot().is_working();
        if !at_rest() {
            return Ok(None);
        }
        let (pool, calibration) = (&self.pool, &self.opened.calibration);
        let head = &mut self.opened.head;
        // Nothing is known of the delay before it is measured.
        let known =
            self.opened.problem.is_none() || self.commission.inside().kept.measured.is_some();
        let settle = if known { settled(head) } else { SETTLE };
        let index = look.show.at(look.shift);
        let kept = self.plan.as_ref().map_or(0, |plan| plan.patterns());
        let live = &mut self.live;
        let taken = head.aside(kept, Arc::new(at_rest), |head| {
            if !*live {
                head.load(pool.install(|| rasters(calibration))?)?;
                *live = true;
            }
            picture(head, index, settle)
        });
        self.pulse.beat();
        match taken {
            Err(Error::Ended { .. }) => Ok(None),
            taken => Ok(taken?.map(|frame| Picture::of(&frame))),
        }
    }
}
