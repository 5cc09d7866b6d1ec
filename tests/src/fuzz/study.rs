//! Values of studies as CSV.

use super::bounded;
use appliance::study::process::Course;
use appliance::study::{
    CapabilityLimits, Decimal, GaugeCapability, Repeatability, StudyLimits, table,
};

/// The buffer of a line, and 300 bytes for each byte of the input: a value takes 2.
const BUFFER: usize = 3 << 20;
const OF_A_BYTE: usize = 300;

/// Whatever is read gives figures that are finite or not defined.
pub(super) fn csv(bytes: &[u8]) {
    let most = BUFFER + OF_A_BYTE * bytes.len();
    let Ok(all) = bounded(most, || table::read(bytes, "values.csv")) else {
        return;
    };
    for one in &all {
        let process = Course::of(one, (None, None)).figures(&[1, 2, 3, 4, 5, 6, 7, 8]);
        let mut texts = vec![process.to_string()];
        texts.extend(
            GaugeCapability::of(one, Decimal::default(), 0.2, &CapabilityLimits::USUAL)
                .map(|study| study.to_string()),
        );
        texts.extend(Repeatability::of(one, &StudyLimits::USUAL).map(|study| study.to_string()));
        assert!(texts.iter().all(|text| !text.contains("NaN")), "{texts:?}");
    }
}
