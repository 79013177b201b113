//! Waypoints at equal distances along the path of the tip.

use pcc_model::{Configuration, UnitRobot};
use planning::{WAYPOINTS, Waypoints, parameter};

/// Resamples a polyline in configuration space (rad, at least one configuration) to 64 waypoints between which the tip moves equally far.
pub(crate) fn equally_spaced(robot: &UnitRobot, polyline: &[Configuration]) -> Waypoints {
    let tips = robot.tips(polyline);
    let steps: Vec<f64> = tips.windows(2).map(|w| (w[1] - w[0]).norm()).collect();
    let total: f64 = steps.iter().sum();
    let (mut edge, mut passed) = (0, 0.0);
    let waypoint = |h| {
        let wanted = total * parameter(h);
        while edge + 1 < steps.len() && passed + steps[edge] < wanted {
            passed += steps[edge];
            edge += 1;
        }
        let Some(step) = steps.get(edge) else {
            return polyline[0];
        };
        let part = ((wanted - passed) / step.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        polyline[edge].lerp(&polyline[edge + 1], part)
    };
    (0..WAYPOINTS).map(waypoint).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;

    #[test]
    fn the_tip_moves_equally_far_on_every_edge() {
        let robot = unit_robot();
        let line: Vec<Configuration> = (0..200)
            .map(|i| Configuration::ith(0, 1.2 * (f64::from(i) / 199.0).powi(2)))
            .collect();
        let tips = robot.tips(&equally_spaced(&robot, &line));
        let steps = tips.windows(2).map(|w| (w[1] - w[0]).norm());
        let (least, most) = steps.fold((f64::INFINITY, 0.0_f64), |(least, most), step| {
            (least.min(step), most.max(step))
        });
        assert!(most / least < 1.01, "{least} {most}");
    }

    #[test]
    fn a_single_configuration_stays() {
        let robot = unit_robot();
        let only = Configuration::repeat(0.3);
        assert_eq!(equally_spaced(&robot, &[only]), vec![only; WAYPOINTS]);
    }
}
