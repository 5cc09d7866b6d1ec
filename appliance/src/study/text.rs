//! Figures and verdicts as text, as people read them.

/// A number with five digits, as people read it.
pub fn short(number: f64) -> String {
    rounded(number, 5)
}

/// A number with so many digits.
pub fn rounded(number: f64, digits: u8) -> String {
    let size = number.abs();
    if number != 0.0 && !(1e-4..1e7).contains(&size) {
        return format!("{number:.3e}");
    }
    let before = if number == 0.0 {
        0
    } else {
        size.log10().floor() as i32
    };
    let places = usize::try_from(i32::from(digits) - 1 - before).unwrap_or(0);
    let text = format!("{number:.places$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// The same of a figure that may not be defined.
pub fn shown(figure: Option<f64>) -> String {
    figure.map_or_else(|| "not defined".into(), short)
}

/// A characteristic with its unit.
pub fn titled(name: &str, unit: &str) -> String {
    match unit {
        "" => name.to_owned(),
        unit => format!("{name} [{unit}]"),
    }
}
