//! The parameters of a kind, as data: what each may be, and what it is.

use super::unit::Unit;
use alloc::format;
use alloc::string::String;

/// What a parameter may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Domain {
    /// A whole number of pixels, from 1 to the longer side of the frame.
    Pixels {
        /// Whether it must be odd, because a square has a middle pixel.
        odd: bool,
    },
    /// A length that a register can hold, mm.
    Length {
        /// Whether it must be above 0.
        positive: bool,
    },
    /// Two coordinates that a register can hold, mm.
    Place,
    /// One of these words.
    Words(&'static [&'static str]),
}

/// What a parameter is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// A number, in the unit of its domain.
    Number(f64),
    /// Two numbers.
    Pair([f64; 2]),
    /// One of the words of its domain.
    Word(&'static str),
}

impl From<usize> for Value {
    fn from(number: usize) -> Self {
        Self::Number(number as f64)
    }
}

impl From<f64> for Value {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<[f64; 2]> for Value {
    fn from(pair: [f64; 2]) -> Self {
        Self::Pair(pair)
    }
}

/// A parameter of a gauge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Its key in recipes.
    pub name: &'static str,
    /// What it is, in words.
    pub about: &'static str,
    /// What it may be.
    pub domain: Domain,
    /// What it is in this gauge.
    pub value: Value,
}

impl Parameter {
    /// The smallest and the largest number that it may be, in a frame whose longer side has
    /// `longest` pixels; `None` of words.
    pub fn range(&self, longest: usize) -> Option<[f64; 2]> {
        match self.domain {
            Domain::Pixels { .. } => Some([1.0, longest as f64]),
            Domain::Length { positive: false } | Domain::Place => Some(Unit::Length.range()),
            Domain::Length { positive: true } => Some([0.0, Unit::Length.range()[1]]),
            Domain::Words(_) => None,
        }
    }

    /// Refuses a value that it may not be, in a frame whose longer side has `longest` pixels.
    ///
    /// # Errors
    /// In words that name the parameter, its value and what to write.
    pub fn check(&self, longest: usize) -> Result<(), String> {
        let Some([least, most]) = self.range(longest) else {
            return Ok(());
        };
        let name = self.name;
        let value = match self.value {
            Value::Number(value) => value,
            Value::Pair(pair) => {
                let outside = pair.iter().any(|value| !(least..=most).contains(value));
                return match outside {
                    true => Err(format!(
                        "{name} is {pair:?}: write two of {least} to {most}"
                    )),
                    false => Ok(()),
                };
            }
            Value::Word(_) => return Ok(()),
        };
        let within = (least..=most).contains(&value);
        match self.domain {
            Domain::Pixels { odd: true } if within && value % 2.0 == 0.0 => Err(format!(
                "{name} is {value}: write an odd number, the square has a middle pixel"
            )),
            Domain::Length { positive: true } if !within || value == 0.0 => Err(format!(
                "{name} is {value:?}: write more than 0, up to {most}"
            )),
            _ if !within => Err(format!("{name} is {value:?}: write {least} to {most}")),
            _ => Ok(()),
        }
    }
}

/// Declares a parameter that is one of some words, as recipes have them.
macro_rules! words {
    ($(#[$doc:meta])* $name:ident { $($(#[$about:meta])* $variant:ident: $word:literal,)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        pub enum $name {
            $($(#[$about])* #[cfg_attr(feature = "serde", serde(rename = $word))] $variant,)*
        }

        impl $name {
            /// The words that may be chosen.
            pub const WORDS: Domain = Domain::Words(&[$($word),*]);
        }

        impl From<$name> for Value {
            fn from(of: $name) -> Self {
                Self::Word(match of {
                    $($name::$variant => $word,)*
                })
            }
        }
    };
}
pub(super) use words;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::gauge::kinds::*;
    use crate::inspect::{Declared, Measure};
    use alloc::vec::Vec;

    fn check(kind: &dyn Declared) -> Vec<Result<(), String>> {
        let parameters = kind.parameters();
        parameters.iter().map(|of| of.check(640)).collect()
    }

    #[test]
    fn a_side_is_at_least_a_pixel_and_at_most_the_frames_and_that_of_a_square_is_odd() {
        for (smoothing_px, fits, fits_square) in [
            (0, false, false),
            (1, true, true),
            (2, true, false),
            (639, true, true),
            (640, true, false),
            (641, false, false),
            (usize::MAX, false, false),
        ] {
            let [cells] = &check(&Flatness { smoothing_px })[..] else {
                panic!("one parameter")
            };
            assert_eq!(cells.is_ok(), fits, "{cells:?}");
            let [square] = &check(&Deviation { smoothing_px })[..] else {
                panic!("one parameter")
            };
            assert_eq!(square.is_ok(), fits_square, "{square:?}");
        }
    }

    #[test]
    fn a_tolerance_and_a_plane_lie_within_what_a_register_holds() {
        let tolerance = |tolerance_mm| OutOfTolerance {
            smoothing_px: 9,
            tolerance_mm,
        };
        for mm in [0.0, -0.1, f64::NAN, f64::INFINITY, 214_748.365] {
            let words = check(&tolerance(mm))[1].clone().unwrap_err();
            assert!(words.contains("more than 0, up to 214748.3647"), "{words}");
        }
        assert_eq!(check(&tolerance(0.1)), [Ok(()), Ok(())]);
        for above_mm in [f64::NAN, f64::NEG_INFINITY, 214_748.365, -214_748.365] {
            assert!(check(&Volume { above_mm })[0].is_err(), "{above_mm}");
        }
        assert_eq!(check(&Volume { above_mm: -8.0 }), [Ok(())]);
    }

    #[test]
    fn the_word_of_an_example_is_one_of_those_that_may_be_chosen() {
        for kind in Measure::examples() {
            for of in kind.kind().parameters() {
                if let (Domain::Words(words), Value::Word(word)) = (of.domain, of.value) {
                    assert!(words.contains(&word), "{of:?}");
                }
            }
        }
    }
}
