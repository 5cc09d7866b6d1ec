//! Lists, ranges and sizes as values of options: each has bounds, which a refusal names.

use clap::builder::TypedValueParser;
use hal::bounds::MAX_SIDE;
use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// Numbers in a list of any length.
#[derive(Clone, Debug, PartialEq)]
pub struct Series<T>(pub Vec<T>);

/// A list for vertical fringes and one for horizontal ones, or one for both.
#[derive(Clone, Debug, PartialEq)]
pub struct PerDirection<T>(pub Vec<Vec<T>>);

impl<T> PerDirection<T> {
    /// The list of this direction.
    pub fn of(&self, vertical: bool) -> &[T] {
        let own = self.0.get(usize::from(!vertical)).or(self.0.last());
        own.map_or(&[], Vec::as_slice)
    }
}

/// The number for vertical or horizontal fringes of a list that has one for both, or one for each.
pub fn of_direction<T: Copy>(list: &Option<Series<T>>, vertical: bool) -> Option<T> {
    let Series(all) = list.as_ref()?;
    all.get(usize::from(!vertical)).or(all.last()).copied()
}

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
