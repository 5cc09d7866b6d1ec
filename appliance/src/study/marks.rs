//! Shewhart's marks: values that a process without a cause rarely has (Nelson 1984).
//!
//! All eight tests at once ring too often without a cause (four of them every 92 values on average, Champ and Woodall 1987),
//! so only the first two are asked for by default. A trend of six here is seven values, as it takes six steps, and fourteen
//! alternations take fifteen values. A value is marked where it completes what a test looks for.

use serde::Serialize;

/// The tests that are used unless others are asked for.
pub const USUAL: [u8; 2] = [1, 2];

/// A value that stands out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Mark {
    /// The number of the test, 1 to 8.
    pub test: u8,
    /// Its place among the values, from 1 on.
    pub position: usize,
    /// Its result's SEQ, or the line.
    pub at: u64,
    /// The value.
    pub value: f64,
}

/// What a test looks for.
pub const fn words(test: u8) -> &'static str {
    match test {
        1 => "beyond 3 σ",
        2 => "nine in a row on one side",
        3 => "six steps in a row in one direction",
        4 => "fourteen steps in a row that alternate",
        5 => "two of three beyond 2 σ on one side",
        6 => "four of five beyond 1 σ on one side",
        7 => "fifteen in a row within 1 σ",
        _ => "eight in a row beyond 1 σ on either side",
    }
}

/// The marks of these tests on values as distances from the mean in σ: places from 0 on, and the test, in this order.
pub fn of(distances: &[f64], tests: &[u8]) -> Vec<(usize, u8)> {
    let marked = |at: usize| {
        tests
            .iter()
            .filter(move |test| is_marked(&distances[..=at], **test))
            .map(move |test| (at, *test))
    };
    (0..distances.len()).flat_map(marked).collect()
}

/// Whether the last of these values, of which at least the last fifteen are there, completes what a test looks for.
pub fn is_marked(distances: &[f64], test: u8) -> bool {
    let last = |n: usize| {
        distances
            .len()
            .checked_sub(n)
            .map(|from| &distances[from..])
    };
    let all =
        |n: usize, is: &dyn Fn(f64) -> bool| last(n).is_some_and(|few| few.iter().all(|x| is(*x)));
    // So many of the last n, one of which is the last value itself, on its side.
    let most = |count: usize, n: usize, beyond: f64| {
        let Some((&x, few)) = distances.last().zip(last(n).or(Some(distances))) else {
            return false;
        };
        let beside = few.iter().filter(|y| **y * x.signum() > beyond).count();
        x.abs() > beyond && beside >= count
    };
    let steps = |n: usize| {
        last(n + 1).map(|few| {
            few.windows(2)
                .map(|pair| pair[1] - pair[0])
                .collect::<Vec<_>>()
        })
    };
    match test {
        1 => all(1, &|x| x.abs() > 3.0),
        2 => all(9, &|x| x > 0.0) || all(9, &|x| x < 0.0),
        3 => steps(6)
            .is_some_and(|steps| steps.iter().all(|d| *d > 0.0) || steps.iter().all(|d| *d < 0.0)),
        4 => steps(14).is_some_and(|steps| steps.windows(2).all(|pair| pair[0] * pair[1] < 0.0)),
        5 => most(2, 3, 2.0),
        6 => most(4, 5, 1.0),
        7 => all(15, &|x| x.abs() < 1.0),
        8 => all(8, &|x| x.abs() > 1.0),
        _ => false,
    }
}
