//! The joint of a section, found in its points.

use super::contours::{FoundFeature, Lost};
use super::uncertainty::ErrorBudget;
use crate::inspect::contour::State;
use crate::inspect::gauge::{Kind, Reading};
use crate::inspect::section::{Joint, JointInput, Knowledge, Section, SectionPoint};
use crate::inspect::strips::accumulate::ExpectedSection;
use alloc::vec::Vec;

/// What was found of a section.
#[derive(Clone, Debug, Default)]
pub struct SectionFit {
    /// `None` before the first part.
    pub of: Option<FoundFeature>,
    section: Option<(Section, Vec<JointInput>)>,
    points: Vec<SectionPoint>,
}

impl SectionFit {
    /// Whether it is of this feature.
    pub fn is_of(&self, feature: usize) -> bool {
        self.of.as_ref().is_some_and(|of| of.feature == feature)
    }

    /// Finds it in the points of all strips, in their order.
    pub fn find<'a>(
        &mut self,
        expected: &ExpectedSection,
        strips: impl Iterator<Item = &'a [SectionPoint]>,
        budget: &ErrorBudget,
    ) {
        self.points.clear();
        for points in strips {
            self.points.extend_from_slice(points);
        }
        let found = Section::new(&self.points, &expected.request, &expected.optics);
        let lost = found.as_ref().err().copied();
        let known = Knowledge {
            height: budget.calibration.height,
            scale: budget.calibration.length,
            radius: expected.radius,
        };
        self.section = found.ok().map(|section| {
            let inputs = section.inputs(&known);
            (section, inputs)
        });
        self.of = Some(FoundFeature {
            feature: expected.feature,
            state: match lost {
                None => State::Found,
                Some(_) => State::Unseen,
            },
            found: f64::from(u8::from(lost.is_none())),
            rim: None,
            lost: lost.map(Lost::Section),
            geometry: None,
        });
    }

    /// The points that it was looked for in.
    pub fn points(&self) -> &[SectionPoint] {
        &self.points
    }

    /// Its geometry; `None` if it is not found.
    pub fn geometry(&self) -> Option<Joint> {
        let (section, _) = self.section.as_ref()?;
        Some(section.geometry(&section.parameters()))
    }

    /// The reading of a kind; `golden` is the variance of golden's heights over that of the part's.
    /// `None` if it is not found.
    pub fn reading(&self, kind: &dyn Kind, golden: f64) -> Option<Reading> {
        let (section, inputs) = self.section.as_ref()?;
        let value = |geometry: &_| kind.of_section(geometry).unwrap_or(f64::NAN);
        let value = section.value(value, inputs)?;
        Some(Reading {
            value: value.value,
            sigma: Some(value.sigma),
            systematic: value.systematic,
            compared: value.sigma * libm::sqrt(golden),
            ..Reading::default()
        })
    }
}
