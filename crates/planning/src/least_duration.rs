//! The least time that a path can take, before anything is timed.

use pcc_model::{Configuration, DOF, Robot, TendonLimits};

/// No motion from rest to rest through these shapes (radians) is faster, s: some tendon needs it for its own way alone, which
/// rests wherever it turns back.
pub(crate) fn least_duration_s(
    robot: &Robot,
    limits: &TendonLimits,
    shapes: &[Configuration],
) -> f64 {
    let matrix = robot.tendons.matrix();
    let tendon = |row: usize| {
        let row: Configuration = matrix.fixed_view::<1, DOF>(row, 0).transpose();
        let (mut way, mut total) = (0.0_f64, 0.0);
        for pair in shapes.windows(2) {
            let step = row.dot(&(pair[1] - pair[0]));
            if step * way < 0.0 {
                total += rest_to_rest_s(limits, way.abs());
                way = 0.0;
            }
            way += step;
        }
        total + rest_to_rest_s(limits, way.abs())
    };
    (0..matrix.nrows()).map(tendon).fold(0.0, f64::max)
}

/// Least time of a tendon for a way in one direction.
fn rest_to_rest_s(limits: &TendonLimits, way: f64) -> f64 {
    let (speed, acceleration) = (limits.velocity, limits.acceleration);
    if way * acceleration <= speed * speed {
        2.0 * (way / acceleration).sqrt()
    } else {
        way / speed + speed / acceleration
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::unit_robot;

    #[test]
    fn a_way_there_and_back_takes_twice_as_long_as_the_way_there() {
        let robot = unit_robot();
        let limits = &robot.tendon_limits;
        let rest = Configuration::zeros();
        let bent = Configuration::from_column_slice(&[0.0, 0.8, 0.0, 0.0, 0.0, 0.0]);
        let there = least_duration_s(&robot, limits, &[rest, bent]);
        let halfway = least_duration_s(&robot, limits, &[rest, bent * 0.5, bent]);
        let and_back = least_duration_s(&robot, limits, &[rest, bent, rest]);
        assert!(there > 0.5);
        assert!((halfway - there).abs() < 1e-12);
        assert!((and_back - 2.0 * there).abs() < 1e-12);
    }
}
