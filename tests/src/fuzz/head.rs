//! Targets for the files that describe a station: calibration, OpenCV models, scenario,
//! configuration.

use super::bounded;
use appliance::config::Config;
use appliance::head::calibration::Calibration;
use appliance::head::calibration::file::CalibrationFile;
use appliance::head::calibration::opencv::{self, Declared, Sizes, Unit};
use hal::model::DeviceModel;
use sim::Scenario;
use std::fs;
use tempfile::TempDir;

/// Most memory for reading a text of this length.
fn of_text(data: &[u8]) -> usize {
    1024 * data.len() + (64 << 20)
}

/// A calibration, read as it is, and with a correct checksum, which anyone can compute.
pub fn calibration(data: &[u8]) {
    bounded(of_text(data), || {
        if let Ok(file) = CalibrationFile::read(data) {
            file.calibration()
                .expect("models and a response that can be used");
        }
        let parsed = serde_json::from_slice::<CalibrationFile>(data);
        if let Ok(Ok((file, bytes))) = parsed.map(CalibrationFile::sealed) {
            let again = CalibrationFile::read(&bytes).expect("what was sealed can be read");
            assert_eq!(again.fingerprint, file.fingerprint);
        }
    });
}

thread_local! {
    static MODELS: TempDir = tempfile::tempdir().expect("a folder");
}

/// OpenCV models: the first byte selects unit, axis and plane. Every number of an accepted model is
/// finite.
pub fn opencv(data: &[u8]) {
    let Some((declared, text)) = data.split_first() else {
        return;
    };
    let path = MODELS.with(|folder| folder.path().join("models.yml"));
    fs::write(&path, text).expect("written");
    let sizes = Sizes {
        camera: (64, 48),
        projector: (128, 96),
    };
    let declared = Declared {
        unit: (declared & 1 == 1).then_some(Unit::Mm),
        z_away: declared & 2 == 2,
        plane_at: (declared & 4 == 4).then_some(400.0),
    };
    bounded(of_text(text), || {
        let one = opencv::from_one(&path, sizes, declared);
        let two = opencv::from_two(&path, &path, sizes, declared);
        for models in [one, two].into_iter().flatten() {
            finite(&models.camera);
            finite(&models.projector);
        }
    });
}

fn finite(model: &DeviceModel) {
    let alone = [model.fx, model.fy, model.cx, model.cy].into_iter();
    let more = model.distortion.into_iter().chain(model.rotation);
    let mut all = alone.chain(more).chain(model.translation_mm);
    assert!(all.all(f64::is_finite), "{model:?}");
}

/// A scenario of a simulated head: an accepted one has a calibration.
pub fn scenario(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    bounded(of_text(data), || {
        if let Ok(scenario) = Scenario::from_toml(text, "scenario.toml") {
            let calibration = Calibration::of_scenario(&scenario);
            std::hint::black_box(calibration.map(|known| known.fingerprint()).is_ok());
        }
    });
}

/// A configuration: an accepted one can be written.
pub fn config(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    bounded(of_text(data), || {
        if let Ok(config) = toml::from_str::<Config>(text)
            && config.check().is_ok()
        {
            toml::to_string(&config).expect("written");
        }
    });
}
