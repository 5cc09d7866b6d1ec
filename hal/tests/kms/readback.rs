//! Reading back pixel by pixel what the virtual display shows, through the descriptor of the client
//! that shows it.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::thread::sleep;
use std::time::Duration;

use drm::buffer::{Buffer, DrmFourcc};
use drm::control::atomic::AtomicModeReq;
use drm::control::connector::{self, Interface};
use drm::control::{
    AtomicCommitFlags, Device as ControlDevice, RawResourceHandle, ResourceHandle, property,
};
use drm::{ClientCapability, Device};

/// Longer than the virtual display takes to compose a picture.
const COMPOSED: Duration = Duration::from_secs(2);

/// The client of a display, whose properties and picture can be read back.
pub struct Client(OwnedFd);

impl AsFd for Client {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

impl Device for Client {}
impl ControlDevice for Client {}

impl Client {
    pub fn of(descriptor: OwnedFd) -> Self {
        let client = Self(descriptor);
        client
            .set_client_capability(ClientCapability::WritebackConnectors, true)
            .unwrap();
        client
    }

    fn connector(&self, writeback: bool) -> connector::Info {
        let all = self.resource_handles().unwrap();
        let mut infos = all
            .connectors()
            .iter()
            .map(|handle| self.get_connector(*handle, false).unwrap());
        infos
            .find(|info| (info.interface() == Interface::Writeback) == writeback)
            .unwrap()
    }

    fn of_object<H: ResourceHandle>(&self, object: H) -> Vec<(String, property::Handle, u64)> {
        let values = self.get_properties(object).unwrap();
        let named = values.iter().map(|(handle, value)| {
            let name = self
                .get_property(*handle)
                .unwrap()
                .name()
                .to_str()
                .unwrap()
                .to_owned();
            (name, *handle, *value)
        });
        named.collect()
    }

    /// The object that has a property of this name, the property and its value: the display's
    /// connector or its plane.
    fn named(&self, name: &str) -> (RawResourceHandle, property::Handle, u64) {
        let connector = self.connector(false).handle();
        let planes = self.plane_handles().unwrap();
        let of_connector = self.of_object(connector).into_iter();
        let of_plane = self.of_object(planes[0]).into_iter();
        let all = of_connector
            .map(|found| (connector.into(), found))
            .chain(of_plane.map(|found| (planes[0].into(), found)));
        let mut all = all.filter(|(_, (known, ..))| known == name);
        let (object, (_, handle, value)) = all.next().unwrap();
        (object, handle, value)
    }

    /// The value of a property of the display's connector or plane.
    pub fn property(&self, name: &str) -> u64 {
        self.named(name).2
    }

    /// Sets a property of the display's connector or plane.
    pub fn set(&self, name: &str, value: u64) {
        let (object, handle, _) = self.named(name);
        let mut request = AtomicModeReq::new();
        request.add_raw_property(object, handle, value);
        self.atomic_commit(AtomicCommitFlags::ALLOW_MODESET, request)
            .unwrap();
    }

    /// Buffers that are shown or could be.
    pub fn framebuffers(&self) -> usize {
        self.resource_handles().unwrap().framebuffers().len()
    }

    /// Whether a CRTC has a mode, so that the display is on.
    pub fn is_on(&self) -> bool {
        let all = self.resource_handles().unwrap();
        all.crtcs()
            .iter()
            .any(|crtc| self.get_crtc(*crtc).unwrap().mode().is_some())
    }

    /// The picture that is shown now, as grey levels; fails where red, green and blue differ.
    pub fn picture(&self, (width, height): (u32, u32)) -> Vec<u8> {
        let connector = self.connector(true).handle();
        let crtc: RawResourceHandle = self.resource_handles().unwrap().crtcs()[0].into();
        let mut buffer = self
            .create_dumb_buffer((width, height), DrmFourcc::Xrgb8888, 32)
            .unwrap();
        self.map_dumb_buffer(&mut buffer).unwrap().fill(0xEE);
        let shown_as = self.add_framebuffer(&buffer, 24, 32).unwrap();
        let mut request = AtomicModeReq::new();
        for (name, handle, _) in self.of_object(connector) {
            match name.as_str() {
                "CRTC_ID" => {
                    request.add_raw_property(connector.into(), handle, u32::from(crtc).into())
                }
                "WRITEBACK_FB_ID" => {
                    request.add_raw_property(connector.into(), handle, u32::from(shown_as).into());
                }
                _ => (),
            }
        }
        self.atomic_commit(AtomicCommitFlags::ALLOW_MODESET, request)
            .unwrap();
        sleep(COMPOSED);
        let pitch = buffer.pitch() as usize;
        let memory = self.map_dumb_buffer(&mut buffer).unwrap();
        let rows = memory.chunks(pitch).take(height as usize);
        let pixels = rows.flat_map(|row| row[..width as usize * 4].chunks(4));
        let grey = pixels.map(|pixel| {
            assert!(
                pixel[0] == pixel[1] && pixel[1] == pixel[2],
                "coloured: {pixel:?}"
            );
            pixel[0]
        });
        let grey = grey.collect();
        drop(memory);
        self.detach(connector);
        self.destroy_framebuffer(shown_as).unwrap();
        self.destroy_dumb_buffer(buffer).unwrap();
        grey
    }

    fn detach(&self, connector: connector::Handle) {
        let mut request = AtomicModeReq::new();
        for (name, handle, _) in self.of_object(connector) {
            if name == "CRTC_ID" {
                request.add_raw_property(connector.into(), handle, 0);
            }
        }
        self.atomic_commit(AtomicCommitFlags::ALLOW_MODESET, request)
            .unwrap();
    }
}
