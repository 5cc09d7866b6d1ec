//! What is not known of a share is not shown as 0.

use crate::page::Browser;
use crate::station_plc::{Daemon, Place, Plc, long};

/// The registers GAUGE_SIGMA and GAUGE_U, and their `f32` that is not known.
const SIGMA: u16 = 522;
const U: u16 = 1002;
const NOT_KNOWN: u32 = 0x7FC0_0000;

#[test]
fn a_share_of_whose_scatter_nothing_is_known_has_no_sigma_and_no_uncertainty_and_never_one_of_0() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    plc.measure(1);
    let [sigma, u] = [SIGMA, U].map(|address| plc.read(address, 32).unwrap());
    let result = Browser::new(&daemon).get("/api/snapshot")["result"].clone();
    let gauges = result["gauges"].as_array().unwrap();
    let mut unknown = 0;
    for (at, gauge) in gauges.iter().enumerate() {
        let [sigma, u] = [&sigma, &u].map(|words| long(words, 2 * at));
        for (key, bits) in [("sigma", sigma), ("uncertainty", u)] {
            match gauge[key].as_f64() {
                Some(shown) => assert!(shown > 0.0 && f32::from_bits(bits) > 0.0, "{gauge}"),
                None => assert_eq!(bits, NOT_KNOWN, "{gauge}"),
            }
        }
        unknown += usize::from(gauge["kind"] == "share" && gauge["sigma"].is_null());
    }
    assert!(unknown > 0, "{result}");
}
