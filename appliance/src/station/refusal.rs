//! Why a trigger is rejected: the number for the PLC, and the words for people.
//!
//! Of several clients that trigger without a pause, `turns` says whose turn it is.

use super::control::{self, BY_PART_NUMBER};
use super::machine::Station;
use super::recipes::{ActiveRecipe, RecipeResult};
use super::snapshot::{Snapshot, status};
use super::state::State;

/// REJECT_REASON, register 120: why the last rejected request was rejected.
pub mod reject {
    /// The station is busy, boots or stops.
    pub const NOT_READY: u16 = 1;
    /// The PLC does not ask for ONLINE.
    pub const OFFLINE: u16 = 2;
    /// No recipe is active.
    pub const NO_RECIPE: u16 = 3;
    /// The config does not let the PLC teach.
    pub const TEACH_NOT_ALLOWED: u16 = 4;
    /// The station has a fault, or the number of a result is still to be stored.
    pub const FAULT: u16 = 5;
    /// The recipe of RECIPE_SELECT is not the active one, or the last load failed.
    pub const OTHER_RECIPE: u16 = 6;
}

impl Station {
    /// Why a trigger would be rejected now, as REJECT_REASON; `None` exactly while READY.
    pub(super) fn refusal(&self) -> Option<u16> {
        Some(match self.state {
            _ if !self.plc.holds(control::ONLINE) => reject::OFFLINE,
            State::Fault(_) => reject::FAULT,
            State::Ready if self.recipes.active.is_none() => reject::NO_RECIPE,
            State::Ready if self.results.unstored => reject::FAULT,
            State::Ready if self.recipes.is_other_asked_for(&self.plc.registers) => {
                reject::OTHER_RECIPE
            }
            State::Ready => return None,
            _ => reject::NOT_READY,
        })
    }
}

impl Snapshot {
    /// Why a trigger would be rejected now, in words with the remedy; `None` exactly while READY.
    pub fn refusal_words(&self) -> Option<String> {
        Some(match (self.refusal?, &self.fault, &self.recipe) {
            (reject::OFFLINE, ..) => {
                "offline: the PLC does not ask for ONLINE; it sets CONTROL bit 0".into()
            }
            (reject::NO_RECIPE, ..) if !self.is(status::CALIBRATION_VALID) => {
                "the head is not calibrated: commission it on the page, under Head, or run `fringed calibrate`".into()
            }
            (reject::NO_RECIPE, ..) => "no recipe is active: load or teach one".into(),
            (reject::FAULT, Some(fault), _) => {
                format!("fault {}: {}; {}", fault.code, fault.cause, fault.remedy)
            }
            (reject::FAULT, None, _) => {
                "the number of the last result is not stored yet: it is tried every second".into()
            }
            (reject::OTHER_RECIPE, _, Some(active)) => self.other_recipe(active),
            _ => format!(
                "the station is in state {}: try again when it is ready",
                self.state_word
            ),
        })
    }

    /// Which recipe was asked for while `active` is active, and the remedy.
    fn other_recipe(&self, active: &ActiveRecipe) -> String {
        let number = active.number;
        match (self.recipe_result, self.control.recipe_select) {
            (RecipeResult::Ok, BY_PART_NUMBER) => format!(
                "the PLC selects part number {:?}, recipe {number} for {:?} is active: load the recipe of that part",
                self.control.part_number_text(),
                active.part_number
            ),
            (RecipeResult::Ok, select) => format!(
                "the PLC selects recipe {select}, recipe {number} is active: load recipe {select}, or have the PLC write \
                 {number} or 0 to RECIPE_SELECT"
            ),
            (failed, _) => {
                let asked = match self.requested_recipe {
                    BY_PART_NUMBER => "the recipe of the PLC's PART_NUMBER".into(),
                    requested => format!("recipe {requested}"),
                };
                let other = match self.requested_recipe == number {
                    true => String::new(),
                    false => format!(", or recipe {number} to go on with that one"),
                };
                let why = failed.words();
                format!("{asked} could not be loaded: {why}; load it{other}")
            }
        }
    }
}
