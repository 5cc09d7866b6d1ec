//! Bounds of the values in files and requests: ranges of numbers, lengths of texts and lists.
//!
//! A value outside its bounds is refused, naming its key, before anything is allocated or computed
//! from it.

use std::ffi::OsStr;
use std::fmt::Debug;
use std::ops::RangeInclusive;
use std::slice;

/// Largest width or height of a camera's frame or a projector's raster, pixels. The largest devices
/// on sale have 7680.
pub const MAX_SIDE: u32 = 8192;
/// Largest σ of a sample, counts: full scale of 16 bits.
pub const MAX_NOISE_COUNTS: f64 = 65_535.0;
/// Smallest σ of a sample, counts; rounding to whole counts alone gives 0.29.
pub const MIN_NOISE_COUNTS: f64 = 1e-6;
/// Farthest z of a working range, mm. More than enough: a head measures up to 2 m from its
/// reference plane.
pub const MAX_RANGE_MM: f64 = 10_000.0;
/// Most fringes over a projector, turns: the largest phase that the fixed-point format holds.
pub const MAX_FRINGES: f64 = 1000.0;
/// Longest exposure, µs.
pub const MAX_EXPOSURE_US: f64 = 10_000_000.0;
/// Smallest and largest ratio of a level. With up to eight levels, the coarsest spans at most one
/// turn of a pattern of 1000 turns.
pub const RATIOS: [f64; 2] = [1e-6, 1000.0];
/// Largest shift of a frame in either direction, turns; only its fraction matters.
pub const MAX_SHIFT_TURNS: f64 = 1000.0;
/// Highest order of a harmonic of a projected waveform.
pub const MAX_HARMONIC: u8 = 15;
/// Farthest that a simulated part is moved along an axis, mm.
pub const MAX_PLACEMENT_MM: f64 = 1000.0;
/// Farthest that a simulated part is tilted about x or y, degrees.
pub const MAX_TILT_DEG: f64 = 80.0;
/// Farthest that a simulated part is turned about z, degrees.
pub const MAX_ROTATION_DEG: f64 = 360.0;
/// Hexadecimal digits of a fingerprint (SHA-256).
pub const FINGERPRINT_DIGITS: usize = 64;
/// The last second of the year 9999, in seconds since 1970.
pub const LAST_SECOND: u64 = 253_402_300_799;
/// Largest σ of a height or a length, mm: no head is worse.
pub const MAX_SIGMA_MM: f64 = 1000.0;
/// Longest name of a device, line, part, program, recording or file, characters.
pub const MAX_NAME: usize = 255;
/// Longest path that the system opens.
pub const MAX_PATH: usize = 4096;
/// Most characters of a message about a file.
const LONGEST_MESSAGE: usize = 600;
/// Most characters of a value that a message quotes.
const REPEATED: usize = 48;

/// Defines structs of files and settings whose fields have their bounds beside them, as in
/// `pub gain: f64 = 0.0..=100.0`. Each value of an option, an array or a vector must lie in them;
/// fields without bounds are not checked. [`Fields`](crate::bounds::Fields) checks such a struct.
///
/// A struct is cloned, compared, shown, read and written, and has no other keys than its fields.
/// Of a `struct Name: Default` any key may be left out: its field then has the value that follows
/// it, as in `pub gain: f64 = 0.0..=100.0 => 1.0`, or else the default of its type.
#[macro_export]
macro_rules! bounded {
    (@value) => {
        Default::default()
    };
    (@value $value:expr) => {
        $value
    };
    (@item [] [$($meta:tt)*] $vis:vis $name:ident {
        $($(#[$note:meta])* $see:vis $field:ident: $kind:ty $(= $bound:expr)? $(=> $value:expr)?,)*
    }) => {
        #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        $($meta)*
        $vis struct $name {
            $($(#[$note])* $see $field: $kind,)*
        }

        impl $crate::bounds::Bound<$name> for $crate::bounds::Fields {
            fn check(&self, key: &str, whole: &$name) -> Result<(), $crate::bounds::OutOfBounds> {
                use $crate::bounds::Values as _;
                $($(for value in whole.$field.as_slice() {
                    let key = [key, ".", stringify!($field)].concat();
                    $crate::bounds::Bound::check(&$bound, key.trim_start_matches('.'), value)?;
                })?)*
                Ok(())
            }
        }
    };
    (@item [Default] [$($meta:tt)*] $vis:vis $name:ident $fields:tt) => {
        $crate::bounded! { @item [] [$($meta)* #[serde(default)]] $vis $name $fields }
        $crate::bounded! { @default $name $fields }
    };
    (@default $name:ident {
        $($(#[$note:meta])* $see:vis $field:ident: $kind:ty $(= $bound:expr)? $(=> $value:expr)?,)*
    }) => {
        impl Default for $name {
            fn default() -> Self {
                Self {
                    $($field: $crate::bounded!(@value $($value)?),)*
                }
            }
        }
    };
    ($($(#[$meta:meta])* $vis:vis struct $name:ident $(: $default:ident)? { $($field:tt)* })*) => {
        $($crate::bounded! { @item [$($default)?] [$(#[$meta])*] $vis $name { $($field)* } })*
    };
}

/// A value outside its bounds; the message names its key and says what to write.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OutOfBounds {
    /// A number, with its bounds, each as it would be written in a file.
    #[error("{key} is {value}: write {low} to {high}")]
    Number {
        /// Its key.
        key: String,
        /// The number.
        value: String,
        /// The smallest that is allowed.
        low: String,
        /// The largest that is allowed.
        high: String,
    },
    /// A text with too many characters.
    #[error("{key} {value:?} has {length} characters: write at most {most}")]
    LongText {
        /// Its key.
        key: String,
        /// Its beginning.
        value: String,
        /// Its characters.
        length: usize,
        /// The most that are allowed.
        most: usize,
    },
    /// A text with control characters.
    #[error("{key} {value:?} has control characters: write it in one line of plain text")]
    ControlCharacters {
        /// Its key.
        key: String,
        /// The text.
        value: String,
    },
    /// A text that could look like another one.
    #[error(
        "{key} {value:?} has characters that cannot be seen or turn the direction of others: write it without them"
    )]
    HiddenCharacters {
        /// Its key.
        key: String,
        /// The text.
        value: String,
    },
    /// A list with too few or too many members.
    #[error("{key} has {count} members: write {low} to {high}")]
    Members {
        /// Its key.
        key: String,
        /// Its members.
        count: usize,
        /// The fewest that are allowed.
        low: usize,
        /// The most that are allowed.
        high: usize,
    },
    /// A text that is no SHA-256.
    #[error("{key} is {value:?}: it must be {FINGERPRINT_DIGITS} hexadecimal digits")]
    NoFingerprint {
        /// Its key.
        key: String,
        /// Its beginning.
        value: String,
    },
}

/// The message, for callers that hand it to a person as it is.
impl From<OutOfBounds> for String {
    fn from(error: OutOfBounds) -> Self {
        error.to_string()
    }
}

/// The bounds of one value: a range of numbers, [`Longest`] or [`Fields`].
pub trait Bound<T> {
    /// Checks the value of a key.
    ///
    /// # Errors
    /// [`OutOfBounds`]
    fn check(&self, key: &str, value: &T) -> Result<(), OutOfBounds>;
}

impl<T: PartialOrd + Debug + Copy> Bound<T> for RangeInclusive<T> {
    fn check(&self, key: &str, value: &T) -> Result<(), OutOfBounds> {
        within(key, *value, *self.start(), *self.end())
    }
}

impl<T: PartialOrd + Debug + Copy, const N: usize> Bound<[T; N]> for RangeInclusive<T> {
    fn check(&self, key: &str, values: &[T; N]) -> Result<(), OutOfBounds> {
        values.iter().try_for_each(|value| self.check(key, value))
    }
}

/// The bounds of a text or path: so many characters at most, and no control characters.
pub struct Longest(pub usize);

impl<T: AsRef<OsStr>> Bound<T> for Longest {
    fn check(&self, key: &str, value: &T) -> Result<(), OutOfBounds> {
        text(key, &value.as_ref().to_string_lossy(), self.0)
    }
}

/// The bounds of a struct that [`bounded!`](crate::bounded) defines: those of its fields. Their
/// keys follow the struct's key and a dot; the key of a whole file is empty.
pub struct Fields;

/// Lets a single value be read as a slice, as options, arrays and vectors can be by their own
/// methods.
pub trait Values: Sized {
    /// A slice of this value alone.
    fn as_slice(&self) -> &[Self] {
        slice::from_ref(self)
    }
}

impl<T> Values for T {}

/// Checks that a value lies in `low` to `high`; a NaN does not.
///
/// # Errors
/// [`OutOfBounds::Number`]
pub fn within<T: PartialOrd + Debug + Copy>(
    key: &str,
    value: T,
    low: T,
    high: T,
) -> Result<(), OutOfBounds> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    // Debug format: 1e300 is written as it would be in a file, not with 301 digits.
    let [value, low, high] = [value, low, high].map(|number| format!("{number:?}"));
    Err(OutOfBounds::Number {
        key: key.into(),
        value,
        low,
        high,
    })
}

/// Whether a character shows nothing, or turns the direction of what stands beside it, so that two texts
/// that look alike differ. Joiners do not count: emoji and scripts need them.
fn is_hidden(letter: char) -> bool {
    matches!(letter,
        '\u{ad}' | '\u{61c}' | '\u{180e}' | '\u{200b}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}'
        | '\u{2060}'..='\u{206f}' | '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}')
}

/// Checks that a text has at most `most` characters, no control characters, and no hidden ones.
///
/// # Errors
/// [`OutOfBounds`]
pub fn text(key: &str, value: &str, most: usize) -> Result<(), OutOfBounds> {
    let length = value.chars().count();
    if length > most {
        return Err(OutOfBounds::LongText {
            key: key.into(),
            value: clipped(value),
            length,
            most,
        });
    }
    let (key, value) = (key.to_owned(), value.to_owned());
    match value.chars().any(char::is_control) {
        true => Err(OutOfBounds::ControlCharacters { key, value }),
        false if value.chars().any(is_hidden) => Err(OutOfBounds::HiddenCharacters { key, value }),
        false => Ok(()),
    }
}

/// Checks that a list has `low` to `high` members.
///
/// # Errors
/// [`OutOfBounds::Members`]
pub fn length(key: &str, count: usize, low: usize, high: usize) -> Result<(), OutOfBounds> {
    match (low..=high).contains(&count) {
        true => Ok(()),
        false => Err(OutOfBounds::Members {
            key: key.into(),
            count,
            low,
            high,
        }),
    }
}

/// Checks that a text is a SHA-256 in hexadecimal digits.
///
/// # Errors
/// [`OutOfBounds::NoFingerprint`]
pub fn fingerprint(key: &str, value: &str) -> Result<(), OutOfBounds> {
    let digits = value.bytes().all(|byte| byte.is_ascii_hexdigit());
    match digits && value.len() == FINGERPRINT_DIGITS {
        true => Ok(()),
        false => Err(OutOfBounds::NoFingerprint {
            key: key.into(),
            value: clipped(value),
        }),
    }
}

/// Shortens a message that is too long to be read by leaving out its middle: a parser may quote a
/// whole megabyte of a file. The position in the file is at the beginning or the end of such
/// messages.
#[must_use]
pub fn shortened(words: &str) -> String {
    let length = words.chars().count();
    if length <= LONGEST_MESSAGE {
        return words.to_owned();
    }
    let beginning: String = words.chars().take(LONGEST_MESSAGE / 2).collect();
    let end: String = words.chars().skip(length - LONGEST_MESSAGE / 4).collect();
    format!("{beginning}…{end}")
}

/// The beginning of a value, for messages.
#[must_use]
pub fn clipped(value: &str) -> String {
    match value.char_indices().nth(REPEATED) {
        None => value.to_owned(),
        Some((end, _)) => format!("{}…", &value[..end]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    bounded! {
        struct Level {
            gain: Option<f64> = 0.0..=1.0,
            name: String = Longest(3),
        }
        struct Whole {
            count: u32 = 1..=2,
            sides: [f64; 2] = -1.0..=1.0,
            levels: Vec<Level> = Fields,
        }
    }

    #[test]
    fn bounds_beside_fields_hold_for_every_value_and_are_refused_by_the_whole_key() {
        let check = |count, side, gain, name: &str| {
            let levels = [(None, "a"), (gain, name)];
            let whole = Whole {
                count,
                sides: [0.0, side],
                levels: levels
                    .map(|(gain, name)| Level {
                        gain,
                        name: name.into(),
                    })
                    .into(),
            };
            Fields.check("", &whole)
        };
        check(2, -1.0, Some(1.0), "abc").unwrap();
        for (refused, words) in [
            (check(3, 0.0, None, ""), "count is 3: write 1 to 2"),
            (check(1, 1.5, None, ""), "sides is 1.5: write -1.0 to 1.0"),
            (
                check(1, 0.0, Some(-1.0), ""),
                "levels.gain is -1.0: write 0.0 to 1.0",
            ),
            (
                check(1, 0.0, None, "abcd"),
                "levels.name \"abcd\" has 4 characters: write at most 3",
            ),
            (
                check(1, f64::NAN, None, ""),
                "sides is NaN: write -1.0 to 1.0",
            ),
        ] {
            assert_eq!(refused.unwrap_err().to_string(), words);
        }
    }

    #[test]
    fn a_message_names_key_value_and_bounds_and_stays_short() {
        let words = within("projector.width", u32::MAX, 1, MAX_SIDE).unwrap_err();
        assert_eq!(
            words.to_string(),
            "projector.width is 4294967295: write 1 to 8192"
        );
        let words = within("range_mm", 1e300, -1.0, 1.0).unwrap_err();
        assert_eq!(words.to_string(), "range_mm is 1e300: write -1.0 to 1.0");
        within("x", f64::NAN, f64::MIN, f64::MAX).unwrap_err();
        within("x", 1.0, 0.0, 1.0).unwrap();
        for words in [
            text("name", &"ä".repeat(1 << 20), 64).unwrap_err(),
            fingerprint("fingerprint", &"0".repeat(1 << 20)).unwrap_err(),
        ] {
            assert!(words.to_string().len() < 200, "{words}");
        }
        let long = format!("unknown field `{}` at line 7", "ä".repeat(1 << 20));
        let short = shortened(&long);
        assert!(short.starts_with("unknown field") && short.ends_with("at line 7"));
        assert!(short.chars().count() < LONGEST_MESSAGE, "{short}");
        text("name", "a\u{1b}[2J", 64).unwrap_err();
        text("name", "Gehäuse 7", 9).unwrap();
        // A turn of the direction, no width, and below emoji that are joined.
        for hidden in ["a\u{202e}b", "a\u{200b}b", "\u{feff}a", "\u{2066}a"] {
            let refused = text("name", hidden, 9).unwrap_err();
            assert!(matches!(refused, OutOfBounds::HiddenCharacters { .. }));
        }
        text("name", "\u{1f469}\u{200d}\u{1f3ed}", 9).unwrap();
    }
}
