//! The active recipe, and how the last request for one ended.

use std::sync::Arc;

use super::control::{BY_PART_NUMBER, ControlRegisters};

/// How a recipe is chosen.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RecipeKey {
    /// 1–9999.
    Number(u16),
    /// The recipe taught for this part number.
    PartNumber(Arc<str>),
}

/// How the last recipe request ended: register 109.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum RecipeResult {
    /// 0.
    #[default]
    Ok,
    /// 1: no such recipe.
    Unknown,
    /// 2: it is damaged.
    Corrupt,
    /// 3: it was made for another head or calibration.
    OtherCalibration,
    /// 4: the station could not load now.
    Busy,
    /// 5: it is whole, and cannot be used as it is.
    Unfit,
}

impl RecipeResult {
    /// The number of register 109.
    pub fn number(self) -> u16 {
        self as u16
    }

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Ok => "it was loaded",
            Self::Unknown => "there is no such recipe",
            Self::Corrupt => "it is damaged",
            Self::OtherCalibration => "it was made for another head, calibration, exposure or gain",
            Self::Busy => "a load or teach was refused or interrupted",
            Self::Unfit => "it cannot be used as it is stored",
        }
    }
}

/// The recipe that the worker is ready to measure with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ActiveRecipe {
    /// 1–9999.
    pub number: u16,
    /// First 32 bits of the recipe's fingerprint.
    pub crc: u32,
    /// The part number that it was taught for; RECIPE_SELECT 65535 selects it by this.
    pub part_number: Arc<str>,
    /// For people.
    pub name: Arc<str>,
}

/// The active recipe and the last request.
#[derive(Debug, Clone, Default)]
pub(super) struct Recipes {
    /// The active recipe.
    pub(super) active: Option<ActiveRecipe>,
    /// REQUESTED_RECIPE.
    pub(super) requested: u16,
    /// RECIPE_RESULT.
    pub(super) result: RecipeResult,
}

impl Recipes {
    /// A load was ordered.
    pub(super) fn request(&mut self, key: &RecipeKey) {
        self.requested = match key {
            RecipeKey::Number(number) => *number,
            RecipeKey::PartNumber(_) => BY_PART_NUMBER,
        };
    }

    /// The PLC asked for a load that cannot be ordered now.
    pub(super) fn refuse(&mut self, select: u16) {
        self.requested = select;
        self.result = RecipeResult::Busy;
    }

    /// A recipe was loaded or taught.
    pub(super) fn activate(&mut self, recipe: ActiveRecipe) {
        self.requested = recipe.number;
        self.result = RecipeResult::Ok;
        self.active = Some(recipe);
    }

    /// A load failed; the recipe before it stays active.
    pub(super) fn fail(&mut self, result: RecipeResult) {
        self.result = result;
    }

    /// A load was interrupted. What the worker holds now is not known, so no recipe is active.
    pub(super) fn interrupt(&mut self) {
        self.active = None;
        self.result = RecipeResult::Busy;
    }

    /// RECIPE_OK: the requested recipe is the active one.
    pub(super) fn is_ok(&self) -> bool {
        self.active.is_some() && self.result == RecipeResult::Ok
    }

    /// Whether a part must not be measured with the active recipe, because another one was asked
    /// for: by the RECIPE_SELECT that is held in CONTROL, or by a load that failed.
    pub(super) fn is_other_asked_for(&self, control: &ControlRegisters) -> bool {
        let selected = |recipe: &ActiveRecipe| match control.recipe_select {
            0 => true,
            BY_PART_NUMBER => {
                let part_number = control.part_number_text();
                !part_number.is_empty() && part_number == *recipe.part_number
            }
            number => number == recipe.number,
        };
        self.result != RecipeResult::Ok || !self.active.as_ref().is_some_and(selected)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::recipe;
    use super::*;

    #[test]
    fn a_load_that_failed_keeps_the_active_recipe_and_one_that_was_interrupted_does_not() {
        let control = ControlRegisters::default();
        let mut recipes = Recipes::default();
        assert!(!recipes.is_ok() && recipes.is_other_asked_for(&control));
        recipes.activate(recipe(1));
        assert!(recipes.is_ok() && !recipes.is_other_asked_for(&control));
        recipes.request(&RecipeKey::Number(2));
        recipes.fail(RecipeResult::Unknown);
        assert!(!recipes.is_ok() && recipes.is_other_asked_for(&control));
        assert_eq!((recipes.requested, &recipes.active), (2, &Some(recipe(1))));
        recipes.interrupt();
        assert_eq!(
            (recipes.result, &recipes.active),
            (RecipeResult::Busy, &None)
        );
    }
}
