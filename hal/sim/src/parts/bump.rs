//! A smooth, round elevation: the profile of dents and beads.

/// cos² from 1 at distance 0 to 0 at `half_width`, smooth at both; its slope is at most π / (2 ·
/// half_width).
pub(super) fn bump(distance: f64, half_width: f64) -> f64 {
    if distance >= half_width {
        return 0.0;
    }
    let cos = (std::f64::consts::FRAC_PI_2 * distance / half_width).cos();
    cos * cos
}

/// The largest slope of [`bump`], multiplied by the half-width.
pub(super) const BUMP_SLOPE: f64 = std::f64::consts::FRAC_PI_2;
