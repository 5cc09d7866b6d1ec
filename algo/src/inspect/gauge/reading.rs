//! What a gauge found.

/// A mean over a square needs at least this share of its pixels.
pub const MIN_SUPPORT: f64 = 0.5;

/// What a gauge found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// The value in mm or as a share.
    pub value: f64,
    /// Its error over repeated measurements of the same part, 1 σ, where the noise is known.
    /// Golden's own noise adds the same error every time and is not in it.
    pub sigma: Option<f64>,
    /// What its magnitude is expected to be on a good part with this noise: of a deviation, which
    /// is an extreme, and so not 0.
    pub expected: Option<f64>,
    /// What is the same in every measurement and so not in σ, 1 σ: the effect of golden's noise and
    /// of the calibration's error.
    pub systematic: f64,
    /// The same of what the value differs by from golden's own: what the measurements of both share
    /// is not in it, the noise of golden and the error over the part's displacement are.
    pub compared: f64,
    /// What of `systematic` is by the radii of rims, 1 σ: they are stated, not measured.
    pub rims: f64,
    /// Where the value is, of a deviation.
    pub square: Option<Square>,
}

/// A square of camera pixels of the measured frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Square {
    /// The column of its middle.
    pub column: usize,
    /// The row of its middle.
    pub row: usize,
    /// Pixels along each side.
    pub side: usize,
}

/// A value with the parts of its error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundValue {
    /// The value.
    pub value: f64,
    /// Variance by the noise of its pixels.
    pub pixels: f64,
    /// Variance by the error of the part's motion.
    pub motion: f64,
    /// By how much errors of all heights of 1 mm, each with the sign that does most, change the
    /// value.
    pub lever: f64,
    /// What is not known of the value and the same in every measurement, 1 σ: what smoothing has
    /// taken, and what noise has added to an extreme.
    pub unknown: f64,
}

/// A value of the points of a contour.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OfRim {
    /// The value.
    pub value: f64,
    /// Variance by the noise of the points; 0 where it is not known.
    pub variance: f64,
    /// As [`FoundValue::unknown`].
    pub unknown: f64,
}
