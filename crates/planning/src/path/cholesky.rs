//! Cholesky's factorisation of small dense matrices, without allocation.
//!
//! nalgebra's takes a matrix of its own and divides it by columns; here the memory is the caller's, and the inner loops run
//! along rows, which compilers turn into vector instructions.

/// Replaces the lower triangle of a symmetric matrix (row by row, `size` × `size`) by its Cholesky factor; false if it is
/// not positive definite. The upper triangle is scratch.
pub(crate) fn factorise(matrix: &mut [f64], size: usize) -> bool {
    for j in 0..size {
        let (head, below) = matrix.split_at_mut((j + 1) * size);
        let pivot = head[j * size + j];
        if pivot.is_nan() || pivot <= 0.0 {
            return false;
        }
        let root = pivot.sqrt();
        head[j * size + j] = root;
        // What is right of the pivot in its row holds the column, so that it is contiguous.
        let column = &mut head[j * size + j + 1..];
        for (entry, row) in column.iter_mut().zip(below.chunks_exact_mut(size)) {
            *entry = row[j] / root;
            row[j] = *entry;
        }
        for (i, row) in below.chunks_exact_mut(size).enumerate() {
            let factor = column[i];
            for (entry, other) in row[j + 1..].iter_mut().zip(&column[..=i]) {
                *entry -= factor * other;
            }
        }
    }
    true
}

/// Solves L Lᵀ x = b in place, with the factor of [`factorise`].
pub(crate) fn substitute(factor: &[f64], x: &mut [f64]) {
    let size = x.len();
    for (i, row) in factor.chunks_exact(size).enumerate() {
        let known: f64 = row[..i].iter().zip(&x[..i]).map(|(a, b)| a * b).sum();
        x[i] = (x[i] - known) / row[i];
    }
    for (i, row) in factor.chunks_exact(size).enumerate().rev() {
        let (earlier, rest) = x.split_at_mut(i);
        rest[0] /= row[i];
        for (value, entry) in earlier.iter_mut().zip(&row[..i]) {
            *value -= entry * rest[0];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_positive_definite_system_is_solved() {
        let size = 30;
        let value = |i: usize, j: usize| ((i * 31 + j * 17) as f64).sin();
        let dense = |i: usize, j: usize| {
            let inner: f64 = (0..size).map(|k| value(i, k) * value(j, k)).sum();
            inner + if i == j { 0.1 } else { 0.0 }
        };
        let mut matrix: Vec<f64> = (0..size * size)
            .map(|e| dense(e / size, e % size))
            .collect();
        let right: Vec<f64> = (0..size).map(|i| (i as f64).cos()).collect();
        assert!(factorise(&mut matrix, size));
        let mut x = right.clone();
        substitute(&matrix, &mut x);
        for (i, wanted) in right.iter().enumerate() {
            let found: f64 = (0..size).map(|j| dense(i, j) * x[j]).sum();
            assert!((found - wanted).abs() < 1e-9, "{found} instead of {wanted}");
        }
    }

    #[test]
    fn what_is_not_positive_definite_is_refused() {
        assert!(!factorise(&mut [1.0, 0.0, 2.0, 1.0], 2));
        assert!(!factorise(&mut [f64::NAN], 1));
    }
}
