//! Where the rays of a camera's pixel go.
//!
//! A pixel sees the light at x with the density box ⊗ Gaussian of the lens: light is blurred before
//! the pixel adds it up. Along each axis the rays lie in the middles of shares of equal probability.
//! Most pixels have them on a lattice, whose side grows with the lens's σ. A pixel that sees an edge
//! of a face or of a shadow has a point set of low discrepancy instead (J. M. Hammersley, 1960),
//! scrambled by an exclusive or with a number of the pixel's own and shifted within its cells, so
//! that rows of rays never lie along an edge: each column and each row of the 256 holds one of them.
//! The share of light beside an edge is exact to 1/256 if it lies along the pixels, and to 0.006 RMS
//! in any direction (`edges_in_all_directions_have_their_share_of_the_light`).
//!
//! Parts that are thin surfaces have rays on a lattice over the bare pixel, and pictures that are
//! blurred when they are finished.

/// Rays of a pixel that sees an edge: as many as a byte has values.
const EDGE_RAYS: usize = 256;
/// Places of a ray in its column and its row.
const PLACES: usize = 16;
/// No ray that counts goes farther than half a pixel and this many σ.
const CUT: f64 = 3.0;
/// Most rays along a side of a lattice.
const MAX_SIDE: usize = 16;

/// The rays of every pixel of a camera.
pub(super) struct Footprint {
    lattice: Vec<[f64; 2]>,
    /// Along one axis, [`PLACES`] for each ray of a pixel that sees an edge.
    nodes: Vec<f64>,
    /// Which pixels see an edge, row by row; none if it is empty.
    edges: Vec<bool>,
}

impl Footprint {
    /// A lattice of `n` × `n` rays over the bare pixel.
    pub fn bare(n: u32) -> Self {
        let offset = |i: u32| (f64::from(i) + 0.5) / f64::from(n) - 0.5;
        Self {
            lattice: lattice(&(0..n).map(offset).collect::<Vec<_>>()),
            nodes: Vec::new(),
            edges: Vec::new(),
        }
    }

    /// Rays behind a lens of σ `sigma`, pixels: at least `n` × `n`, and more where the labels of the
    /// central rays of pixels nearby differ. `labels` has `width` columns.
    pub fn blurred(n: u32, sigma: f64, labels: &[u16], width: usize) -> Self {
        let reach = (0.5 + CUT * sigma).ceil() as usize;
        let side = (n as usize).max((2.0 + 4.0 * sigma) as usize);
        Self {
            lattice: lattice(&nodes(side.min(MAX_SIDE), sigma)),
            nodes: nodes(EDGE_RAYS * PLACES, sigma),
            edges: differing(labels, width, reach),
        }
    }

    /// Writes the offsets of the rays of pixel number `at` from its centre, pixels.
    pub fn rays(&self, at: usize, rays: &mut Vec<[f64; 2]>) {
        rays.clear();
        if !self.edges.get(at).is_some_and(|edge| *edge) {
            rays.extend_from_slice(&self.lattice);
            return;
        }
        rays.extend(scrambled(&self.nodes, scramble(at)));
    }
}

/// All pairs; the first of a pair changes first.
fn lattice(nodes: &[f64]) -> Vec<[f64; 2]> {
    let row = |y: &f64| nodes.iter().map(|x| [*x, *y]).collect::<Vec<_>>();
    nodes.iter().flat_map(row).collect()
}

/// A number that looks random, other for each pixel (Fibonacci hashing, D. E. Knuth).
fn scramble(at: usize) -> u16 {
    ((at as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 48) as u16
}

/// The points of a Hammersley set in a pixel's footprint. Of `by`, the high byte scrambles the rows
/// and the low one shifts all rays within columns and rows.
fn scrambled(nodes: &[f64], by: u16) -> impl Iterator<Item = [f64; 2]> {
    let [high, low] = by.to_be_bytes().map(usize::from);
    let shifts = [low % PLACES, low / PLACES % PLACES];
    (0..EDGE_RAYS).map(move |column| {
        let row = usize::from((column as u8).reverse_bits()) ^ high;
        [
            nodes[column * PLACES + shifts[0]],
            nodes[row * PLACES + shifts[1]],
        ]
    })
}

/// The middles of `count` shares, 2 or more, of equal probability of box ⊗ Gaussian of σ `sigma`,
/// moved apart so that their variance is its: σ² + 1/12.
fn nodes(count: usize, sigma: f64) -> Vec<f64> {
    let sigma = sigma.max(1e-9);
    // The integral of the cumulative normal distribution.
    let ramp = |a: f64| {
        let below = 0.5 * libm::erfc(-a / std::f64::consts::SQRT_2);
        a * below + (-0.5 * a * a).exp() / std::f64::consts::TAU.sqrt()
    };
    let below = |x: f64| sigma * (ramp((x + 0.5) / sigma) - ramp((x - 0.5) / sigma));
    let node = |at: usize| {
        let share = (at as f64 + 0.5) / count as f64;
        let [mut low, mut high] = [-0.5 - 8.0 * sigma, 0.5 + 8.0 * sigma];
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            match below(middle) < share {
                true => low = middle,
                false => high = middle,
            }
        }
        0.5 * (low + high)
    };
    let nodes: Vec<f64> = (0..count).map(node).collect();
    let variance = nodes.iter().map(|x| x * x).sum::<f64>() / count as f64;
    let scale = ((sigma * sigma + 1.0 / 12.0) / variance).sqrt();
    nodes.iter().map(|x| scale * x).collect()
}

/// Where labels differ within `reach` columns and rows.
fn differing(labels: &[u16], width: usize, reach: usize) -> Vec<bool> {
    let height = labels.len() / width.max(1);
    let window = |at: usize, length: usize| at.saturating_sub(reach)..=(at + reach).min(length - 1);
    let joined = |a: [u16; 2], b: [u16; 2]| [a[0].min(b[0]), a[1].max(b[1])];
    let across = |at: usize| {
        let (x, row) = (at % width, at / width * width);
        window(x, width).fold([u16::MAX, 0], |ends, x| joined(ends, [labels[row + x]; 2]))
    };
    let across: Vec<_> = (0..labels.len()).map(across).collect();
    let down = |at: usize| {
        let (x, y) = (at % width, at / width);
        let ends = window(y, height).map(|y| across[y * width + x]);
        let [low, high] = ends.fold([u16::MAX, 0], joined);
        low < high
    };
    (0..labels.len()).map(down).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_in_all_directions_have_their_share_of_the_light() {
        // The shares beside edges through a footprint, against those by 1024² rays.
        for sigma in [0.0, 0.5] {
            let fine = nodes(EDGE_RAYS * PLACES, sigma);
            let all = lattice(&nodes(1024, sigma));
            let (mut squares, mut worst, mut count) = (0.0, 0.0_f64, 0.0);
            for turn in 0..60 {
                let (sin, cos) = (f64::from(turn) * 0.0523).sin_cos();
                let at = 0.3 * (f64::from(turn) * 1.7).sin();
                let inside = |[x, y]: [f64; 2]| x * cos + y * sin < at;
                let exact =
                    all.iter().filter(|ray| inside(**ray)).count() as f64 / all.len() as f64;
                for by in [0, 9_377, 33_280, 65_535] {
                    let found = scrambled(&fine, by).filter(|ray| inside(*ray)).count();
                    let off = found as f64 / 256.0 - exact;
                    (squares, count) = (squares + off * off, count + 1.0);
                    worst = worst.max(off.abs());
                }
            }
            let rms = (squares / count).sqrt();
            assert!(rms < 0.0065 && worst < 0.03, "σ {sigma}: {rms}, {worst}");
        }
    }

    #[test]
    fn rays_have_the_variance_of_lens_and_pixel() {
        for sigma in [0.0, 0.4, 2.0] {
            let mut rays = Vec::new();
            let mut labels = [1; 20];
            labels[19] = 2;
            let footprint = Footprint::blurred(1, sigma, &labels, 20);
            for (at, side, tolerance) in [(0, 2.0 + 4.0 * sigma, 1e-9), (19, 16.0, 0.02)] {
                footprint.rays(at, &mut rays);
                let count = rays.len();
                assert_eq!(count, (side as usize).pow(2));
                for axis in 0..2 {
                    let values = || rays.iter().map(|ray| ray[axis]);
                    let mean = values().sum::<f64>() / count as f64;
                    let variance = values().map(|x| x * x).sum::<f64>() / count as f64;
                    let expected = sigma * sigma + 1.0 / 12.0;
                    assert!(mean.abs() < tolerance * expected.sqrt(), "{mean}");
                    assert!((variance / expected - 1.0).abs() < tolerance, "{variance}");
                }
            }
        }
    }

    #[test]
    fn pixels_near_an_edge_are_known() {
        let mut labels = vec![3; 7 * 5];
        labels[2 * 7 + 4] = 2;
        let edges = differing(&labels, 7, 1);
        for (at, edge) in edges.iter().enumerate() {
            let near = (at % 7).abs_diff(4) <= 1 && (at / 7).abs_diff(2) <= 1;
            assert_eq!(*edge, near, "{at}");
        }
        assert!(!differing(&[7; 12], 4, 2).contains(&true));
    }
}
