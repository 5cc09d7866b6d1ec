//! Numbers made of numbers, and numbers as text, both cheap.

/// A number that looks random, of another: SplitMix64 (Steele, Lea and Flood, OOPSLA 2014).
pub(super) fn mixed(number: u64) -> u64 {
    let mut z = number.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The sum of the number's four 16-bit parts, less its mean: about normal, with a standard deviation
/// of [`SPREAD`].
pub(super) fn bell(number: u64) -> i64 {
    let sum =
        (number & 0xffff) + (number >> 16 & 0xffff) + (number >> 32 & 0xffff) + (number >> 48);
    sum as i64 - 131_070
}

/// √(4 · 65536² / 12).
pub(super) const SPREAD: i64 = 37_837;

/// Appends a whole number.
pub(super) fn push_whole(out: &mut Vec<u8>, number: u64) {
    let mut digits = [0; 20];
    let mut from = digits.len();
    let mut rest = number;
    loop {
        from -= 1;
        digits[from] = b'0' + (rest % 10) as u8;
        rest /= 10;
        if rest == 0 {
            break;
        }
    }
    out.extend_from_slice(&digits[from..]);
}

/// Appends a number of millionths as a decimal number without zeros at its end.
pub(super) fn push_millionths(out: &mut Vec<u8>, number: i64) {
    if number < 0 {
        out.push(b'-');
    }
    let (whole, mut part) = (
        number.unsigned_abs() / 1_000_000,
        number.unsigned_abs() % 1_000_000,
    );
    push_whole(out, whole);
    if part == 0 {
        return;
    }
    out.push(b'.');
    let mut place = 100_000;
    while part > 0 {
        out.push(b'0' + (part / place) as u8);
        part %= place;
        place /= 10;
    }
}

/// A number of millionths as text.
pub(super) fn millionths(number: i64) -> String {
    let mut out = Vec::new();
    push_millionths(&mut out, number);
    String::from_utf8_lossy(&out).into_owned()
}
