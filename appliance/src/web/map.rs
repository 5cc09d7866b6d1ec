//! A map for the page: 16-bit words, and the description that turns them into mm or counts.

use axum::http::{HeaderName, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use serde_json::json;

/// Maps are subsampled to at most this many columns.
const MAX_WIDTH: usize = 640;
/// The word for "no value".
const NONE: u16 = u16::MAX;
/// The colours of deviations reach this many times as far as the gauge's limits, so that what is
/// just outside differs from what is far outside.
const BEYOND: f64 = 2.0;
/// Share of the values at each end that the colour scale leaves out, so that single outliers do not
/// stretch it.
const TAIL: f64 = 0.005;
/// The header that describes the map.
const MAP: HeaderName = HeaderName::from_static("x-map");

/// How a map is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drawn {
    /// Colours over the range of the values; of each square the first pixel is sent.
    Plain,
    /// Colours that reach equally far to both sides of zero; of each square the largest deviation is
    /// sent.
    Deviation {
        /// The larger of the gauge's limits; without one the colours go by the values.
        limit: Option<f64>,
    },
}

/// A map ready to be sent.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// Little-endian u16: value = low + step · word; 65535 = none.
    pub words: Vec<u8>,
    /// `width`, `height` of the map, `stride` (camera pixels per map pixel), `low`, `step`, `unit`,
    /// `scale` (both ends of the colours), `seq` (of the result; absent for golden), and what the
    /// map is of.
    pub description: serde_json::Value,
}

/// Which pixels of a frame are sent: one of each square.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sampling {
    /// Columns of the frame.
    pub width: usize,
    /// Pixels along each side of a square.
    pub stride: usize,
}

impl Sampling {
    /// That of a frame of `width` columns, unless a request says otherwise.
    pub fn usual(width: usize) -> Self {
        let stride = width.div_ceil(MAX_WIDTH).max(1);
        Self { width, stride }
    }

    /// Columns that are sent.
    fn columns(self) -> usize {
        self.width.div_ceil(self.stride).max(1)
    }
}

/// Makes a map of `width` columns.
pub fn map(values: &[f32], width: usize, unit: &str, drawn: Drawn, seq: Option<u32>) -> Map {
    let sampling = Sampling::usual(width);
    let thin = thinned(values, sampling, drawn);
    let columns = sampling.columns();
    let (words, mut description) = encoded(&thin, unit, drawn);
    for (key, value) in [
        ("width", json!(columns)),
        ("height", json!(thin.len() / columns)),
        ("stride", json!(sampling.stride)),
        ("seq", json!(seq)),
    ] {
        description[key] = value;
    }
    Map { words, description }
}

/// A plane of a surface.
#[derive(Clone, Debug)]
pub struct Plane {
    name: &'static str,
    unit: &'static str,
    thin: Vec<f32>,
    drawn: Drawn,
}

impl Plane {
    /// The plane of the values of a frame.
    pub fn of(
        name: &'static str,
        unit: &'static str,
        values: &[f32],
        sampling: Sampling,
        drawn: Drawn,
    ) -> Self {
        Self {
            name,
            unit,
            thin: thinned(values, sampling, drawn),
            drawn,
        }
    }

    /// x, y and z of the pixels that are sent, mm.
    pub fn points(points: [Vec<f32>; 3]) -> Vec<Self> {
        let planes = ["x", "y", "z"].into_iter().zip(points);
        planes
            .map(|(name, thin)| Self {
                name,
                unit: "mm",
                thin,
                drawn: Drawn::Plain,
            })
            .collect()
    }
}

/// Makes a surface of planes of one sampling.
pub fn surface(planes: &[Plane], sampling: Sampling, seq: Option<u32>) -> Map {
    let columns = sampling.columns();
    let rows = planes.first().map_or(0, |plane| plane.thin.len() / columns);
    let (mut words, mut described) = (Vec::new(), Vec::new());
    for plane in planes {
        let (own, mut description) = encoded(&plane.thin, plane.unit, plane.drawn);
        words.extend(own);
        description["name"] = plane.name.into();
        described.push(description);
    }
    let description = json!({
        "width": columns, "height": rows, "stride": sampling.stride, "seq": seq, "planes": described,
    });
    Map { words, description }
}

/// The words of values, and what turns them back.
fn encoded(thin: &[f32], unit: &str, drawn: Drawn) -> (Vec<u8>, serde_json::Value) {
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
    let scale = match drawn {
        Drawn::Plain => [dark, bright],
        Drawn::Deviation { limit } => {
            let limit = limit.filter(|limit| *limit > 0.0);
            let far = limit.map_or(dark.abs().max(bright.abs()), |limit| BEYOND * limit);
            [-far, far]
        }
    };
    (
        words,
        json!({ "low": low, "step": step, "unit": unit, "scale": scale }),
    )
}

/// One value for each square of pixels, of those that lie in the frame.
fn thinned(values: &[f32], Sampling { width, stride }: Sampling, drawn: Drawn) -> Vec<f32> {
    let width = width.max(1);
    let rows = values.len() / width;
    let mut thin = Vec::with_capacity(rows.div_ceil(stride) * width.div_ceil(stride));
    for top in (0..rows).step_by(stride) {
        for left in (0..width).step_by(stride) {
            let first = values[top * width + left];
            if drawn == Drawn::Plain {
                thin.push(first);
                continue;
            }
            let right = (left + stride).min(width);
            let rows = (top..(top + stride).min(rows)).map(|row| row * width);
            let square = rows.flat_map(|row| &values[row + left..row + right]);
            // A comparison with NaN is false.
            let larger = |most: f32, &mm: &f32| match most.is_nan() || mm.abs() > most.abs() {
                true => mm,
                false => most,
            };
            thin.push(square.fold(f32::NAN, larger));
        }
    }
    thin
}

/// JSON for a header, which takes ASCII alone.
fn ascii(json: &serde_json::Value) -> String {
    let mut text = String::new();
    for letter in json.to_string().chars() {
        if letter.is_ascii() {
            text.push(letter);
            continue;
        }
        for unit in letter.encode_utf16(&mut [0; 2]) {
            text += &format!("\\u{unit:04x}");
        }
    }
    text
}

impl IntoResponse for Map {
    fn into_response(self) -> Response {
        let kind = HeaderValue::from_static("application/octet-stream");
        let description = HeaderValue::from_str(&ascii(&self.description));
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
        let map = map(&values, 20, "mm", Drawn::Plain, Some(3));
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
        let map = map(&values, width, "mm", Drawn::Deviation { limit: None }, None);
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
    fn the_largest_deviation_stays_when_a_map_is_thinned_out_and_colours_go_by_the_limit() {
        let (width, rows) = (1000, 7);
        let mut values = vec![f32::NAN; width * rows];
        values[3 * width + 501] = 0.01;
        values[2 * width + 500] = -0.25;
        values[6 * width + 999] = 0.1;
        let map = map(
            &values,
            width,
            "mm",
            Drawn::Deviation { limit: Some(0.15) },
            None,
        );
        assert_eq!(map.description["stride"], 2);
        let known: Vec<(usize, f64)> = (0..map.words.len() / 2)
            .filter_map(|at| Some((at, read(&map, at)?)))
            .collect();
        let [(dent, deep), (bump, high)] = known[..] else {
            panic!("{known:?}");
        };
        assert_eq!((dent, bump), (500 + 250, 3 * 500 + 499));
        assert!(
            (deep + 0.25).abs() < 1e-5 && (high - 0.1).abs() < 1e-5,
            "{known:?}"
        );
        assert_eq!(map.description["scale"], json!([-0.3, 0.3]));
    }

    #[test]
    fn a_description_is_a_header_whatever_the_gauge_is_called() {
        let json = json!({ "name": "Fläche 🙂 \"a\"" });
        let header = ascii(&json);
        assert!(HeaderValue::from_str(&header).is_ok(), "{header}");
        assert_eq!(
            serde_json::from_str::<serde_json::Value>(&header).unwrap(),
            json
        );
    }

    #[test]
    fn the_planes_of_a_surface_stand_behind_each_other_each_with_its_own_steps() {
        let (width, rows, stride) = (10, 6, 2);
        let values: Vec<f32> = (0..width * rows).map(|at| at as f32).collect();
        let far: Vec<f32> = values.iter().map(|value| value * 1000.0).collect();
        let sampling = Sampling { width, stride };
        let planes = [
            Plane::of("a", "mm", &values, sampling, Drawn::Plain),
            Plane::of("b", "counts", &far, sampling, Drawn::Plain),
        ];
        let map = surface(&planes, sampling, Some(4));
        let described = &map.description;
        assert_eq!(
            (&described["width"], &described["height"]),
            (&5.into(), &3.into())
        );
        assert_eq!(map.words.len(), 2 * 2 * 15);
        for (plane, larger) in [(0, 1.0), (1, 1000.0)] {
            let of = &described["planes"][plane];
            let [low, step] = ["low", "step"].map(|key| of[key].as_f64().unwrap());
            for at in 0..15 {
                let from = 2 * (15 * plane + at);
                let word = u16::from_le_bytes([map.words[from], map.words[from + 1]]);
                let wanted = (20 * (at / 5) + 2 * (at % 5)) as f64 * larger;
                let value = low + step * f64::from(word);
                assert!((value - wanted).abs() <= step, "{plane} {at}: {value}");
            }
        }
    }

    #[test]
    fn a_map_without_any_value_is_still_a_map() {
        for values in [&[f32::NAN; 6][..], &[]] {
            let map = map(values, 3, "mm", Drawn::Deviation { limit: None }, None);
            assert!(map.words.iter().all(|byte| *byte == 0xFF));
        }
    }
}
