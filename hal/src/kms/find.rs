//! Finding the projector's connector, and the CRTC and plane that can drive it.

use std::io;

use drm::control::connector::{Info, Interface, State};
use drm::control::{Device, PlaneType, ResourceHandles, crtc, plane};

use super::canvas;
use super::card::{Card, listed, paths, refused};
use super::modes::Timings;
use crate::error::{self, Error};
use crate::setup::ProjectorSetup;

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
        let mut of_card = Vec::new();
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
                of_card.push(connector);
            }
        }
        fitting.extend((!of_card.is_empty()).then_some((card, of_card)));
    }
    let attempt = match &setup.connector {
        Some(name) => format!("finding the projector at {name}"),
        None => "finding the projector".into(),
    };
    let choices: Vec<String> = fitting
        .iter()
        .flat_map(|(card, of_card)| {
            of_card
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
        .and_then(|(card, mut of_card)| Some((card, of_card.pop()?)))
    else {
        return Err(match (closed, &setup.connector) {
            (Some(error), _) => error,
            (None, None) if !there.is_empty() => Error::disconnected(
                error::DeviceKind::Projector,
                format!("{attempt} (there {}, all empty)", listed(&there)),
            ),
            (None, _) => {
                Error::unsupported(attempt, format!("of connectors, there {}", listed(&there)))
            }
        });
    };
    if connector.state() == State::Disconnected {
        return Err(Error::disconnected(error::DeviceKind::Projector, attempt));
    }
    Ok((card, connector))
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
    for other in all
        .connectors()
        .iter()
        .filter(|other| **other != connector.handle())
    {
        if let Some(encoder) = card.get_connector(*other, false)?.current_encoder() {
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
            && plane.formats().contains(&(canvas::FORMAT as u32))
            && card.properties(handle)?.is(PlaneType::Primary)
        {
            return Ok(Some(handle));
        }
    }
    Ok(None)
}
