//! Numbers on the command line: each has bounds, which a refusal names.

use clap::builder::TypedValueParser;
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

/// `N` numbers with commas between them, each from -`most` to `most`.
pub fn numbers<const N: usize>(most: f64) -> impl TypedValueParser<Value = [f64; N]> {
    move |text: &str| {
        let numbers = text.split(',').map(|number| number.trim().parse().ok());
        let numbers: Option<Vec<f64>> = numbers.collect();
        numbers
            .and_then(|numbers| <[f64; N]>::try_from(numbers).ok())
            .filter(|numbers| numbers.iter().all(|number| number.abs() <= most))
            .ok_or_else(|| {
                format!("write {N} numbers from -{most} to {most} with commas between them")
            })
    }
}

/// An address with its port.
pub fn address(text: &str) -> Result<SocketAddr, &'static str> {
    text.parse()
        .map_err(|_| "write an address and a port from 0 to 65535, as 127.0.0.1:8080")
}
