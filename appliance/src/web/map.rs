//! A map for the page: 16-bit words, and the description that turns them into mm or counts.

use axum::http::{HeaderName, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use serde_json::json;

/// Maps are subsampled to at most this many columns.
const MAX_WIDTH: usize = 640;
/// The word for "no value".
const NONE: u16 = u16::MAX;
/// Share of the values at each end that the colour scale leaves out, so that single outliers do not stretch it.
const TAIL: f64 = 0.005;
/// The header that describes the map.
const MAP: HeaderName = HeaderName::from_static("x-map");

/// A map ready to be sent.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// Little-endian u16: value = low + step · word; 65535 = none.
    pub words: Vec<u8>,
    /// `width`, `height` of the map, `stride` (camera pixels per map pixel), `low`, `step`, `unit`, `scale` (both ends of
    /// the colours), `seq` (of the result; absent for golden).
    pub description: serde_json::Value,
}

/// Makes a map of `width` columns. With `symmetric` the colours reach equally far to both sides of zero.
pub fn map(values: &[f32], width: usize, unit: &str, symmetric: bool, seq: Option<u32>) -> Map {
    let stride = width.div_ceil(MAX_WIDTH).max(1);
    let rows = values.chunks_exact(width.max(1)).step_by(stride);
    let thin: Vec<f32> = rows
        .flat_map(|row| row.iter().step_by(stride).copied())
        .collect();
    let columns = width.div_ceil(stride).max(1);
    let mut known: Vec<f32> = thin
        .iter()
        .copied()
        .filter(|value| value.is_finite())
        .collect();
    known.sort_unstable_by(f32::total_cmp);
    let at = |share: f64| {
        let last = known.len().saturating_sub(1) as f64;
        f64::from(
            known
                .get((share * last).round() as usize)
                .copied()
                .unwrap_or(0.0),
        )
    };
    let (low, high) = (at(0.0), at(1.0));
    let step = ((high - low) / f64::from(NONE - 1)).max(f64::MIN_POSITIVE);
    let word = |value: &f32| {
        if value.is_finite() {
            ((f64::from(*value) - low) / step)
                .round()
                .min(f64::from(NONE - 1)) as u16
        } else {
            NONE
        }
    };
    let words = thin
        .iter()
        .flat_map(|value| word(value).to_le_bytes())
        .collect();
    let (dark, bright) = (at(TAIL), at(1.0 - TAIL));
    let scale = if symmetric {
        let far = dark.abs().max(bright.abs());
        [-far, far]
    } else {
        [dark, bright]
    };
    let description = json!({
        "width": columns, "height": thin.len() / columns, "stride": stride, "low": low, "step": step, "unit": unit,
        "scale": scale, "seq": seq,
    });
    Map { words, description }
}

impl IntoResponse for Map {
    fn into_response(self) -> Response {
        let kind = HeaderValue::from_static("application/octet-stream");
        // JSON of plain numbers and ASCII words is a header value.
        let description = HeaderValue::from_str(&self.description.to_string());
        let description = description.unwrap_or(HeaderValue::from_static("{}"));
        (
            [(header::CONTENT_TYPE, kind), (MAP, description)],
            self.words,
        )
            .into_response()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(map: &Map, at: usize) -> Option<f64> {
        let word = u16::from_le_bytes([map.words[2 * at], map.words[2 * at + 1]]);
        let number = |key: &str| map.description[key].as_f64().unwrap();
        (word != NONE).then(|| number("low") + number("step") * f64::from(word))
    }

    #[test]
    fn values_come_back_within_half_a_step_and_holes_stay_holes() {
        let values: Vec<f32> = (0..300)
            .map(|i| {
                if i == 7 {
                    f32::NAN
                } else {
                    i as f32 * 0.1 - 12.0
                }
            })
            .collect();
        let map = map(&values, 20, "mm", false, Some(3));
        // 30 mm over 65534 steps.
        let half_step = 0.5 * 30.0 / 65_534.0 + 1e-6;
        for (at, value) in values.iter().enumerate() {
            match read(&map, at) {
                None => assert_eq!(at, 7),
                Some(back) => assert!((back - f64::from(*value)).abs() < half_step, "{at}"),
            }
        }
        assert_eq!(
            (&map.description["height"], &map.description["seq"]),
            (&15.into(), &3.into())
        );
    }

    #[test]
    fn a_wide_map_is_thinned_out_and_deviations_are_symmetric() {
        let (width, rows) = (1456, 10);
        let values: Vec<f32> = (0..width * rows)
            .map(|i| (i % width) as f32 / 1456.0 - 0.25)
            .collect();
        let map = map(&values, width, "mm", true, None);
        assert_eq!(map.description["stride"], 3);
        assert_eq!(
            (&map.description["width"], &map.description["height"]),
            (&486.into(), &4.into())
        );
        assert_eq!(map.words.len(), 2 * 486 * 4);
        let scale = &map.description["scale"];
        assert_eq!(scale[0].as_f64().unwrap(), -scale[1].as_f64().unwrap());
    }

    #[test]
    fn a_map_without_any_value_is_still_a_map() {
        for values in [&[f32::NAN; 6][..], &[]] {
            let map = map(values, 3, "mm", true, None);
            assert!(map.words.iter().all(|byte| *byte == 0xFF));
        }
    }
}
