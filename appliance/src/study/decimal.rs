//! A number as it is written, in decimal, so that a difference loses none of its digits.
//!
//! Values of a study often differ only in their last digits: 1000000000000.4 and 1000000000000.2 lose four of sixteen digits
//! if they are rounded to binary first (NIST StRD, *SmLs07*).

/// ± digits · 10^exponent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Decimal {
    digits: i128,
    exponent: i32,
}

/// Digits of a number at most: differences of two of them fit.
const MOST_DIGITS: u32 = 36;
/// Largest |exponent|, and with it what can still be rounded to binary.
const MOST_EXPONENT: i32 = 400;

impl Decimal {
    /// The number of a text, as `-1.25e-3`, also with a decimal comma; none of anything else, of more than
    /// 36 digits, or beyond the range of binary numbers of 64 bits.
    pub fn read(text: &str) -> Option<Self> {
        let (mantissa, exponent) = match text.split_once(['e', 'E']) {
            Some((mantissa, exponent)) => (mantissa, exponent.parse::<i32>().ok()?),
            None => (text, 0),
        };
        let unsigned = mantissa.strip_prefix(['-', '+']).unwrap_or(mantissa);
        let (whole, part) = unsigned.split_once(['.', ',']).unwrap_or((unsigned, ""));
        let all = || whole.bytes().chain(part.bytes());
        if !all().all(|byte| byte.is_ascii_digit()) || all().next().is_none() {
            return None;
        }
        let part = part.trim_end_matches('0');
        let mut digits: i128 = 0;
        for byte in whole.bytes().chain(part.bytes()) {
            digits = 10 * digits + i128::from(byte - b'0');
            if digits >= 10_i128.pow(MOST_DIGITS) {
                return None;
            }
        }
        let exponent = exponent.checked_sub(i32::try_from(part.len()).ok()?)?;
        let digits = if mantissa.starts_with('-') {
            -digits
        } else {
            digits
        };
        let read = Self {
            digits,
            exponent: if digits == 0 { 0 } else { exponent },
        };
        let in_range = read.exponent.abs() <= MOST_EXPONENT && read.to_f64().is_finite();
        in_range.then_some(read)
    }

    /// The shortest decimal number that is rounded to this one; none if it is not finite.
    pub fn of(number: f64) -> Option<Self> {
        Self::read(&format!("{number:e}"))
    }

    /// Rounded to binary.
    pub fn to_f64(self) -> f64 {
        // Below both bounds digits and power of ten are exact, and one operation rounds once.
        let Self { digits, exponent } = self;
        if digits.unsigned_abs() < 1 << 53 && (-22..=22).contains(&exponent) {
            let power = 10_f64.powi(exponent.abs());
            return if exponent < 0 {
                digits as f64 / power
            } else {
                digits as f64 * power
            };
        }
        format!("{digits}e{exponent}").parse().unwrap_or(f64::NAN)
    }

    /// `self` − `other`, rounded to binary once; where their digits lie too far apart, rounded before.
    pub fn minus(self, other: Self) -> f64 {
        let exponent = self.exponent.min(other.exponent);
        let at = |number: Self| {
            let power = 10_i128.checked_pow(number.exponent.abs_diff(exponent))?;
            number.digits.checked_mul(power)
        };
        let difference = at(self).zip(at(other)).and_then(|(a, b)| a.checked_sub(b));
        match difference {
            Some(digits) => Self { digits, exponent }.to_f64(),
            None => self.to_f64() - other.to_f64(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_written_and_nothing_else_is() {
        for (text, number) in [
            ("0.29", 0.29),
            ("-,5", -0.5),
            ("+3.", 3.0),
            ("1e3", 1000.0),
            ("12,50E-1", 1.25),
            ("-0", 0.0),
            ("0.1e-300", 1e-301),
        ] {
            assert_eq!(
                Decimal::read(text).map(Decimal::to_f64),
                Some(number),
                "{text}"
            );
        }
        let long = "1".repeat(40);
        for text in [
            "",
            ".",
            "-",
            "1e",
            "1e400",
            "1e999999999999",
            "0x1",
            "1_0",
            "nan",
            "inf",
            "1.2.3",
            "1,2,3",
            "−1",
            " 1",
            "²",
            &long,
        ] {
            assert_eq!(Decimal::read(text), None, "{text}");
        }
    }

    #[test]
    fn a_difference_loses_no_digit() {
        let of = |text| Decimal::read(text).unwrap();
        assert_eq!(of("1000000000000.4").minus(of("1000000000000.2")), 0.2);
        assert_eq!(of("1e30").minus(of("1")), 1e30);
        assert_eq!(of("1e300").minus(of("1e-300")), 1e300);
        assert_eq!(Decimal::of(0.1).unwrap().minus(of("0.1")), 0.0);
        assert_eq!(Decimal::of(f64::NAN), None);
    }
}
