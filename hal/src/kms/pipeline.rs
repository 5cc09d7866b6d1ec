//! The display pipeline from a buffer to the projector: a plane, the CRTC that shows it, and the
//! connector, with settings that leave grey levels unchanged.
//!
//! A pattern is measured, not looked at: 0…255 must reach the projector as 0…255, pixel by pixel.
//! Drivers may scale, dither or convert colours for better pictures. A property is set only if the
//! driver has it with another value.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::path::PathBuf;

use drm::control::atomic::AtomicModeReq;
use drm::control::property::ValueType;
use drm::control::{AtomicCommitFlags, Device, Mode, crtc, property};

use super::card::{Canvas, Card, FORMAT, Properties, refused};
use super::find::{Timings, choose, crtc_for, no_mode, primary_plane, the_connector};
use crate::error::{DeviceKind, Error};
use crate::setup::ProjectorSetup;

/// Where the kernel shows the state of its connectors.
const CONNECTORS: &str = "/sys/class/drm";

/// As much of a display's description (EDID) as tells it from another: its first block. All zero
/// without a display that answers.
type Edid = [u8; 128];

/// A value by its name in a list of names, or a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wanted {
    Named(&'static str),
    Number(u64),
}

/// Properties of a connector by the kernel's names, grouped by driver.
const CONNECTOR: &[(&str, Wanted)] = &[
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
const CRTC: &[(&str, Wanted)] = &[
    ("DEGAMMA_LUT", Wanted::Number(0)),
    ("CTM", Wanted::Number(0)),
    ("GAMMA_LUT", Wanted::Number(0)),
    ("VRR_ENABLED", Wanted::Number(0)),
];

/// Properties of a plane: not rotated and opaque, whatever another program has set before.
const PLANE: &[(&str, Wanted)] = &[
    // The bit for 0°.
    ("rotation", Wanted::Number(1)),
    ("alpha", Wanted::Number(0xffff)),
];

/// A connector in its mode.
#[derive(Debug)]
pub(super) struct Pipeline {
    pub card: Card,
    pub crtc: crtc::Handle,
    pub timings: Timings,
    /// The kernel's name of the connector.
    name: String,
    mode: Mode,
    connector: Properties,
    crtc_properties: Properties,
    plane: Properties,
    /// The plane's property `FB_ID`: the framebuffer that it shows.
    framebuffer: property::Handle,
    /// The kernel's status file of the connector, which does not probe the display; none if there
    /// is no such file.
    status: Option<File>,
    /// The kernel's file of the display's description, and what it held when the mode was chosen.
    edid: Option<(File, Edid)>,
}

impl Pipeline {
    /// Finds the card, connector and mode of a setup, and becomes the card's master. Sets nothing
    /// yet.
    pub fn find(setup: &ProjectorSetup) -> Result<Self, Error> {
        let (card, connector) = the_connector(setup)?;
        card.own()?;
        let name = connector.to_string();
        let timings: Vec<Timings> = connector.modes().iter().map(Timings::of).collect();
        let chosen = choose(&timings, setup).ok_or_else(|| no_mode(&name, &timings, setup))?;
        let failed = |error| refused(format!("looking for a CRTC for {name}"), &error);
        let all = card.resource_handles().map_err(failed)?;
        let crtc = crtc_for(&card, &all, &connector)
            .map_err(failed)?
            .ok_or_else(|| {
                Error::unsupported(
                    format!("driving {name}"),
                    "unplug other displays of this card",
                )
            })?;
        let plane = primary_plane(&card, &all, crtc)?.ok_or_else(|| {
            Error::unsupported(
                format!("showing {} on {name}", FORMAT),
                "use a driver that has it",
            )
        })?;
        let file = |kind: &str| {
            let folder = format!("{}-{name}", card.path.file_name()?.to_string_lossy());
            File::open(PathBuf::from(CONNECTORS).join(folder).join(kind)).ok()
        };
        let status = file("status");
        let edid = file("edid").map(|file| {
            let known = described(&file);
            (file, known)
        });
        let plane = card.properties(plane)?;
        Ok(Self {
            crtc,
            timings: timings[chosen],
            mode: connector.modes()[chosen],
            connector: card.properties(connector.handle())?,
            crtc_properties: card.properties(crtc)?,
            framebuffer: plane.named("FB_ID")?,
            plane,
            status,
            edid,
            name,
            card,
        })
    }

    /// Checks that the projector is plugged in, by what the kernel knows; the display is not
    /// probed.
    pub fn present(&self, attempt: &str) -> Result<(), Error> {
        let Some(status) = &self.status else {
            return Ok(());
        };
        let mut text = [0; 16];
        let attempt = || format!("{attempt} on {}", self.name);
        match status.read_at(&mut text, 0) {
            Ok(_) if text.starts_with(b"disconnected") => {
                Err(Error::disconnected(DeviceKind::Projector, attempt()))
            }
            Ok(_) => Ok(()),
            Err(error) => Err(refused(attempt(), &error)),
        }
    }

    /// Checks that the display is the one whose modes are known. One that is switched on after the
    /// head was opened describes itself only then, and one of those modes may be the only one that
    /// it shows. The kernel reads the description on a hotplug.
    pub fn same_display(&self) -> Result<(), Error> {
        let now = self
            .edid
            .as_ref()
            .map(|(file, known)| (known, described(file)));
        match now {
            Some((known, now)) if now != [0; 128] && now != *known => Err(Error::Disconnected {
                device: DeviceKind::Projector,
                attempt: format!("showing {} on {}", self.timings, self.name),
                remedy: "another display answers there now, or the same one with other modes (EDID): the head is opened again with its modes"
                    .into(),
            }),
            _ => Ok(()),
        }
    }

    /// Sets the mode and shows `canvas`. Waits for the display.
    pub fn switch_on(&self, canvas: &Canvas) -> Result<(), Error> {
        let attempt = format!("setting {} on {}", self.timings, self.name);
        let failed = |error| refused(attempt.clone(), &error);
        let mode = self.card.create_property_blob(&self.mode).map_err(failed)?;
        let request = self.mode_request(mode.into(), canvas)?;
        let set = self.commit(AtomicCommitFlags::ALLOW_MODESET, request);
        if let property::Value::Blob(mode) = mode {
            let _ = self.card.destroy_property_blob(mode);
        }
        set.map_err(failed)
    }

    /// Shows another canvas with the next refresh; an event follows. Does not wait.
    pub fn flip(&self, canvas: &Canvas) -> io::Result<()> {
        let mut request = AtomicModeReq::new();
        request.add_raw_property(
            self.plane.object,
            self.framebuffer,
            u32::from(canvas.shown_as).into(),
        );
        self.commit(
            AtomicCommitFlags::NONBLOCK | AtomicCommitFlags::PAGE_FLIP_EVENT,
            request,
        )
    }

    /// Switches the connector off.
    pub fn switch_off(&self) -> Result<(), Error> {
        let mut request = AtomicModeReq::new();
        for (object, name) in [
            (&self.plane, "FB_ID"),
            (&self.plane, "CRTC_ID"),
            (&self.connector, "CRTC_ID"),
            (&self.crtc_properties, "MODE_ID"),
            (&self.crtc_properties, "ACTIVE"),
        ] {
            object.set(&mut request, name, 0)?;
        }
        let off = self.commit(AtomicCommitFlags::ALLOW_MODESET, request);
        off.map_err(|error| refused(format!("switching {} off", self.name), &error))
    }

    fn commit(&self, flags: AtomicCommitFlags, request: AtomicModeReq) -> io::Result<()> {
        self.card.atomic_commit(flags, request)
    }

    /// The commit that sets the mode. It also sets every property that would change grey levels to
    /// a neutral value, and removes everything else from the CRTC.
    fn mode_request(&self, mode: u64, canvas: &Canvas) -> Result<AtomicModeReq, Error> {
        let mut request = AtomicModeReq::new();
        let (width, height) = (
            u64::from(self.timings.width),
            u64::from(self.timings.height),
        );
        let crtc = u64::from(u32::from(self.crtc));
        // SRC: the part of the buffer, in 1/65536 pixels. CRTC: the place on the display, in
        // pixels.
        for (name, value) in [
            ("FB_ID", u32::from(canvas.shown_as).into()),
            ("CRTC_ID", crtc),
            ("SRC_X", 0),
            ("SRC_Y", 0),
            ("SRC_W", width << 16),
            ("SRC_H", height << 16),
            ("CRTC_X", 0),
            ("CRTC_Y", 0),
            ("CRTC_W", width),
            ("CRTC_H", height),
        ] {
            self.plane.set(&mut request, name, value)?;
        }
        self.connector.set(&mut request, "CRTC_ID", crtc)?;
        self.crtc_properties.set(&mut request, "MODE_ID", mode)?;
        self.crtc_properties.set(&mut request, "ACTIVE", 1)?;
        self.be_faithful(&mut request);
        self.be_alone(&mut request)?;
        Ok(request)
    }

    /// Sets the properties that would change grey levels, such as gamma or scaling, to neutral
    /// values.
    fn be_faithful(&self, request: &mut AtomicModeReq) {
        for (object, wanted) in [
            (&self.connector, CONNECTOR),
            (&self.crtc_properties, CRTC),
            (&self.plane, PLANE),
        ] {
            for property in object.all.iter().filter(|property| property.info.mutable()) {
                let value = neutral(wanted, &property.name, property.info.value_type());
                if let Some(value) = value.filter(|value| *value != property.value) {
                    request.add_raw_property(object.object, property.info.handle(), value);
                }
            }
        }
    }

    /// Removes cursors, overlays and other connectors from this CRTC.
    fn be_alone(&self, request: &mut AtomicModeReq) -> Result<(), Error> {
        let failed = |error| {
            refused(
                format!("looking for what else shows on {}", self.name),
                &error,
            )
        };
        let crtc = u64::from(u32::from(self.crtc));
        let planes = self.card.plane_handles().map_err(failed)?;
        let all = self.card.resource_handles().map_err(failed)?;
        let mut shown = Vec::new();
        for plane in planes {
            shown.push((self.card.properties(plane)?, &["FB_ID", "CRTC_ID"][..]));
        }
        for connector in all.connectors() {
            shown.push((self.card.properties(*connector)?, &["CRTC_ID"][..]));
        }
        for (object, names) in shown {
            let ours = object.object == self.plane.object || object.object == self.connector.object;
            let here = object
                .all
                .iter()
                .any(|property| property.name == "CRTC_ID" && property.value == crtc);
            if here && !ours {
                for name in names {
                    object.set(request, name, 0)?;
                }
            }
        }
        Ok(())
    }
}

/// The description in the kernel's file; zero if there is none.
fn described(file: &File) -> Edid {
    let mut edid = [0; 128];
    match file.read_at(&mut edid, 0) {
        Ok(128) => edid,
        _ => [0; 128],
    }
}

/// The value that a property should have, by one of the lists above; none if it does not matter or
/// the driver has no such value.
fn neutral(known: &[(&str, Wanted)], name: &str, kind: &ValueType) -> Option<u64> {
    let (_, wanted) = known.iter().find(|(known, _)| *known == name)?;
    match (wanted, kind) {
        (Wanted::Number(number), _) => Some(*number),
        (Wanted::Named(wanted), ValueType::Enum(values)) => {
            let (numbers, names) = values.values();
            let is_wanted = |name: &str| name.eq_ignore_ascii_case(wanted);
            let at = names
                .iter()
                .position(|value| value.name().to_str().is_ok_and(is_wanted))?;
            numbers.get(at).copied()
        }
        (Wanted::Named(_), _) => None,
    }
}
