//! What a head answers, line by line, and which lines are accepted.
//!
//! The format is that of `GET /api/results` (docs/api.md). A head that sends anything else is
//! named and left alone for a while; nothing that it sends is stored unless it could be a result.

use serde::{Deserialize, Serialize};

/// The most bytes of a line: 64 gauges with long names and reasons take a third.
pub const MOST_LINE: usize = 64 << 10;
/// The most gauges of a result.
const MOST_GAUGES: usize = 64;
/// The most bytes of a serial, or of the id of a history.
const MOST_ID: usize = 64;

/// Stands in the store between the id of a history and the number of its life; in no id.
pub const LIFE: char = '.';

/// The first line of an answer.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
pub struct Header {
    /// The head's serial.
    pub serial: String,
    /// Which history SEQ counts in.
    pub history: String,
    /// The oldest SEQ that is kept; none in an empty history.
    pub first: Option<u32>,
    /// The newest.
    pub last: Option<u32>,
    /// The ids that the history had before its head was restored from a backup.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub earlier: Vec<EarlierHistory>,
}

/// The results of a history up to a SEQ were kept under another id before.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
pub struct EarlierHistory {
    /// That id.
    pub history: String,
    /// The last SEQ under it.
    pub last: u32,
}

/// A result. Lengths in mm, angles in °, volumes in mm³, shares 0…1.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub struct Row {
    /// The head's serial.
    pub serial: String,
    /// Which history SEQ counts in.
    pub history: String,
    /// RESULT_SEQ.
    pub seq: u32,
    /// When it was triggered, if the head knows.
    pub at_unix_ms: Option<u64>,
    /// How the head knows: `synchronised`, `browser` or `none`.
    pub clock: String,
    /// Recipe number.
    pub recipe: u16,
    /// The first 8 hexadecimal digits of the recipe's fingerprint.
    pub fingerprint: String,
    /// PART_ID.
    pub part_id: u32,
    /// PRESS_STROKE.
    pub press_stroke: u32,
    /// PASS, FAIL or INVALID.
    pub verdict: String,
    /// 0, or why there is no measurement.
    pub error_code: u16,
    /// RESULT flags, register 231.
    pub flags: u16,
    /// Trigger → exposure done, µs.
    pub exposure_us: u32,
    /// Exposure done → result, µs.
    pub processing_us: u32,
    /// Share of the surface compared with golden that is resolved.
    pub coverage: f64,
    /// x, y, z in mm and three turns in °; each null where the part does not determine it.
    pub placement: Option<[Option<f64>; 6]>,
    /// By ascending slots.
    pub gauges: Vec<Gauge>,
}

/// A gauge of a result.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub struct Gauge {
    /// 1 to 64.
    pub slot: u16,
    /// Its name.
    pub name: String,
    /// The unit's symbol, empty for shares.
    pub unit: String,
    /// None if it could not be measured.
    pub value: Option<f64>,
    /// 1 σ.
    pub sigma: Option<f64>,
    /// U = 2 u.
    pub u: Option<f64>,
    /// Lower limit.
    pub low: Option<f64>,
    /// Upper limit.
    pub high: Option<f64>,
    /// The bits of registers 1116–1179.
    pub decision: u16,
    /// Why there is no value.
    pub reason: Option<String>,
}

/// What is wrong with a line.
#[derive(Debug, thiserror::Error)]
pub enum Wrong {
    /// It is longer than [`MOST_LINE`].
    #[error("a line is longer than {MOST_LINE} bytes")]
    Long,
    /// It is not what the format says.
    #[error("a line is no {0}: {1}")]
    Json(&'static str, serde_json::Error),
    /// It is JSON of the right form, with a value of this key that no head has.
    #[error("{0} of result {1} cannot be")]
    Value(&'static str, u32),
    /// The first and the last of the header contradict each other, or an id is not valid.
    #[error("its header cannot be: first {}, last {}", number(*.0), number(*.1))]
    Header(Option<u32>, Option<u32>),
    /// A head with this serial answers in place of the one with the second.
    #[error(
        "wrong serial: {0:?} answers, {1:?} did before: if the head was replaced, write serial = {0:?} for it in fleet.toml"
    )]
    Serial(String, String),
    /// Another head, at the second address, says that it has the same serial.
    #[error("serial {0:?} is that of {1}: give each head a serial of its own")]
    Taken(String, String),
    /// Numbers go back from the first to the second.
    #[error("SEQ falls from {0} to {1}")]
    Falls(u32, u32),
    /// A result that is newer than the newest.
    #[error("it sends result {0}, behind the last of its header, {last}", last = number(*.1))]
    Behind(u32, Option<u32>),
    /// More than was asked for.
    #[error("it sends more than the {0} results that were asked for")]
    More(u32),
}

/// A number of a result, or the word "none".
fn number(seq: Option<u32>) -> String {
    seq.map_or("none".to_owned(), |seq| seq.to_string())
}

impl Header {
    /// Reads the first line of the answer to a question for what is behind `after`.
    ///
    /// # Errors
    /// [`Wrong`]
    pub fn read(line: &[u8]) -> Result<Self, Wrong> {
        let header: Self =
            serde_json::from_slice(line).map_err(|error| Wrong::Json("header", error))?;
        let id = |id: &str| {
            (1..=MOST_ID).contains(&id.len()) && id.bytes().all(|b| b.is_ascii_graphic())
        };
        let (first, last) = (header.first, header.last);
        let ordered = first.is_some() == last.is_some() && first <= last;
        let is_whole = !header.history.contains(LIFE);
        if !id(&header.serial) || !id(&header.history) || !is_whole || !ordered {
            return Err(Wrong::Header(first, last));
        }
        Ok(header)
    }
}

impl Row {
    /// Reads a line of an answer with this header, behind result `before`.
    ///
    /// # Errors
    /// [`Wrong`]
    pub fn read(line: &[u8], header: &Header, before: u32) -> Result<Self, Wrong> {
        let row: Self =
            serde_json::from_slice(line).map_err(|error| Wrong::Json("result", error))?;
        if row.serial != header.serial {
            return Err(Wrong::Serial(row.serial, header.serial.clone()));
        }
        if row.seq <= before {
            return Err(Wrong::Falls(before, row.seq));
        }
        if header.last.is_none_or(|last| row.seq > last) {
            return Err(Wrong::Behind(row.seq, header.last));
        }
        match row.impossible(header) {
            Some(what) => Err(Wrong::Value(what, row.seq)),
            None => Ok(row),
        }
    }

    /// The first key whose value cannot be.
    fn impossible(&self, header: &Header) -> Option<&'static str> {
        let clocks = ["synchronised", "browser", "none"];
        // The store has seconds in 32 bits.
        let at_s = self.at_unix_ms.unwrap_or(0) / 1000;
        let is_timed = self.at_unix_ms.is_some() != (self.clock == "none");
        [
            ("history", self.history == header.history),
            (
                "verdict",
                ["PASS", "FAIL", "INVALID"].contains(&&*self.verdict),
            ),
            ("clock", clocks.contains(&&*self.clock)),
            ("at_unix_ms", is_timed && at_s <= u64::from(u32::MAX)),
            ("coverage", (0.0..=1.0).contains(&self.coverage)),
            ("gauges", self.gauges.len() <= MOST_GAUGES),
        ]
        .into_iter()
        .find_map(|(key, possible)| (!possible).then_some(key))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINE: &str = r#"{"serial":"S","history":"h","seq":7,"at_unix_ms":1790000000000,"clock":"browser","recipe":1,
        "fingerprint":"00c0ffee","part_id":1,"press_stroke":2,"verdict":"FAIL","error_code":0,"flags":0,"exposure_us":3,
        "processing_us":4,"coverage":0.5,"placement":[0.1,null,0,0,0,0],"gauges":[{"slot":3,"name":"a\"b","unit":"mm","value":null,
        "sigma":null,"u":null,"low":-1,"high":1.5,"decision":0,"reason":"dark"}]}"#;

    fn header() -> Header {
        Header::read(br#"{"serial":"S","history":"h","first":1,"last":9}"#).unwrap()
    }

    fn complaint(line: &str, before: u32) -> String {
        Row::read(line.as_bytes(), &header(), before)
            .unwrap_err()
            .to_string()
    }

    #[test]
    fn a_line_is_a_result() {
        let row = Row::read(LINE.as_bytes(), &header(), 6).unwrap();
        assert_eq!((row.seq, &*row.gauges[0].name), (7, "a\"b"));
        assert_eq!(row.gauges[0].value, None);
        assert_eq!(row.placement.unwrap()[..2], [Some(0.1), None]);
        // Each key is read, under the name that it is written with.
        let read = |text: &[u8]| serde_json::from_slice::<serde_json::Value>(text).unwrap();
        let written = serde_json::to_vec(&row).unwrap();
        let whole = LINE.replace("[0.1,null,0,0,0,0]", "[0.1,null,0.0,0.0,0.0,0.0]");
        let whole = whole.replace("\"low\":-1,", "\"low\":-1.0,");
        assert_eq!(read(&written), read(whole.as_bytes()));
    }

    #[test]
    fn what_no_head_sends_is_refused_by_name() {
        let newer = LINE.replace("\"seq\":7", "\"seq\":10");
        assert!(complaint(&newer, 6).contains("result 10, behind the last"));
        assert!(complaint(LINE, 7).contains("SEQ falls from 7 to 7"));
        for (from, to, named) in [
            ("\"S\"", "\"T\"", "wrong serial: \"T\""),
            ("\"h\"", "\"i\"", "history of result 7"),
            ("FAIL", "MAYBE", "verdict"),
            ("browser", "none", "at_unix_ms"),
            ("1790000000000", "1790000000000000", "at_unix_ms"),
            ("0.5,", "1.5,", "coverage"),
            ("1.5,", "NaN,", "no result"),
            ("1.5,", "1e999,", "no result"),
            ("\"seq\":7", "\"seq\":-1", "no result"),
        ] {
            assert!(LINE.contains(from));
            let words = complaint(&LINE.replace(from, to), 6);
            assert!(words.contains(named), "{words}");
        }
        for wrong in [
            r#"{"serial":"","history":"h","first":1,"last":9}"#,
            r#"{"serial":"S","history":"h","first":10,"last":9}"#,
            r#"{"serial":"S","history":"h","first":null,"last":9}"#,
            "[]",
        ] {
            assert!(Header::read(wrong.as_bytes()).is_err(), "{wrong}");
        }
    }
}
