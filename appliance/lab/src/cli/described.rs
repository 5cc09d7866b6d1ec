//! Options that describe projected pictures, for `import` and `patterns`; the lists, ranges
//! and sizes in them have bounds, which a refusal names.

use crate::description::{
    BitOrder, Convention, Description, Direction, Fringes, Gray, PerDirection, Section, ShiftSign,
    Shifts,
};
use algo::chain::Coding;
use appliance::cli::numbers::number;
use appliance::error::{Exit, Result};
use clap::builder::TypedValueParser;
use hal::bounds::{MAX_FRINGES, MAX_SHIFT_TURNS, MAX_SIDE};
use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// Most levels of a recording that can be decoded.
const MAX_LEVELS: usize = 8;

/// What was or will be projected.
#[derive(Clone, Debug, clap::Args)]
pub struct Described {
    /// Columns and rows of the projector.
    #[arg(long, value_name = "WxH", value_parser = size)]
    projector: Size,
    /// Fringes over the projector of each level, in the order of projection; need not be whole
    /// numbers. 1,8,32/1,8,16: vertical ones, then horizontal ones. Without fringes there is a Gray
    /// code alone.
    #[arg(long, value_name = "F,...", conflicts_with = "pitch", value_parser = directions(1e-3, MAX_FRINGES, MAX_LEVELS))]
    fringes: Option<PerDirection<f64>>,
    /// Projector pixels per fringe of each level, instead of --fringes.
    #[arg(long, value_name = "PX,...", value_parser = directions(2.0, 1e6, MAX_LEVELS))]
    pitch: Option<PerDirection<f64>>,
    /// Shifts of all levels, or of each.
    #[arg(long, value_name = "N,...", default_value = "4", value_parser = directions(3u8, 64, MAX_LEVELS))]
    steps: PerDirection<u8>,
    /// Whether the phase is that of a sine or of a cosine.
    #[arg(long, default_value = "sin")]
    convention: Convention,
    /// Whether the shift rises or falls from frame to frame.
    #[arg(long, default_value = "+", allow_hyphen_values = true)]
    shift: ShiftSign,
    /// Shift of each level's first frame, turns.
    #[arg(long, value_name = "TURNS", default_value_t = 0.0, allow_negative_numbers = true, value_parser = number(-MAX_SHIFT_TURNS, MAX_SHIFT_TURNS))]
    first_shift: f64,
    /// Direction of the fringes; both: all vertical ones, then all horizontal ones;
    /// horizontal-first: the other way round.
    #[arg(long, default_value = "vertical")]
    direction: Direction,
    /// Bits of a Gray code beside the fringes; two numbers for the vertical and the horizontal one.
    #[arg(long, value_name = "BITS", value_parser = series(1u8, 13, 2))]
    gray: Option<Series<u8>>,
    /// Width of the Gray code's cells, projector pixels; without it one cell per fringe of the
    /// finest level, or per pixel without fringes. Two numbers for the vertical and the horizontal
    /// code.
    #[arg(long, value_name = "PX", value_parser = series(1.0, f64::from(MAX_SIDE), 2))]
    gray_cell: Option<Series<f64>>,
    /// How far before the raster's edge the first cell begins, projector pixels: half a cell where
    /// edges lie in the middle of fringes.
    #[arg(long, value_name = "PX", value_parser = series(0.0, f64::from(MAX_SIDE), 2))]
    gray_offset: Option<Series<f64>>,
    /// Order of the Gray code's bits: most or least significant first.
    #[arg(long, default_value = "msb")]
    gray_order: BitOrder,
    /// The cells are numbered in plain binary instead of a Gray code.
    #[arg(long)]
    gray_binary: bool,
    /// Bits that are set are dark.
    #[arg(long)]
    gray_invert: bool,
    /// Each picture of the Gray code is followed by its inverse.
    #[arg(long)]
    gray_inverse: bool,
    /// Order of projection; without it sine, then gray if there is one.
    #[arg(long, value_name = "PART,...", value_delimiter = ',')]
    order: Vec<Section>,
}

/// The numbers of an option; none without it.
fn listed(option: &Option<Series<f64>>) -> Vec<f64> {
    option.as_ref().map_or_else(Vec::new, |list| list.0.clone())
}

impl Described {
    /// The projector's columns and rows.
    pub fn projector(&self) -> (u32, u32) {
        let Size(width, height) = self.projector;
        (width, height)
    }

    /// The description, with a phase function instead of straight fringes if one is given.
    ///
    /// # Errors
    /// If neither fringes, pitches nor a Gray code are given, or a Gray code is described that
    /// there is not (64).
    pub fn description(&self, function: Option<Vec<f64>>) -> Result<Description> {
        let fringes = match (&self.fringes, &self.pitch) {
            (Some(fringes), _) => Fringes::Count(fringes.clone()),
            (None, Some(pitch)) => Fringes::Pitch(pitch.clone()),
            (None, None) if self.gray.is_some() && function.is_none() => Fringes::None,
            (None, None) => {
                let words =
                    "give --fringes or --pitch, or the bits of a Gray code alone with --gray";
                return Exit::Usage.fail(words);
            }
        };
        let described = self.gray_cell.is_some()
            || self.gray_offset.is_some()
            || self.gray_order != BitOrder::Msb
            || self.gray_binary
            || self.gray_invert
            || self.gray_inverse;
        if self.gray.is_none() && described {
            let words =
                "options that begin with --gray- describe a Gray code: give its bits with --gray";
            return Exit::Usage.fail(words);
        }
        let gray = self.gray.as_ref().map(|Series(bits)| Gray {
            bits: bits.clone(),
            cell_px: listed(&self.gray_cell),
            offset_px: listed(&self.gray_offset),
            order: self.gray_order,
            coding: Coding {
                binary: self.gray_binary,
                inverted: self.gray_invert,
            },
            inverse: self.gray_inverse,
        });
        let usual = match (&fringes, &gray) {
            (Fringes::None, _) => vec![Section::Gray],
            (_, Some(_)) => vec![Section::Sine, Section::Gray],
            (_, None) => vec![Section::Sine],
        };
        Ok(Description {
            projector: self.projector(),
            fringes,
            steps: self.steps.clone(),
            shifts: Shifts {
                convention: self.convention,
                sign: self.shift,
                first: self.first_shift,
            },
            direction: self.direction,
            gray,
            order: if self.order.is_empty() {
                usual
            } else {
                self.order.clone()
            },
            function,
        })
    }
}

/// Numbers in a list of any length.
#[derive(Clone, Debug, PartialEq)]
pub struct Series<T>(pub Vec<T>);

/// One number or several with commas between them, at most `most`, each from `low` to `high`.
pub fn series<T>(low: T, high: T, most: usize) -> impl TypedValueParser<Value = Series<T>>
where
    T: FromStr + PartialOrd + Display + Copy + Send + Sync + 'static,
{
    move |text: &str| {
        bounded(text, &(low..=high), most)
            .map(Series)
            .ok_or_else(|| {
                format!("write 1 to {most} numbers from {low} to {high} with commas between them")
            })
    }
}

/// At most `most` numbers of a range with commas between them.
fn bounded<T: FromStr + PartialOrd>(
    text: &str,
    range: &RangeInclusive<T>,
    most: usize,
) -> Option<Vec<T>> {
    let numbers = text.split(',').map(|number| number.trim().parse().ok());
    let numbers: Option<Vec<T>> = numbers.collect();
    numbers.filter(|all| all.len() <= most && all.iter().all(|number| range.contains(number)))
}

/// A series for vertical fringes and one for horizontal ones with a / between them, or one for
/// both.
pub fn directions<T>(low: T, high: T, most: usize) -> impl TypedValueParser<Value = PerDirection<T>>
where
    T: FromStr + PartialOrd + Display + Copy + Send + Sync + 'static,
{
    move |text: &str| {
        let lists = text
            .split('/')
            .map(|text| bounded(text, &(low..=high), most));
        let lists: Option<Vec<Vec<T>>> = lists.collect();
        lists
            .filter(|lists| lists.len() <= 2)
            .map(PerDirection)
            .ok_or_else(|| {
                format!(
                    "write 1 to {most} numbers from {low} to {high} with commas between them, or such a list for vertical and \
                     one for horizontal fringes with a / between them"
                )
            })
    }
}

/// A lower number and a higher one with a comma between them, each from -`most` to `most`.
pub fn range(most: f64) -> impl TypedValueParser<Value = [f64; 2]> {
    move |text: &str| {
        let ends = text.split_once(',');
        let ends = ends.and_then(|(low, high)| {
            Some([low.trim().parse::<f64>().ok()?, high.trim().parse().ok()?])
        });
        ends.filter(|[low, high]| low < high && -most <= *low && *high <= most)
            .ok_or_else(|| {
                format!("write a lower and a higher number from -{most} to {most} with a comma between them")
            })
    }
}

/// Columns and rows of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size(pub u32, pub u32);

/// Columns and rows with an x between them.
pub fn size(text: &str) -> Result<Size, String> {
    let sides = text.split_once('x');
    let sides =
        sides.and_then(|(width, height)| Some(Size(width.parse().ok()?, height.parse().ok()?)));
    sides
        .filter(|Size(width, height)| {
            [width, height]
                .iter()
                .all(|side| (1..=MAX_SIDE).contains(*side))
        })
        .ok_or_else(|| format!("write columns and rows from 1 to {MAX_SIDE}, as 1280x800"))
}
