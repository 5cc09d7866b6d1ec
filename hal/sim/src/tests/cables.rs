//! A head whose devices are unplugged.

use super::{PATIENT, frames, small};
use crate::parts::Plane;
use crate::{Part, head};
use hal::error::{DeviceKind, ErrorKind};

#[test]
fn a_device_that_is_pulled_out_is_gone_until_the_head_is_opened_again() {
    for device in [DeviceKind::Camera, DeviceKind::Projector] {
        let (mut lost, stage) = head(&small(Part::Plane(Plane::default()))).unwrap();
        assert_eq!(frames(&mut lost, &[0, 255]).len(), 2);
        assert_eq!(lost.present(), Ok(()));
        stage.unplug(device);
        let gone = lost.acquire(&[0], PATIENT, &mut |_, _| ()).unwrap_err();
        assert_eq!(gone.kind(), ErrorKind::Disconnected);
        assert!(gone.to_string().contains(device.word()), "{gone}");
        assert_eq!(lost.present().unwrap_err().kind(), ErrorKind::Disconnected);
        assert!(stage.reopen().is_err(), "nothing to open");
        stage.plug(device);
        assert!(
            lost.acquire(&[0], PATIENT, &mut |_, _| ()).is_err(),
            "what was opened before stays dead"
        );
        let mut found = stage.reopen().unwrap();
        assert_eq!(frames(&mut found, &[0, 255]).len(), 2);
        assert!(lost.present().is_err() && found.present().is_ok());
    }
}

#[test]
fn a_projector_that_lost_its_power_has_lost_its_patterns() {
    let (mut lost, stage) = head(&small(Part::Plane(Plane::default()))).unwrap();
    frames(&mut lost, &[0, 255]);
    stage.unplug(DeviceKind::Projector);
    stage.plug(DeviceKind::Projector);
    let mut found = stage.reopen().unwrap();
    let error = found.acquire(&[0], PATIENT, &mut |_, _| ()).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Protocol);
}
