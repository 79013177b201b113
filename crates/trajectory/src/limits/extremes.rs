//! The largest magnitude of polynomials of degree 2, 3 and 4 over 0..1, from their Bernstein control values.

/// The largest magnitude of Bernstein control values, which bounds that of the polynomial.
pub(super) fn largest_control(control: &[f64]) -> f64 {
    control
        .iter()
        .fold(0.0, |most: f64, value| most.max(value.abs()))
}

/// Value at `u` in 0..1 of the polynomial with these Bernstein control values (de Casteljau).
fn value_at<const N: usize>(control: &[f64; N], u: f64) -> f64 {
    let mut points = *control;
    for level in (1..N).rev() {
        for i in 0..level {
            points[i] += u * (points[i + 1] - points[i]);
        }
    }
    points[0]
}

/// The largest |value| of a quadratic over 0..1.
pub(super) fn extreme_of_quadratic(control: &[f64; 3]) -> f64 {
    let [first, middle, last] = *control;
    let ends = first.abs().max(last.abs());
    let turn = (first - middle) / (first - 2.0 * middle + last);
    if turn > 0.0 && turn < 1.0 {
        ends.max(value_at(control, turn).abs())
    } else {
        ends
    }
}

/// The largest |value| of a cubic over 0..1; `slope`: control values proportional to its derivative.
pub(super) fn extreme_of_cubic(control: &[f64; 4], slope: &[f64; 3]) -> f64 {
    let ends = control[0].abs().max(control[3].abs());
    quadratic_roots(slope)
        .into_iter()
        .fold(ends, |most, u| most.max(value_at(control, u).abs()))
}

/// The largest |value| of a quartic over 0..1; `slope` and `bend`: control values proportional to its first two derivatives.
///
/// The roots of `bend` cut 0..1 into at most three intervals on which `slope` is monotone, so each has at most
/// one root of it, bracketed by a change of sign.
pub(super) fn extreme_of_quartic(control: &[f64; 5], slope: &[f64; 4], bend: &[f64; 3]) -> f64 {
    let mut most = control[0].abs().max(control[4].abs());
    let [first, second] = quadratic_roots(bend);
    let cuts = [0.0, first.min(second), first.max(second), 1.0];
    for pair in cuts.windows(2) {
        if let Some(root) = monotone_root(slope, pair[0], pair[1]) {
            most = most.max(value_at(control, root).abs());
        }
    }
    most
}

/// The roots in 0..1 of a quadratic; 0 stands for a root that does not exist or is outside.
fn quadratic_roots(control: &[f64; 3]) -> [f64; 2] {
    let [c, half, last] = *control;
    let half_b = half - c;
    let a = c - 2.0 * half + last;
    let discriminant = half_b * half_b - a * c;
    if discriminant < 0.0 {
        return [0.0; 2];
    }
    // The form without cancellation: q has the sign of −b, the roots are q/a and c/q.
    let q = -(half_b + discriminant.sqrt().copysign(half_b));
    [q / a, c / q].map(|root| if root > 0.0 && root < 1.0 { root } else { 0.0 })
}

/// The root between `low` and `high` of a cubic that is monotone there, by Newton's method within a bracket.
fn monotone_root(control: &[f64; 4], mut low: f64, mut high: f64) -> Option<f64> {
    // At an extreme the error of the value is quadratic in the error of the root: this is far more than enough.
    const PRECISION: f64 = 1e-12;
    let rises = value_at(control, high) > 0.0;
    if low >= high || (value_at(control, low) > 0.0) == rises {
        return None;
    }
    let mut root = 0.5 * (low + high);
    for _ in 0..60 {
        let (value, slope) = value_and_slope(control, root);
        *(if (value > 0.0) == rises {
            &mut high
        } else {
            &mut low
        }) = root;
        let step = value / slope;
        let next = root - step;
        let is_inside = next > low && next < high;
        root = if is_inside { next } else { 0.5 * (low + high) };
        if high - low < PRECISION || (is_inside && step.abs() < PRECISION) {
            break;
        }
    }
    Some(root)
}

/// Value and derivative at `u` of the cubic with these control values.
fn value_and_slope(control: &[f64; 4], u: f64) -> (f64, f64) {
    let between = |a: f64, b: f64| a + u * (b - a);
    let [a, b, c, d] = *control;
    let (ab, bc, cd) = (between(a, b), between(b, c), between(c, d));
    let (first, second) = (between(ab, bc), between(bc, cd));
    (between(first, second), 3.0 * (second - first))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    fn sampled<const N: usize>(control: &[f64; N]) -> f64 {
        (0..=4000)
            .map(|i| value_at(control, f64::from(i) / 4000.0).abs())
            .fold(0.0, f64::max)
    }

    fn differences<const N: usize, const M: usize>(control: &[f64; N]) -> [f64; M] {
        std::array::from_fn(|i| control[i + 1] - control[i])
    }

    #[test]
    fn extremes_agree_with_dense_samples() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(11);
        let mut inside = 0;
        for _ in 0..3000 {
            let quartic: [f64; 5] = std::array::from_fn(|_| random.random_range(-1.0..1.0));
            let cubic: [f64; 4] = differences(&quartic);
            let quadratic: [f64; 3] = differences(&cubic);
            let exact = [
                extreme_of_quartic(&quartic, &cubic, &quadratic),
                extreme_of_cubic(&cubic, &quadratic),
                extreme_of_quadratic(&quadratic),
            ];
            let dense = [sampled(&quartic), sampled(&cubic), sampled(&quadratic)];
            for (exact, dense) in exact.into_iter().zip(dense) {
                assert!(
                    exact >= dense - 1e-14 && exact - dense < 1e-6,
                    "{exact} against {dense}"
                );
            }
            inside += usize::from(exact[0] > quartic[0].abs().max(quartic[4].abs()));
        }
        assert!(
            inside > 500,
            "only {inside} extremes were inside the interval"
        );
    }

    #[test]
    fn flat_and_degenerate_polynomials_are_exact() {
        assert_eq!(extreme_of_quartic(&[2.0; 5], &[0.0; 4], &[0.0; 3]), 2.0);
        assert_eq!(extreme_of_cubic(&[0.0, 1.0, 2.0, 3.0], &[1.0; 3]), 3.0);
        assert_eq!(extreme_of_quadratic(&[-1.0, 0.0, 1.0]), 1.0);
        // (u − ½)³ as slope: a triple root, where the second derivative has a double one.
        let slope = [-0.125, 0.125, -0.125, 0.125];
        let quartic = [0.0, -0.125, 0.0, -0.125, 0.0];
        let most = extreme_of_quartic(&quartic, &slope, &differences(&slope));
        assert!((most - 0.0625).abs() < 1e-12, "{most}");
    }
}
