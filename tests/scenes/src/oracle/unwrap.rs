//! Temporal unwrapping: the wrapped phases of a pixel's levels → its absolute phase.

/// How the ratios of a sequence combine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// From coarse to fine; the coarsest level is absolute.
    Geometric {
        /// Lowest phase of the coarsest level, turns of that level.
        lowest: f64,
    },
    /// Ratios 1, 1 − 1/n², 1 − 1/n about a known map.
    DenseThree {
        /// The n of the ratios.
        n: f64,
    },
    /// Ratios 1, 1 − 1/n about a known map.
    DenseTwo {
        /// The n of the ratios.
        n: f64,
    },
    /// One level about a known map.
    Single,
}

/// Largest residual, turns.
const MAX_RESIDUAL: f64 = 0.40;

/// Recognises the form of `ratios`, from coarse to fine, for a pattern with this range of phases.
/// `None` for ratios of no known form.
pub fn recognise(ratios: &[f64], (min, max): (f64, f64)) -> Option<Form> {
    let span = ratios[0] * (max - min);
    if span <= 1.001 {
        // The part of the turn that the coarsest level does not use is a margin for noise.
        let margin = ((1.0 - span) / 2.0).max(0.0);
        return Some(Form::Geometric {
            lowest: ratios[0] * min - margin,
        });
    }
    let near = |a: f64, b: f64| (a - b).abs() <= 1e-6;
    match *ratios {
        [_] => Some(Form::Single),
        [low, one] if near(one, 1.0) => Some(Form::DenseTwo {
            n: 1.0 / (1.0 - low),
        }),
        [low, middle, one] if near(one, 1.0) => {
            let n = 1.0 / (1.0 - low);
            let dense = n > 2.999 && near(middle, 1.0 - 1.0 / (n * n));
            dense.then_some(Form::DenseThree { n })
        }
        _ => None,
    }
}

/// One level of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct Wrapped {
    /// Ratio r.
    pub ratio: f64,
    /// φ in turns.
    pub turns: f64,
    /// N r².
    pub weight: f64,
    /// B, in counts.
    pub modulation: f64,
}

impl Wrapped {
    /// `weight` · B² in counts², where `weight` is Σ N r² of one or more levels.
    fn information(&self, weight: f64) -> f64 {
        weight * self.modulation * self.modulation
    }
}

/// How close a pixel's unwrapping was to another result.
#[derive(Clone, Copy, Debug)]
pub struct Doubt {
    /// The smallest error of the wrapped phases, in turns, that could have changed a decision (a
    /// fringe order, a wrap, a residual at its limit).
    pub slack: f64,
    /// The difference between the lowest and highest phase of the averaged levels, turns.
    pub spread: f64,
}

impl Doubt {
    /// Before any decision.
    const NONE: Self = Self {
        slack: f64::INFINITY,
        spread: 0.0,
    };

    /// Records a decision that is `distance` turns from its threshold, made from a sum of wrapped
    /// phases whose factors add up to `gain`.
    fn look(&mut self, distance: f64, gain: f64) {
        self.slack = self.slack.min(distance / gain);
    }

    /// Wraps to −½ ≤ x < ½.
    fn wrap(&mut self, turns: f64, gain: f64) -> f64 {
        let wrapped = turns - (turns + 0.5).floor();
        self.look(0.5 - wrapped.abs(), gain);
        wrapped
    }

    /// x rounded to a whole number; none if the residual is too large.
    fn order(&mut self, x: f64, gain: f64) -> Option<f64> {
        let whole = x.round();
        let residual = (x - whole).abs();
        self.look((residual - MAX_RESIDUAL).abs(), gain);
        (residual <= MAX_RESIDUAL).then_some(whole)
    }
}

/// Φ in turns and its information Σ N r² · B², B that of the finest level; none if a residual is
/// above 0.40 turn. `levels` go from coarse to fine; `map` is Φ₀ for the forms that need one.
pub fn unwrap(form: Form, levels: &[Wrapped], map: f64) -> Option<(f64, f64)> {
    unwrap_with_doubt(form, levels, map).0
}

/// As [`unwrap`], with how close the pixel was to another result.
pub fn unwrap_with_doubt(form: Form, levels: &[Wrapped], map: f64) -> (Option<(f64, f64)>, Doubt) {
    let mut doubt = Doubt::NONE;
    let found = match form {
        Form::Geometric { lowest } => geometric(levels, lowest, &mut doubt),
        _ => about(form, levels, map, &mut doubt),
    };
    (found, doubt)
}

/// Unwraps the forms that need a map.
fn about(form: Form, levels: &[Wrapped], map: f64, doubt: &mut Doubt) -> Option<(f64, f64)> {
    let q = |level: Wrapped| relative(level, map);
    match form {
        Form::DenseThree { n } => {
            let (one, slow, low) = (levels[2], levels[1], levels[0]);
            let a = doubt.wrap(q(one) - q(slow), 2.0);
            let b = doubt.wrap(q(one) - q(low), 2.0);
            let b = b + doubt.order(n * a - b, 2.0 * n + 2.0)?;
            average(&[one, low, slow], n * b, 2.0 * n, map, doubt)
        }
        Form::DenseTwo { n } => {
            let (one, low) = (levels[1], levels[0]);
            let b = doubt.wrap(q(one) - q(low), 2.0);
            average(&[one, low], n * b, 2.0 * n, map, doubt)
        }
        _ => {
            let only = levels[0];
            let delta = doubt.wrap(q(only), 1.0) / only.ratio;
            Some((map + delta, only.information(only.weight)))
        }
    }
}

/// k = round(n Φ_coarse − φ), Φ = k + φ, from level to level.
fn geometric(levels: &[Wrapped], lowest: f64, doubt: &mut Doubt) -> Option<(f64, f64)> {
    let coarsest = levels[0];
    let within = (coarsest.turns - lowest).rem_euclid(1.0);
    doubt.look(within.min(1.0 - within), 1.0);
    let mut phase = lowest + within;
    let mut ratio = coarsest.ratio;
    for level in &levels[1..] {
        let n = level.ratio / ratio;
        phase = level.turns + doubt.order(n * phase - level.turns, n + 1.0)?;
        ratio = level.ratio;
    }
    let finest = levels[levels.len() - 1];
    Some((phase / ratio, finest.information(finest.weight)))
}

/// q = φ − frac(r Φ₀).
fn relative(level: Wrapped, map: f64) -> f64 {
    level.turns - (level.ratio * map).rem_euclid(1.0)
}

/// D_i = (q_i + round(r_i D − q_i)) / r_i for each level in turn, the finest first, D the mean of
/// those so far with weights N r². `gain` is the factor by which an error of the wrapped phases is
/// amplified in `start`.
fn average(
    levels: &[Wrapped],
    start: f64,
    mut gain: f64,
    map: f64,
    doubt: &mut Doubt,
) -> Option<(f64, f64)> {
    let mut delta = start;
    let (mut sum, mut weights) = (0.0, 0.0);
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for level in levels {
        let q = relative(*level, map);
        let order = doubt.order(level.ratio * delta - q, level.ratio * gain + 1.0)?;
        let here = (q + order) / level.ratio;
        sum += level.weight * here;
        weights += level.weight;
        delta = sum / weights;
        (low, high) = (low.min(here), high.max(here));
        doubt.spread = high - low;
        // The error of a mean is at most that of its worst part.
        let own = 1.0 / level.ratio;
        gain = if low == high { own } else { gain.max(own) };
    }
    Some((map + delta, levels[0].information(weights)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(ratios: &[f64], phase: f64) -> Vec<Wrapped> {
        let level = |&ratio: &f64| Wrapped {
            ratio,
            turns: ratio * phase - (ratio * phase).round(),
            weight: ratio * ratio,
            modulation: 1.0,
        };
        ratios.iter().map(level).collect()
    }

    #[test]
    fn each_form_finds_the_phase_that_its_levels_were_made_of() {
        let n = 6.0_f64;
        for (ratios, reach) in [
            (vec![0.0095, 0.095, 1.0], None),
            (vec![0.0095, 0.08, 0.7], None),
            (vec![1.0 - 1.0 / n, 1.0 - 1.0 / (n * n), 1.0], Some(11.9)),
            (vec![0.8, 1.0], Some(2.4)),
            (vec![0.7], Some(0.7)),
        ] {
            let form = recognise(&ratios, (-4.0, 96.0)).unwrap();
            for i in 0..1000 {
                let phase = -4.0 + f64::from(i) / 10.0;
                let map = reach.map_or(f64::NAN, |reach| {
                    phase + reach * f64::from(i % 21 - 10) / 10.0
                });
                let (found, _) = unwrap(form, &seen(&ratios, phase), map).unwrap();
                assert!((found - phase).abs() < 1e-9, "{ratios:?} {phase} {found}");
            }
        }
    }

    #[test]
    fn ratios_of_no_form_are_not_recognised() {
        for ratios in [
            vec![0.1, 0.9],
            vec![0.5, 0.9, 1.0],
            vec![0.8, 0.9, 0.95, 1.0],
        ] {
            assert_eq!(recognise(&ratios, (0.0, 100.0)), None);
        }
    }
}
