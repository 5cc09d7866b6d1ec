//! Symmetric linear systems of a few unknowns, as least squares give them.

use alloc::vec::Vec;

/// Solves the symmetric positive definite system `a · x = b` in place by Cholesky's method.
///
/// `a` is row-major n × n with n = `b.len()`. Returns `None` where the matrix is not positive
/// definite to working precision, that is, where the observations do not determine the unknowns.
pub fn solve_symmetric(a: &mut [f64], b: &mut [f64]) -> Option<Vec<f64>> {
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
    let mut x = b.to_vec();
    for i in 0..n {
        for k in 0..i {
            x[i] -= a[i * n + k] * x[k];
        }
        x[i] /= a[i * n + i];
    }
    for i in (0..n).rev() {
        for k in i + 1..n {
            x[i] -= a[k * n + i] * x[k];
        }
        x[i] /= a[i * n + i];
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::solve_symmetric;
    use std::vec;

    #[test]
    fn a_small_system_is_solved_and_a_singular_one_refused() {
        let mut a = vec![4.0, 2.0, 0.6, 2.0, 5.0, 1.0, 0.6, 1.0, 3.0];
        let mut b = vec![4.0 + 4.0 + 1.8, 2.0 + 10.0 + 3.0, 0.6 + 2.0 + 9.0];
        let x = solve_symmetric(&mut a, &mut b).unwrap();
        for (found, expected) in x.iter().zip([1.0, 2.0, 3.0]) {
            assert!((found - expected).abs() < 1e-12);
        }
        assert!(solve_symmetric(&mut [1.0, 1.0, 1.0, 1.0], &mut [1.0, 1.0]).is_none());
    }
}
