//! The units of gauges' values.

/// What a gauge's value is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(rename_all = "lowercase")
)]
pub enum Unit {
    /// 0: a bare number; step 0.0001.
    #[default]
    None,
    /// 1: mm; step 0.1 µm.
    Length,
    /// 2: degrees; step 0.0001°.
    Angle,
    /// 3: mm³; step 0.01 mm³.
    Volume,
    /// 4: 0…1; step 0.1 ‰.
    Share,
}

impl Unit {
    /// Its number in registers.
    pub fn number(self) -> u16 {
        self as u16
    }

    /// Steps of a register per mm, °, mm³ or 1.
    pub fn steps(self) -> f64 {
        match self {
            Self::Volume => 100.0,
            Self::None | Self::Length | Self::Angle | Self::Share => 10_000.0,
        }
    }

    /// The smallest and the largest limit: a share is 0 to 1, an angle a half turn either way;
    /// anything else is what a register holds, ±(2³¹ − 1) of its steps.
    pub fn range(self) -> [f64; 2] {
        let most = match self {
            Self::Share => return [0.0, 1.0],
            Self::Angle => 180.0,
            Self::None | Self::Length | Self::Volume => f64::from(i32::MAX) / self.steps(),
        };
        [-most, most]
    }

    /// The unit with this symbol; of a bare number and a share, which have none, the share.
    pub fn of_symbol(symbol: &str) -> Self {
        let units = [Self::Length, Self::Angle, Self::Volume];
        let found = units.into_iter().find(|unit| unit.symbol() == symbol);
        found.unwrap_or(Self::Share)
    }

    /// The unit's symbol.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::None | Self::Share => "",
            Self::Length => "mm",
            Self::Angle => "°",
            Self::Volume => "mm³",
        }
    }
}
