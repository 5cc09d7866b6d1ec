//! Display settings with which a driver leaves grey levels unchanged.
//!
//! A pattern is measured, not looked at: 0…255 must reach the projector as 0…255, pixel by pixel.
//! Drivers may scale, dither or convert colours for better pictures. A property is set only if the
//! driver has it with another value.

use drm::control::property::ValueType;

/// A value by its name in a list of names, or a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wanted {
    Named(&'static str),
    Number(u64),
}

/// Properties of a connector by the kernel's names, grouped by driver.
pub(super) const CONNECTOR: &[(&str, Wanted)] = &[
    // Black is 0 and white is 255, also on television modes.
    ("Broadcast RGB", Wanted::Named("Full")),
    ("output_csc", Wanted::Named("bypass")),
    // No dithering.
    ("dithering mode", Wanted::Named("off")),
    ("dither", Wanted::Named("off")),
    // No borders and no scaling: pixel for pixel.
    ("left margin", Wanted::Number(0)),
    ("right margin", Wanted::Number(0)),
    ("top margin", Wanted::Number(0)),
    ("bottom margin", Wanted::Number(0)),
    ("underscan", Wanted::Named("off")),
    ("scaling mode", Wanted::Named("None")),
    ("Colorspace", Wanted::Named("Default")),
];

/// Properties of a CRTC: no look-up tables and colour matrices between buffer and connector, and a
/// constant refresh rate.
pub(super) const CRTC: &[(&str, Wanted)] = &[
    ("DEGAMMA_LUT", Wanted::Number(0)),
    ("CTM", Wanted::Number(0)),
    ("GAMMA_LUT", Wanted::Number(0)),
    ("VRR_ENABLED", Wanted::Number(0)),
];

/// Properties of a plane: not rotated and opaque, whatever another program has set before.
pub(super) const PLANE: &[(&str, Wanted)] = &[
    // The bit for 0°.
    ("rotation", Wanted::Number(1)),
    ("alpha", Wanted::Number(0xffff)),
];

/// The value that a property should have, by one of the lists above; none if it does not matter or
/// the driver has no such value.
pub(super) fn find(known: &[(&str, Wanted)], name: &str, kind: &ValueType) -> Option<u64> {
    let (_, wanted) = known.iter().find(|(known, _)| *known == name)?;
    match (wanted, kind) {
        (Wanted::Number(number), _) => Some(*number),
        (Wanted::Named(wanted), ValueType::Enum(values)) => {
            let (numbers, names) = values.values();
            let is_it = |name: &str| name.eq_ignore_ascii_case(wanted);
            let at = names
                .iter()
                .position(|value| value.name().to_str().is_ok_and(is_it))?;
            numbers.get(at).copied()
        }
        (Wanted::Named(_), _) => None,
    }
}
