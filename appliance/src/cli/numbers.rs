//! Numbers on the command line: each has bounds, which a refusal names.

use crate::measure::layout::PerDirection;
use clap::builder::TypedValueParser;
use hal::bounds::MAX_SIDE;
use std::fmt::Display;
use std::net::SocketAddr;
use std::str::FromStr;

/// A number from `low` to `high`; NaN is refused.
pub fn number<T>(low: T, high: T) -> impl TypedValueParser<Value = T>
where
    T: FromStr + PartialOrd + Display + Copy + Send + Sync + 'static,
{
    move |text: &str| {
        let number = text.parse().ok();
        number
            .filter(|number| (low..=high).contains(number))
            .ok_or_else(|| format!("write a number from {low} to {high}"))
    }
}

/// Numbers with commas between them, at most `most`, each from `low` to `high`.
fn list<T: FromStr + PartialOrd>(text: &str, low: T, high: T, most: usize) -> Option<Vec<T>> {
    let numbers = text.split(',').map(|number| number.trim().parse().ok());
    let numbers: Option<Vec<T>> = numbers.collect();
    numbers.filter(|all| {
        all.len() <= most && all.iter().all(|number| (&low..=&high).contains(&number))
    })
}

/// `N` numbers with commas between them, each from -`most` to `most`.
pub fn numbers<const N: usize>(most: f64) -> impl TypedValueParser<Value = [f64; N]> {
    move |text: &str| {
        list(text, -most, most, N)
            .and_then(|numbers| <[f64; N]>::try_from(numbers).ok())
            .ok_or_else(|| {
                format!("write {N} numbers from -{most} to {most} with commas between them")
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
        list(text, low, high, most).map(Series).ok_or_else(|| {
            format!("write 1 to {most} numbers from {low} to {high} with commas between them")
        })
    }
}

/// A series for vertical fringes and one for horizontal ones with a / between them, or one for both.
pub fn directions<T>(low: T, high: T, most: usize) -> impl TypedValueParser<Value = PerDirection<T>>
where
    T: FromStr + PartialOrd + Display + Copy + Send + Sync + 'static,
{
    move |text: &str| {
        let lists = text.split('/').map(|text| list(text, low, high, most));
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

/// An address with its port.
pub fn address(text: &str) -> Result<SocketAddr, &'static str> {
    text.parse()
        .map_err(|_| "write an address and a port from 0 to 65535, as 127.0.0.1:8080")
}
