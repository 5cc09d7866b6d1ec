//! The phase that each pixel would have if the part were golden and lay displaced.
//!
//! # Idea
//! A pixel that sees height z sees the part's point p; with the motion taken back, p lies at the
//! taught coordinates (u, v) + (du, dv) and dz higher (`pose.rs`). So z = G(u + du, v + dv) − dz
//! with golden's heights G. As du, dv and dz hardly change with z, two rounds find it, and the
//! inverse of the pixel's cubic gives its phase. Displacements are those of `displaced`: linear in
//! a block of pixels, many of which are worked on at a time; only golden's heights are looked up
//! one by one.
//!
//! # Accuracy
//! Within 2⁻¹⁵ turn of the same in double precision:
//! `expected_phases_are_those_of_double_precision`.

use super::window::ExpectedRow;
use crate::inspect::strips::align::{
    BLOCK, BlockNumbers, Linear, PoseField, Whole, floor, is_near,
};
use crate::inspect::strips::golden::Golden;
use crate::math::nearest::whole;
use crate::pipeline::{COMPARED, CubicRow};
use crate::simd::{Backend, Lanes, back_end_entry};
use crate::units::{AbsolutePhase, Height};

/// Rounds in which the height of a pixel is found.
const ROUNDS: usize = 2;

/// What a part is expected to show.
#[derive(Clone, Copy)]
pub struct Expectation<'a> {
    pub backend: Backend,
    pub golden: &'a Golden,
    /// How it lies; as taught if none.
    pub pose: Option<&'a PoseField>,
}

/// What is known of golden.
#[derive(Clone, Copy)]
pub struct GoldenHeights<'a> {
    height: &'a [Height],
    /// See [`crate::pipeline::CubicInput`].
    taught: &'a [u16],
    width: usize,
    rows: usize,
}

/// A block of pixels along a row.
#[derive(Clone, Copy)]
pub struct BlockPixels<'a> {
    numbers: &'a BlockNumbers,
    from: Whole,
    /// The first one.
    u: usize,
    v: usize,
    /// z₀, and the cubics about it.
    base: &'a [Height],
    cubics: CubicRow<'a>,
}

/// What was found of a block.
#[derive(Default)]
pub struct Sought {
    /// z − z₀, nm.
    rise: [f32; BLOCK],
    /// Not 0 where the pixel's cubic does not reach there.
    exact: [i32; BLOCK],
}

impl Expectation<'_> {
    /// The phases of row `v`. Around the part and in its openings golden's surface is interpolated
    /// ([`Parts::cubics`](crate::inspect::Parts::cubics)).
    pub fn row(self, v: usize, blocks: &mut [BlockNumbers], out: ExpectedRow<'_>) {
        let Self {
            backend,
            golden,
            pose,
        } = self;
        let (width, rows) = golden.size();
        let (cubics, surface) = (golden.cubics.row(v), golden.cubics.surface());
        let Some(pose) = pose else {
            out.phase.copy_from_slice(cubics.base);
            let taught = golden.taught.row(v, width);
            for (compared, taught) in out.compared.iter_mut().zip(taught) {
                *compared = *taught >= COMPARED;
            }
            return;
        };
        pose.row(backend, (v, rows), &(0..width), blocks);
        let heights = GoldenHeights {
            height: &surface.height,
            taught: golden.taught.pixels(),
            width,
            rows,
        };
        let bases = &surface.height[v * width..][..width];
        let ExpectedRow { phase, compared } = out;
        let lists = phase.chunks_mut(BLOCK).zip(compared.chunks_mut(BLOCK));
        for ((numbers, start), (phase, compared)) in
            blocks.iter().zip((0..).step_by(BLOCK)).zip(lists)
        {
            let columns = start..start + phase.len();
            let cubics = cubics.part(columns.clone());
            phase.copy_from_slice(cubics.base);
            compared.fill(false);
            let Some(from) = Whole::of(numbers) else {
                continue;
            };
            let pixels = BlockPixels {
                numbers,
                from,
                u: start,
                v,
                base: &bases[columns],
                cubics,
            };
            let mut sought = Sought::default();
            expect_block(backend, heights, pixels, phase, compared, &mut sought);
            for (i, phase) in phase.iter_mut().enumerate() {
                if sought.exact[i] != 0 {
                    let z = pixels.base[i].mm() + f64::from(sought.rise[i]) * 1e-6;
                    *phase = exact_phase(golden, (start + i, v), z);
                }
            }
        }
    }
}

/// The phase at which a pixel sees height `z` mm.
fn exact_phase(golden: &Golden, (u, v): (usize, usize), z: f64) -> AbsolutePhase {
    let sight = golden.triangulator.sight(u as f64, v as f64);
    let turns = sight.and_then(|sight| sight.phase(z));
    turns.map_or(AbsolutePhase::UNKNOWN, AbsolutePhase::from_turns)
}

back_end_entry! {
    /// The phases of a block of pixels, and whether golden is compared where they look; left as
    /// they are where nothing is known of it.
    fn expect_block [] = expect_pixels(
        golden: GoldenHeights<'_>,
        pixels: BlockPixels<'_>,
        phase: &mut [AbsolutePhase],
        compared: &mut [bool],
        sought: &mut Sought,
    )
}

#[inline(always)]
fn expect_pixels<V: Lanes>(
    _: V,
    golden: GoldenHeights<'_>,
    pixels: BlockPixels<'_>,
    phase: &mut [AbsolutePhase],
    compared: &mut [bool],
    sought: &mut Sought,
) {
    let length = phase.len().min(BLOCK);
    let GoldenHeights {
        height,
        taught,
        width,
        rows,
    } = golden;
    let linear = Linear::of(pixels.numbers, pixels.from);
    let from = pixels.from.pixels();
    let from = [
        from[0].wrapping_add(pixels.u as i32),
        from[1].wrapping_add(pixels.v as i32),
    ];
    let base = &pixels.base[..length];
    let mut known = [false; BLOCK];
    for i in 0..length {
        known[i] = base[i].is_known() & (pixels.cubics.reach[i] > 0);
    }
    let (mut place, mut nearest) = ([0; BLOCK], [0; BLOCK]);
    let (mut along, mut down, mut up) = ([0.0; BLOCK], [0.0; BLOCK], [0.0; BLOCK]);
    let mut corners = [[0; BLOCK]; 4];
    let rise = &mut sought.rise;
    for _ in 0..ROUNDS {
        for i in 0..length {
            let z = base[i].nm() as f32 + rise[i];
            let [du, dv, dz] = linear.at_height(i, z);
            let (left, top) = (floor(du), floor(dv));
            let (column, row) = (
                (from[0] + i as i32).wrapping_add(whole(left)),
                from[1].wrapping_add(whole(top)),
            );
            let inside = is_near(du)
                & is_near(dv)
                & (column >= 0)
                & (row >= 0)
                & (column < width as i32 - 1)
                & (row < rows as i32 - 1);
            known[i] &= inside;
            (along[i], down[i], up[i]) = (du - left, dv - top, dz);
            let at = row.wrapping_mul(width as i32).wrapping_add(column);
            place[i] = if known[i] { at } else { 0 };
        }
        for i in 0..length {
            let at = place[i] as usize;
            let (upper, lower) = (&height[at..at + 2], &height[at + width..at + width + 2]);
            corners[0][i] = upper[0].nm();
            corners[1][i] = upper[1].nm();
            corners[2][i] = lower[0].nm();
            corners[3][i] = lower[1].nm();
        }
        let unknown = Height::UNKNOWN.nm();
        for i in 0..length {
            let [first, right, under, both] =
                [corners[0][i], corners[1][i], corners[2][i], corners[3][i]];
            known[i] &=
                (first != unknown) & (right != unknown) & (under != unknown) & (both != unknown);
            let upper = right.wrapping_sub(first) as f32;
            let lower = both.wrapping_sub(under) as f32;
            let left = under.wrapping_sub(first) as f32;
            let golden = along[i] * upper + down[i] * (left + along[i] * (lower - upper));
            let above = first.wrapping_sub(base[i].nm()) as f32;
            rise[i] = if known[i] {
                (above + golden) - up[i]
            } else {
                0.0
            };
        }
    }
    for i in 0..length {
        let right = i32::from(along[i] >= 0.5);
        let under = if down[i] >= 0.5 { width as i32 } else { 0 };
        nearest[i] = place[i] + right + under;
    }
    for i in 0..length {
        compared[i] = known[i] & (taught[nearest[i] as usize] >= COMPARED);
    }
    let cubics = pixels.cubics;
    let scale = (cubics.range * 65_536.0) as f32;
    let (bases, first) = (&cubics.base[..length], &cubics.first[..length]);
    let (second, third) = (&cubics.second[..length], &cubics.third[..length]);
    let reach = &cubics.reach[..length];
    for i in 0..length {
        let (a, b, c) = (
            first[i],
            CubicRow::coefficient(second[i]),
            CubicRow::coefficient(third[i]),
        );
        // A step of Newton's method from the linear solution: 1e-5 turn.
        let y = rise[i] / a;
        let miss = y * (a + y * (b + y * c)) - rise[i];
        let y = y - miss / (a + y * ((b + b) + y * (3.0 * c)));
        let delta = y * scale;
        let far = (i32::from(reach[i]) << 9) as f32;
        let reached = bases[i].is_known() & (delta < far) & (delta > -far);
        let bits = bases[i].to_bits().wrapping_add(whole(delta));
        let bits = if known[i] & reached {
            bits
        } else {
            bases[i].to_bits()
        };
        phase[i] = AbsolutePhase::from_bits(bits);
        sought.exact[i] = i32::from(known[i] & !reached);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::strips::align::displaced::{Node, between};
    use crate::pipeline::SQUARE;
    use std::vec;
    use std::vec::Vec;

    const WIDTH: usize = 80;
    const ROWS: usize = 40;
    const RANGE: f64 = 0.5;
    /// Coefficients of the cubic: nm, nm, units of 100 nm.
    const CUBIC: (f32, i16, i16) = (1.5e6, -300, 70);

    /// A hash of a place, which has the same number wherever it is asked for.
    fn scatter(place: usize) -> u32 {
        (place as u32).wrapping_mul(2_654_435_761).rotate_left(13)
    }

    fn height(at: usize) -> Height {
        let (u, v) = ((at % WIDTH) as f64, (at / WIDTH) as f64);
        let step = if u > 61.0 { 3e6 } else { 0.0 };
        let rough = f64::from(scatter(at) % 20_000);
        match scatter(at) % 97 {
            0 => Height::UNKNOWN,
            _ => Height::from_nm((4e5 * libm::sin(u / 9.0) + 2e4 * v + step + rough) as i32),
        }
    }

    /// z − z₀ in nm and the place that golden is compared at, in double precision; none where
    /// golden is not known.
    fn sought(
        heights: &[Height],
        at: usize,
        start: usize,
        numbers: &BlockNumbers,
    ) -> Option<(f64, usize)> {
        let mut z = f64::from(heights[at].is_known().then(|| heights[at].nm())?);
        let mut nearest = at;
        for _ in 0..ROUNDS {
            let column = (at % WIDTH - start) as f64;
            let n = numbers.map(f64::from);
            let [du, dv, dz] = core::array::from_fn(|i| n[i] + n[3 + i] * column + n[6 + i] * z);
            let (u, v) = ((at % WIDTH) as f64 + du, (at / WIDTH) as f64 + dv);
            let (left, top) = (libm::floor(u), libm::floor(v));
            if left < 0.0 || top < 0.0 || left >= (WIDTH - 1) as f64 || top >= (ROWS - 1) as f64 {
                return None;
            }
            let place = top as usize * WIDTH + left as usize;
            let four = [place, place + 1, place + WIDTH, place + WIDTH + 1].map(|at| heights[at]);
            if !four.iter().all(|height| height.is_known()) {
                return None;
            }
            let [a, b, c, d] = four.map(|height| f64::from(height.nm()));
            let (fu, fv) = (u - left, v - top);
            z = (a + (b - a) * fu) * (1.0 - fv) + (c + (d - c) * fu) * fv - dz;
            nearest = place + usize::from(fu >= 0.5) + if fv >= 0.5 { WIDTH } else { 0 };
        }
        Some((z - f64::from(heights[at].nm()), nearest))
    }

    #[test]
    fn expected_phases_are_those_of_double_precision() {
        let places = 0..WIDTH * ROWS;
        let heights: Vec<_> = places.clone().map(height).collect();
        let taught: Vec<_> = places
            .clone()
            .map(|at| {
                if scatter(at).is_multiple_of(5) {
                    0
                } else {
                    COMPARED | SQUARE
                }
            })
            .collect();
        let base: Vec<_> = places
            .clone()
            .map(|at| AbsolutePhase::from_bits(scatter(at) as i32 >> 8))
            .collect();
        let reach: Vec<_> = places
            .clone()
            .map(|at| {
                if scatter(at).is_multiple_of(31) {
                    0
                } else {
                    60
                }
            })
            .collect();
        let (first, second) = (vec![CUBIC.0; base.len()], vec![CUBIC.1; base.len()]);
        let third = vec![CUBIC.2; base.len()];
        let golden = GoldenHeights {
            height: &heights,
            taught: &taught,
            width: WIDTH,
            rows: ROWS,
        };
        let mut counts = [0; 4];
        for shift in [0.0, 0.3, -7.4, 12.6] {
            let node = |at: f64| -> Node {
                [
                    [shift + 0.2 * at, 0.4 * shift, 0.01],
                    [0.02, -0.03, 0.001],
                    [0.0; 3],
                ]
            };
            let numbers = between([&node(0.0), &node(1.0)], 64, 0, 0.3);
            for (v, start) in (0..ROWS).flat_map(|v| [(v, 0), (v, 32), (v, 64)]) {
                let length = BLOCK.min(WIDTH - start);
                let row = v * WIDTH + start..v * WIDTH + start + length;
                let pixels = BlockPixels {
                    numbers: &numbers,
                    from: Whole::of(&numbers).unwrap(),
                    u: start,
                    v,
                    base: &heights[row.clone()],
                    cubics: CubicRow {
                        base: &base[row.clone()],
                        first: &first[row.clone()],
                        second: &second[row.clone()],
                        third: &third[row.clone()],
                        reach: &reach[row.clone()],
                        range: RANGE,
                    },
                };
                let found = |backend| {
                    let mut phase = vec![AbsolutePhase::UNKNOWN; length];
                    let (mut compared, mut out) = (vec![false; length], Sought::default());
                    expect_block(backend, golden, pixels, &mut phase, &mut compared, &mut out);
                    (phase, compared, out.exact)
                };
                let (phase, compared, exact) = found(Backend::PORTABLE);
                for backend in Backend::available() {
                    assert_eq!(found(backend), (phase.clone(), compared.clone(), exact));
                }
                for (i, at) in row.enumerate() {
                    let known = (reach[at] > 0).then(|| sought(&heights, at, start, &numbers));
                    let Some((rise, nearest)) = known.flatten() else {
                        assert_eq!((phase[i], compared[i], exact[i]), (base[at], false, 0));
                        counts[0] += 1;
                        continue;
                    };
                    let (a, b, c) = (
                        f64::from(CUBIC.0),
                        f64::from(CUBIC.1) * 100.0,
                        f64::from(CUBIC.2) * 100.0,
                    );
                    let mut y = rise / a;
                    for _ in 0..9 {
                        y -= (y * (a + y * (b + y * c)) - rise) / (a + y * (2.0 * b + y * 3.0 * c));
                    }
                    let delta = y * RANGE;
                    let far = f64::from(reach[at]) / 128.0;
                    assert_eq!(compared[i], taught[nearest] >= COMPARED, "{v} {at}");
                    counts[usize::from(compared[i]) + 1] += 1;
                    if (delta.abs() - far).abs() > 1e-4 {
                        assert_eq!(
                            exact[i] != 0,
                            delta.abs() > far,
                            "{shift} {v} {at}: {delta}"
                        );
                    }
                    if exact[i] != 0 {
                        counts[3] += 1;
                    } else {
                        let error = (phase[i] - base[at]).turns() - delta;
                        assert!(error.abs() < 3.1e-5, "{shift} {v} {at}: {error}");
                    }
                }
            }
        }
        assert!(counts.iter().all(|count| *count > 100), "{counts:?}");
    }
}
