//! The four-quadrant arctangent in integers.

/// atan(t) / 2π = Σ cᵢ t^(2i+1) on 0 ≤ t ≤ 1, in units of 2⁻³² turn. Minimax fit (Lawson iteration),
/// largest error 3.9e-8 turn.
const ODD: [i64; 7] = [
    683_562_618,
    -227_745_959,
    135_399_348,
    -90_458_527,
    54_427_970,
    -22_970_672,
    4_656_303,
];

/// The angle atan2(s, c) in units of 1/65536 turn, rounded to nearest.
///
/// `s` and `c` share any scale. `atan2_u16(0, 0)` is 0 (such a pixel has no modulation and is
/// rejected). Error: half a unit (7.63e-6 turn) plus 1e-7 turn; RMS 4.4e-6 turn
/// (`the_arctangent_is_within_half_a_unit_of_the_true_angle`).
#[inline]
pub fn atan2_u16(s: i32, c: i32) -> u16 {
    let (rise, run) = (u64::from(s.unsigned_abs()), u64::from(c.unsigned_abs()));
    let (low, high) = if rise > run { (run, rise) } else { (rise, run) };
    if high == 0 {
        return 0;
    }
    // t = low / high as Q31; 0 ≤ t ≤ 2³¹ because low ≤ high < 2³².
    let t = ((low << 31) / high) as i64;
    let square = (t * t) >> 31;
    let mut sum = ODD[6];
    // |sum| < 2³⁰ and square ≤ 2³¹: every product fits 62 bits.
    for coefficient in ODD[..6].iter().rev() {
        sum = coefficient + ((sum * square) >> 31);
    }
    let eighth = (sum * t) >> 31;
    let quarter = if rise > run {
        (1 << 30) - eighth
    } else {
        eighth
    };
    let half = if c < 0 { (1 << 31) - quarter } else { quarter };
    let turn = if s < 0 { -half } else { half };
    ((turn + (1 << 15)) >> 16) as u16
}

#[cfg(test)]
mod tests {
    use super::atan2_u16;
    use core::f64::consts::TAU;

    /// Half a unit of 1/65536 turn, and the fit's and the truncations' share.
    const BOUND_TURNS: f64 = 0.5 / 65_536.0 + 1e-7;

    #[test]
    fn the_arctangent_is_within_half_a_unit_of_the_true_angle() {
        let (mut worst, mut squares, mut count) = (0.0_f64, 0.0_f64, 0.0_f64);
        // Every pair of differences that 8-bit samples can make with four steps.
        for s in -255..=255_i32 {
            for c in -255..=255_i32 {
                if s == 0 && c == 0 {
                    continue;
                }
                let truth = libm::atan2(f64::from(s), f64::from(c)) / TAU;
                let error = f64::from(atan2_u16(s << 20, c << 20)) / 65_536.0 - truth;
                let error = error - libm::rint(error);
                worst = worst.max(error.abs());
                squares += error * error;
                count += 1.0;
            }
        }
        let rms = libm::sqrt(squares / count);
        assert!(worst <= BOUND_TURNS, "worst {worst:e}");
        assert!(rms <= 4.6e-6, "rms {rms:e}");
    }

    #[test]
    fn axes_diagonals_and_extremes_are_exact() {
        assert_eq!(atan2_u16(0, 0), 0);
        assert_eq!(atan2_u16(0, 7), 0);
        assert_eq!(atan2_u16(7, 0), 0x4000);
        assert_eq!(atan2_u16(0, -7), 0x8000);
        assert_eq!(atan2_u16(-7, 0), 0xC000);
        assert_eq!(atan2_u16(5, 5), 0x2000);
        assert_eq!(atan2_u16(i32::MIN, i32::MIN), 0xA000);
        assert_eq!(atan2_u16(i32::MAX, i32::MIN), 0x6000);
    }
}
