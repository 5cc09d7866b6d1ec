//! Finding the projector's connector, its mode (size and refresh rate as asked for, or the preferred
//! one), and the CRTC and plane that can drive it.

use std::time::Duration;
use std::{fmt, io};

use drm::control::connector::{Info, Interface, State};
use drm::control::{
    Device, Mode, ModeFlags, ModeTypeFlags, PlaneType, ResourceHandles, crtc, plane,
};

use super::card::{Card, FORMAT, listed, paths, refused};
use crate::error::{DeviceKind, Error};
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

/// The connector that a setup names, or the only one that is connected.
pub(super) fn the_connector(setup: &ProjectorSetup) -> Result<(Card, Info), Error> {
    let cards = setup.card.clone().map_or_else(paths, |card| vec![card]);
    let (mut there, mut fitting, mut closed) = (Vec::new(), Vec::new(), None);
    for path in &cards {
        let card = match Card::open(path) {
            Ok(Some(card)) => card,
            Ok(None) => continue,
            Err(error) => {
                closed = Some(error);
                continue;
            }
        };
        let failed = |error| {
            refused(
                format!("listing the connectors of {}", path.display()),
                &error,
            )
        };
        let mut on_card = Vec::new();
        for handle in card.resource_handles().map_err(failed)?.connectors() {
            let connector = card.get_connector(*handle, true).map_err(failed)?;
            if connector.interface() == Interface::Writeback {
                continue;
            }
            there.push(connector.to_string());
            let wanted = match &setup.connector {
                Some(name) => *name == connector.to_string(),
                None => connector.state() == State::Connected,
            };
            if wanted {
                on_card.push(connector);
            }
        }
        fitting.extend((!on_card.is_empty()).then_some((card, on_card)));
    }
    let attempt = match &setup.connector {
        Some(name) => format!("finding the projector at {name}"),
        None => "finding the projector".into(),
    };
    let choices: Vec<String> = fitting
        .iter()
        .flat_map(|(card, on_card)| {
            on_card
                .iter()
                .map(|c| format!("{c} of {}", card.path.display()))
        })
        .collect();
    if choices.len() > 1 {
        return Err(Error::unsupported(
            format!("{attempt} among several displays"),
            format!("name card and connector: there {}", listed(&choices)),
        ));
    }
    let Some((card, connector)) = fitting
        .pop()
        .and_then(|(card, mut on_card)| Some((card, on_card.pop()?)))
    else {
        return Err(match (closed, &setup.connector) {
            (Some(error), _) => error,
            (None, None) if !there.is_empty() => Error::disconnected(
                DeviceKind::Projector,
                format!("{attempt} (there {}, all empty)", listed(&there)),
            ),
            (None, _) => {
                Error::unsupported(attempt, format!("of connectors, there {}", listed(&there)))
            }
        });
    };
    if connector.state() == State::Disconnected {
        return Err(Error::disconnected(DeviceKind::Projector, attempt));
    }
    Ok((card, connector))
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

/// The error when no mode fits; it lists the modes.
pub(super) fn no_mode(name: &str, modes: &[Timings], setup: &ProjectorSetup) -> Error {
    let asked = |number: Option<u32>| number.map_or("any".into(), |number| number.to_string());
    let rate = setup
        .refresh_hz
        .map_or("any rate".into(), |hertz| format!("{hertz} Hz"));
    let all: Vec<String> = modes
        .iter()
        .filter(|mode| mode.progressive)
        .map(ToString::to_string)
        .collect();
    Error::unsupported(
        format!(
            "showing {}×{} at {rate} on {name}",
            asked(setup.width),
            asked(setup.height)
        ),
        format!(
            "there {}; add another one with video={name}:WIDTHxHEIGHT@RATE on the kernel's command line",
            listed(&all)
        ),
    )
}

/// The CRTC that drives this connector now, or else one that drives no other.
pub(super) fn crtc_for(
    card: &Card,
    all: &ResourceHandles,
    connector: &Info,
) -> io::Result<Option<crtc::Handle>> {
    let mut taken = Vec::new();
    for neighbour in all
        .connectors()
        .iter()
        .filter(|handle| **handle != connector.handle())
    {
        if let Some(encoder) = card.get_connector(*neighbour, false)?.current_encoder() {
            taken.extend(card.get_encoder(encoder)?.crtc());
        }
    }
    let mut possible = Vec::new();
    for encoder in connector.encoders() {
        let encoder = card.get_encoder(*encoder)?;
        let driven = encoder
            .crtc()
            .filter(|_| connector.current_encoder() == Some(encoder.handle()));
        if driven.is_some() {
            return Ok(driven);
        }
        possible.extend(all.filter_crtcs(encoder.possible_crtcs()));
    }
    Ok(possible
        .iter()
        .find(|crtc| !taken.contains(crtc))
        .or(possible.first())
        .copied())
}

/// The primary plane of a CRTC, if it supports our pixel format.
pub(super) fn primary_plane(
    card: &Card,
    all: &ResourceHandles,
    crtc: crtc::Handle,
) -> Result<Option<plane::Handle>, Error> {
    let failed = |error| {
        refused(
            format!("listing the planes of {}", card.path.display()),
            &error,
        )
    };
    for handle in card.plane_handles().map_err(failed)? {
        let plane = card.get_plane(handle).map_err(failed)?;
        if all.filter_crtcs(plane.possible_crtcs()).contains(&crtc)
            && plane.formats().contains(&(FORMAT as u32))
            && card.properties(handle)?.is(PlaneType::Primary)
        {
            return Ok(Some(handle));
        }
    }
    Ok(None)
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
