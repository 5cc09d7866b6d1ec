//! Figures that cannot be formed: they are none, and no verdict is fit.

use super::measured;
use crate::study::process::Course;
use crate::study::verdict::Fitness;
use crate::study::{CapabilityLimits, Decimal, GaugeCapability, Repeatability, StudyLimits, marks};

fn capability(csv: &str) -> GaugeCapability {
    let reference = Decimal::read("1").unwrap();
    GaugeCapability::of(&measured(csv), reference, 1.0, &CapabilityLimits::USUAL).unwrap()
}

#[test]
fn equal_values_and_a_single_one_have_no_capability() {
    for csv in [
        "value\n1\n1\n1\n",
        "value\n0.1\n0.1\n0.1\n0.1\n0.1\n0.1\n0.1\n",
        "value\n1.1\n",
    ] {
        let study = capability(csv);
        assert_eq!((study.cg, study.cgk), (None, None));
        assert_eq!(study.judgement.verdict, Fitness::NotDecided, "{csv}");
        assert!(!serde_json::to_string(&study).unwrap().contains("NaN"));
    }
    assert_eq!(capability("value\n1.1\n").s, None);
}

#[test]
fn parts_that_repeat_exactly_say_nothing_of_the_gauge() {
    let csv =
        "part,appraiser,value\n1,A,.1\n1,A,.1\n2,A,.7\n2,A,.7\n1,B,.1\n1,B,.1\n2,B,.7\n2,B,.7\n";
    let study = Repeatability::of(&measured(csv), &StudyLimits::USUAL).unwrap();
    assert_eq!((study.ndc, study.anova[2].f), (None, None));
    assert_eq!(study.judgement.verdict, Fitness::NotDecided);
    let equal = measured("part,value\n1,5\n1,5\n2,5\n2,5\n");
    let study = Repeatability::of(&equal, &StudyLimits::USUAL).unwrap();
    assert!(
        study
            .components
            .iter()
            .all(|component| component.of_study.is_none())
    );
    assert_eq!(study.judgement.verdict, Fitness::NotDecided);
}

#[test]
fn a_mean_beyond_the_only_limit_has_no_share_of_a_tolerance() {
    let csv = "part,value\n1,5\n1,5.1\n2,6\n2,6.1\n";
    let limits = StudyLimits {
        high: Decimal::read("5"),
        ..StudyLimits::USUAL
    };
    let study = Repeatability::of(&measured(csv), &limits).unwrap();
    assert_eq!(study.tolerance, None);
    assert_ne!(study.judgement.verdict, Fitness::Fit);
}

#[test]
fn a_table_that_is_not_balanced_is_refused_by_the_name_of_what_is_missing() {
    let refused = |csv: &str| {
        Repeatability::of(&measured(csv), &StudyLimits::USUAL)
            .unwrap_err()
            .to_string()
    };
    let csv = "part,appraiser,trial,value\n1,A,1,5\n1,A,2,5.1\n2,A,1,6\n2,A,2,6.1\n1,B,1,5\n1,B,2,5.2\n2,B,1,6\n";
    assert!(
        refused(csv).contains("part 2, appraiser B has 1 trials, others have 2"),
        "{}",
        refused(csv)
    );
    let gap = "part,appraiser,value\n1,A,5\n1,A,5.1\n2,B,6\n";
    assert!(
        refused(gap).contains("part 1, appraiser B has 0 trials"),
        "{}",
        refused(gap)
    );
    let twice = "part,trial,value\n1,1,5\n1,1,5.1\n2,1,6\n2,2,6.1\n";
    assert!(
        refused(twice).contains("part 1 trial 1 is there twice, at 2 and 3"),
        "{}",
        refused(twice)
    );
    assert!(refused("part,value\n1,5\n1,6\n").contains("two parts"));
    assert!(refused("part,value\n1,5\n2,6\n").contains("one trial"));
    let limits = "part,value,high\n1,5,7\n1,5.1,7\n2,6,7\n2,6.1,8\n";
    assert!(refused(limits).contains("different limits"));
}

#[test]
fn a_process_of_equal_values_or_one_has_no_index() {
    let bounds = (Decimal::read("0"), Decimal::read("2"));
    for csv in ["value\n1\n1\n1\n", "value\n1\n"] {
        let process = Course::of(&measured(csv), bounds).figures(&marks::USUAL);
        let group = &process.groups[0];
        assert_eq!(
            (group.pp, group.ppk, group.cp, group.cpk),
            (None, None, None, None)
        );
        assert!(group.marks.as_ref().unwrap().is_empty() && !process.to_string().contains("NaN"));
    }
}
