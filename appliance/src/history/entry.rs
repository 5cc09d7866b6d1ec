//! A result as the history keeps it, and a filter of results.

use crate::station::result::flag;
use crate::station::{Placement, ResultRecord, Square, Verdict};
use serde::{Deserialize, Serialize};

/// One stored result. Lengths in mm, times in µs; as JSON the keys are the fields' names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// RESULT_SEQ.
    pub seq: u32,
    /// Trigger time in µs since 1970 UTC; `None` if the clock was not synchronised.
    pub time_utc_us: Option<u64>,
    /// Trigger time since the start of the daemon, s.
    pub uptime_s: u32,
    /// Which start that was: BOOT_ID as 8 hexadecimal digits.
    pub boot_id: String,
    /// Where the clock was not synchronised: the trigger time in µs since 1970 UTC by the clock of a browser whose user
    /// signed in during the same start.
    pub browser_utc_us: Option<u64>,
    /// Recipe number.
    pub recipe: u16,
    /// The first 8 hexadecimal digits of the recipe's fingerprint.
    pub fingerprint: String,
    /// PART_ID.
    pub part_id: u32,
    /// PRESS_STROKE.
    pub press_stroke: u32,
    /// The token that triggered, 0 for an edge.
    pub token: u16,
    /// PASS, FAIL or INVALID.
    pub verdict: Verdict,
    /// 0, or why there is no measurement.
    pub error_code: u16,
    /// Why it is INVALID, in words.
    pub reason: Option<String>,
    /// RESULT flags, register 231.
    pub flags: u16,
    /// Resolved pixels.
    pub valid_points: u32,
    /// Share of the regions that is resolved, ‰.
    pub coverage_permille: u16,
    /// Head temperature, °C.
    pub temperature_c: Option<f64>,
    /// Height noise, 1 σ, mm.
    pub height_noise_mm: Option<f64>,
    /// Pattern fitness, ‰.
    pub fitness_permille: u16,
    /// Trigger → exposure done, µs.
    pub exposure_us: u32,
    /// Trigger → result, µs.
    pub total_us: u32,
    /// Times of the stages, in their order.
    pub stages: Vec<StageEntry>,
    /// The gauges, in the recipe's order.
    pub gauges: Vec<GaugeEntry>,
    /// How the part lay; `None` where it was not aligned.
    pub placement: Option<Placement>,
    /// The folder in `recordings/` that holds the frames, if they were kept.
    pub recording: Option<String>,
    /// Why the frames of a part that did not pass were not kept, as far as known; see [`super::Unkept`].
    pub unkept: Option<String>,
}

/// The time of one stage.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StageEntry {
    /// The stage's name.
    pub name: String,
    /// µs.
    pub us: u32,
}

/// One gauge of a stored result, in mm, °, mm³ or as a share.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GaugeEntry {
    /// The gauge's name.
    pub name: String,
    /// The unit's symbol, empty for shares and bare numbers.
    pub unit: String,
    /// None if it could not be measured.
    pub value: Option<f64>,
    /// 1 σ, as far as predicted.
    pub sigma: Option<f64>,
    /// U = 2 u, with the systematic part of the error.
    pub uncertainty: Option<f64>,
    /// The magnitude that is expected on a good part, where noise moves the value away from 0.
    pub expected: Option<f64>,
    /// The square that the value is of, where it is a deviation.
    pub square: Option<Square>,
    /// Lower limit.
    pub low: Option<f64>,
    /// Upper limit.
    pub high: Option<f64>,
    /// The bits of registers 296–311: 0 pass, 1 valid, 2 low, 3 high, 4 doubtful.
    pub decision: u16,
}

/// Which results: all conditions hold together. The default asks for the newest hundred.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Filter {
    /// Of this recipe.
    pub recipe: Option<u16>,
    /// With this verdict.
    pub verdict: Option<Verdict>,
    /// Of this PART_ID.
    pub part_id: Option<u32>,
    /// Triggered at or after this time, µs since 1970 UTC. Results without a time are then left out.
    pub since_us: Option<u64>,
    /// Triggered before this time.
    pub until_us: Option<u64>,
    /// Stored before the result of this SEQ: the next page of a list.
    pub before_seq: Option<u32>,
    /// At most this many, the newest.
    pub limit: usize,
}

impl Default for Filter {
    fn default() -> Self {
        Self {
            recipe: None,
            verdict: None,
            part_id: None,
            since_us: None,
            until_us: None,
            before_seq: None,
            limit: 100,
        }
    }
}

impl Entry {
    /// What the history keeps of a result.
    pub fn of(record: &ResultRecord) -> Self {
        let found = &record.inspection;
        Self {
            seq: record.seq,
            time_utc_us: Some(record.time_utc_us).filter(|&time| time != 0),
            uptime_s: record.uptime_s,
            boot_id: format!("{:08x}", record.boot_id),
            browser_utc_us: None,
            recipe: record.recipe,
            fingerprint: format!("{:08x}", record.recipe_crc),
            part_id: record.part_id,
            press_stroke: record.press_stroke,
            token: record.token,
            verdict: record.verdict,
            error_code: record.error_code,
            reason: found.reason.as_deref().map(str::to_owned),
            flags: record.flags(),
            valid_points: found.valid_points,
            coverage_permille: found.coverage_permille,
            temperature_c: found.temperature_c.filter(|c| c.is_finite()),
            height_noise_mm: Some(found.height_noise_mm).filter(|mm| mm.is_finite()),
            fitness_permille: found.fitness_permille,
            exposure_us: record.exposure_us,
            total_us: record.total_us,
            stages: stages(record),
            gauges: gauges(record),
            placement: found.placement.filter(is_finite),
            recording: None,
            unkept: None,
        }
    }
}

/// Whether JSON can hold it; components that are not finite become null.
fn is_finite(placement: &Placement) -> bool {
    placement.reach_mm.is_finite() && placement.outliers.is_finite()
}

fn stages(record: &ResultRecord) -> Vec<StageEntry> {
    let stages = record.stages();
    stages
        .iter()
        .map(|time| StageEntry {
            name: time.stage.name().into(),
            us: time.us,
        })
        .collect()
}

fn gauges(record: &ResultRecord) -> Vec<GaugeEntry> {
    let finite = |number: Option<f64>| number.filter(|number| number.is_finite());
    let gauges = record.inspection.gauges.iter();
    gauges
        .map(|gauge| GaugeEntry {
            name: gauge.name.as_ref().into(),
            unit: gauge.unit.symbol().into(),
            value: finite(gauge.value),
            sigma: finite(gauge.sigma),
            uncertainty: finite(gauge.uncertainty),
            expected: finite(gauge.expected),
            square: gauge.square,
            low: finite(gauge.low),
            high: finite(gauge.high),
            decision: gauge.decision.bits(),
        })
        .collect()
}

/// Flags that say how a cycle went, not what its frames show.
const COURSE: u16 = flag::RETRIED | flag::STEPPED_UP | flag::WARM_UP;

/// How a replayed result differs from the stored one, in words; `None` if it is the same bit by bit. What belongs to the cycle
/// and not to its frames is not compared: numbers, times, temperature, the flags of its course.
pub fn difference(stored: &Entry, replayed: &Entry) -> Option<String> {
    let same = Entry {
        recipe: replayed.recipe,
        fingerprint: replayed.fingerprint.clone(),
        verdict: replayed.verdict,
        error_code: replayed.error_code,
        reason: replayed.reason.clone(),
        flags: (stored.flags & COURSE) | (replayed.flags & !COURSE),
        valid_points: replayed.valid_points,
        coverage_permille: replayed.coverage_permille,
        height_noise_mm: replayed.height_noise_mm,
        fitness_permille: replayed.fitness_permille,
        gauges: replayed.gauges.clone(),
        placement: replayed.placement,
        ..stored.clone()
    };
    if same == *stored {
        return None;
    }
    let mut gauges = stored.gauges.iter().zip(&same.gauges);
    Some(match gauges.find(|(stored, replayed)| stored != replayed) {
        Some((stored, replayed)) => format!("a gauge was {stored:?}, is {replayed:?}"),
        None => format!("it was {stored:?}, is {same:?}"),
    })
}
