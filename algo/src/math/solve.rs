//! Least squares for a few unknowns, by their normal equations.

/// The normal equations of linear least squares: of observations aᵀx = b with N unknowns x.
#[derive(Clone, Copy, Debug)]
pub struct Normal<const N: usize> {
    /// Σ a aᵀ; only its lower triangle is kept.
    pub(crate) matrix: [[f64; N]; N],
    /// Σ a b.
    pub(crate) right: [f64; N],
}

impl<const N: usize> Default for Normal<N> {
    fn default() -> Self {
        Self {
            matrix: [[0.0; N]; N],
            right: [0.0; N],
        }
    }
}

impl<const N: usize> Normal<N> {
    /// The equations of these observations, added in their order.
    pub fn of(observations: impl IntoIterator<Item = ([f64; N], f64)>) -> Self {
        let mut normal = Self::default();
        for (a, b) in observations {
            normal.add(&a, b);
        }
        normal
    }

    /// Adds an observation.
    pub fn add(&mut self, a: &[f64; N], b: f64) {
        for (i, row) in self.matrix.iter_mut().enumerate() {
            for (sum, other) in row.iter_mut().zip(&a[..=i]) {
                *sum += a[i] * other;
            }
            self.right[i] += a[i] * b;
        }
    }

    /// The unknowns; `None` where the observations do not determine them.
    pub fn solve(mut self) -> Option<[f64; N]> {
        solve_symmetric(self.matrix.as_flattened_mut(), &mut self.right)?;
        Some(self.right)
    }
}

/// Solves the symmetric positive definite system `a · x = b` by Cholesky's method and leaves x in
/// `b`.
///
/// `a` is row-major n × n with n = `b.len()`; only its lower triangle is read, and it is
/// overwritten. Returns `None` where the matrix is not positive definite to working precision, that
/// is, where the observations do not determine the unknowns.
pub(crate) fn solve_symmetric(a: &mut [f64], b: &mut [f64]) -> Option<()> {
    let n = b.len();
    for j in 0..n {
        let mut diagonal = a[j * n + j];
        let scale = diagonal;
        for k in 0..j {
            diagonal -= a[j * n + k] * a[j * n + k];
        }
        if diagonal <= scale * 1e-14 || !diagonal.is_finite() {
            return None;
        }
        let root = libm::sqrt(diagonal);
        a[j * n + j] = root;
        for i in j + 1..n {
            let mut sum = a[i * n + j];
            for k in 0..j {
                sum -= a[i * n + k] * a[j * n + k];
            }
            a[i * n + j] = sum / root;
        }
    }
    for i in 0..n {
        for k in 0..i {
            b[i] -= a[i * n + k] * b[k];
        }
        b[i] /= a[i * n + i];
    }
    for i in (0..n).rev() {
        for k in i + 1..n {
            b[i] -= a[k * n + i] * b[k];
        }
        b[i] /= a[i * n + i];
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec;

    #[test]
    fn a_small_system_is_solved_and_a_singular_one_refused() {
        let mut a = vec![4.0, 2.0, 0.6, 2.0, 5.0, 1.0, 0.6, 1.0, 3.0];
        let mut b = vec![4.0 + 4.0 + 1.8, 2.0 + 10.0 + 3.0, 0.6 + 2.0 + 9.0];
        solve_symmetric(&mut a, &mut b).unwrap();
        for (found, expected) in b.iter().zip([1.0, 2.0, 3.0]) {
            assert!((found - expected).abs() < 1e-12);
        }
        assert!(solve_symmetric(&mut [1.0, 1.0, 1.0, 1.0], &mut [1.0, 1.0]).is_none());
    }
}
