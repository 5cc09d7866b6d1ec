//! What teaching took for the part, as the page shows it before anything is judged by it.

use crate::station::{Marking, Square};
use algo::phase::Trust;
use algo::pipeline::PhaseMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The picture of a part that was taught, or was to be.
#[derive(Clone, Debug, Default)]
pub struct PartSeen {
    /// Columns.
    pub width: usize,
    /// Modulation of each pixel, counts.
    pub modulation: Vec<f32>,
    /// 1 where it was taken for the part, else 0.
    pub part: Vec<f32>,
    /// What was marked in it.
    pub marking: Marking,
    /// Where good parts would not keep their limit, if that is why it was refused.
    pub place: Option<Square>,
}

impl PartSeen {
    /// Of what was measured. `part` has the pixels of the part; without it all that has a phase is.
    pub(super) fn of(
        (phases, full_scale): (&PhaseMap, u16),
        part: Option<&[bool]>,
        marking: &Marking,
    ) -> Self {
        let counts = |of: &algo::units::Modulation| of.counts(full_scale) as f32;
        let resolved = phases.trust.iter().enumerate();
        let resolved = resolved.map(|(at, trust)| {
            *trust == Trust::Resolved && part.is_none_or(|part| part.get(at) == Some(&true))
        });
        Self {
            width: phases.width,
            modulation: phases.modulation.iter().map(counts).collect(),
            part: resolved.map(|is| f32::from(u8::from(is))).collect(),
            marking: marking.clone(),
            place: None,
        }
    }
}

/// What was seen last. Cheap to clone.
#[derive(Clone, Debug, Default)]
pub struct LastSeen(Arc<Mutex<Option<Arc<PartSeen>>>>);

impl LastSeen {
    /// The picture of the part that was taught last, `None` before the first.
    pub fn get(&self) -> Option<Arc<PartSeen>> {
        self.locked().clone()
    }

    /// Shows another one.
    pub fn show(&self, seen: PartSeen) {
        *self.locked() = Some(Arc::new(seen));
    }

    /// Marks the place for which it was refused.
    pub fn refuse(&self, place: Option<Square>) {
        if let Some(seen) = &mut *self.locked() {
            Arc::make_mut(seen).place = place;
        }
    }

    fn locked(&self) -> MutexGuard<'_, Option<Arc<PartSeen>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
