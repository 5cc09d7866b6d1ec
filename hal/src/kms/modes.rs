//! Choosing one of a connector's modes: size and refresh rate as asked for, or the preferred mode.

use std::fmt;
use std::time::Duration;

use drm::control::{Mode, ModeFlags, ModeTypeFlags};

use crate::setup::ProjectorSetup;

/// A mode fits if its rate differs by at most this share from the rate asked for. Modes are named
/// by rounded rates: 59.94 Hz is called 60, and so is the 60.32 Hz of the VESA mode 800×600, the
/// largest difference (0.53 %). Different rates are at least 4 % apart (24 and 25).
const NEAR: f64 = 0.01;

/// Size and timing of a mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Timings {
    pub width: u32,
    pub height: u32,
    /// From one refresh to the next.
    pub period: Duration,
    /// Whether the display's own description (EDID) prefers it.
    pub preferred: bool,
    /// Not interlaced.
    pub progressive: bool,
}

impl Timings {
    pub fn of(mode: &Mode) -> Self {
        let (width, height) = mode.size();
        let pixels = u64::from(mode.hsync().2) * u64::from(mode.vsync().2);
        let lines = u64::from(mode.vscan().max(1))
            * (1 + u64::from(mode.flags().contains(ModeFlags::DBLSCAN)));
        // The clock is in kHz.
        let nanoseconds = (pixels * lines * 1_000_000).checked_div(u64::from(mode.clock()));
        Self {
            width: width.into(),
            height: height.into(),
            period: Duration::from_nanos(nanoseconds.unwrap_or(0)),
            preferred: mode.mode_type().contains(ModeTypeFlags::PREFERRED),
            progressive: !mode.flags().contains(ModeFlags::INTERLACE) && nanoseconds.is_some(),
        }
    }

    fn hertz(&self) -> f64 {
        1.0 / self.period.as_secs_f64()
    }

    fn fits(&self, setup: &ProjectorSetup) -> bool {
        let near = |wanted: f64| (self.hertz() / wanted - 1.0).abs() <= NEAR;
        self.progressive
            && setup.width.is_none_or(|width| width == self.width)
            && setup.height.is_none_or(|height| height == self.height)
            && setup.refresh_hz.is_none_or(near)
    }
}

impl fmt::Display for Timings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { width, height, .. } = self;
        write!(f, "{width}×{height} at {:.2} Hz", self.hertz())
    }
}

/// The index of the mode to use: among the modes that fit, the nearest to the rate asked for;
/// without a rate the preferred one, else the first. None if no mode fits.
pub(super) fn choose(modes: &[Timings], setup: &ProjectorSetup) -> Option<usize> {
    let off = |mode: &Timings| {
        setup
            .refresh_hz
            .map_or(0.0, |wanted| (mode.hertz() - wanted).abs())
    };
    let fitting = modes
        .iter()
        .enumerate()
        .filter(|(_, mode)| mode.fits(setup));
    fitting
        .min_by(|(_, a), (_, b)| {
            off(a)
                .total_cmp(&off(b))
                .then(b.preferred.cmp(&a.preferred))
        })
        .map(|(index, _)| index)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mode(width: u32, height: u32, hertz: f64, preferred: bool) -> Timings {
        Timings {
            width,
            height,
            period: Duration::from_secs_f64(1.0 / hertz),
            preferred,
            progressive: true,
        }
    }

    fn setup(width: Option<u32>, height: Option<u32>, refresh_hz: Option<f64>) -> ProjectorSetup {
        ProjectorSetup {
            width,
            height,
            refresh_hz,
            ..ProjectorSetup::default()
        }
    }

    fn modes() -> Vec<Timings> {
        vec![
            mode(1920, 1080, 60.0, false),
            mode(1280, 720, 60.0, true),
            mode(1280, 720, 59.94, false),
            mode(1280, 720, 119.88, false),
            mode(1280, 800, 59.81, false),
        ]
    }

    #[test]
    fn without_a_wish_the_preferred_mode_is_used_and_without_one_the_first() {
        assert_eq!(choose(&modes(), &setup(None, None, None)), Some(1));
        let none_preferred: Vec<_> = modes()
            .into_iter()
            .map(|m| Timings {
                preferred: false,
                ..m
            })
            .collect();
        assert_eq!(choose(&none_preferred, &setup(None, None, None)), Some(0));
    }

    #[test]
    fn the_mode_nearest_to_the_rate_that_was_asked_for_is_used() {
        let at = |hertz| choose(&modes(), &setup(Some(1280), Some(720), Some(hertz)));
        assert_eq!(at(60.0), Some(1));
        assert_eq!(at(59.94), Some(2));
        assert_eq!(at(120.0), Some(3));
        assert_eq!(
            choose(&modes(), &setup(None, Some(800), Some(60.0))),
            Some(4)
        );
    }

    #[test]
    fn a_mode_that_the_connector_does_not_have_is_not_replaced_by_another() {
        assert_eq!(
            choose(&modes(), &setup(Some(1280), Some(720), Some(50.0))),
            None
        );
        assert_eq!(choose(&modes(), &setup(Some(1024), None, None)), None);
        assert_eq!(choose(&modes(), &setup(None, None, Some(f64::NAN))), None);
        let interlaced = Timings {
            progressive: false,
            ..mode(1920, 1080, 60.0, true)
        };
        assert_eq!(choose(&[interlaced], &setup(None, None, None)), None);
    }
}
