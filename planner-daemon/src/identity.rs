//! Which robot this daemon plans for, and by which weights: what it answers and publishes bears both.

use pcc_model::Robot;
use shared_types::PROTOCOL_VERSION;
use shared_types::capacity::DOF;
use shared_types::message::RobotDescription;

/// The daemon's instance number, and the hashes of robot file and weights file, as in [`RobotDescription`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Identity {
    pub(crate) instance: u64,
    pub(crate) robot_hash: u64,
    pub(crate) weights_hash: u64,
}

impl Identity {
    /// The description of the robot, without a stamp; lengths in metres.
    pub(crate) fn description(self, robot: &Robot) -> RobotDescription {
        let Self {
            instance,
            robot_hash,
            weights_hash,
        } = self;
        let mut description = RobotDescription {
            instance,
            protocol_version: PROTOCOL_VERSION,
            tendon_count: robot.tendons.count() as u32,
            robot_hash,
            weights_hash,
            section_lengths_m: robot.section_lengths,
            tube_radii_m: robot.tube_radii,
            bending_limit_rad: robot.bending_limit,
            spool_radius_m: robot.spool_radius,
            velocity_limit_m_s: robot.tendon_limits.velocity,
            acceleration_limit_m_s2: robot.tendon_limits.acceleration,
            jerk_limit_m_s3: robot.tendon_limits.jerk,
            ..RobotDescription::ZEROED
        };
        description.set_name(&robot.name);
        let rows = description.tendon_matrix_m_rad.chunks_exact_mut(DOF);
        for (to, row) in rows.zip(robot.tendons.matrix().row_iter()) {
            to.iter_mut().zip(&row).for_each(|(to, from)| *to = *from);
        }
        description
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn the_description_is_the_robot_files() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/robots/unit.toml");
        let robot = Robot::from_file(&file).unwrap();
        let identity = Identity {
            instance: 5,
            robot_hash: robot.hash(),
            weights_hash: 7,
        };
        let described = identity.description(&robot);
        assert_eq!(described.robot_hash, robot.hash());
        assert_eq!((described.instance, described.weights_hash), (5, 7));
        assert_eq!(described.tendon_count as usize, robot.tendons.count());
        let name = String::from_utf8_lossy(&described.name);
        assert_eq!(name.trim_end_matches('\0'), robot.name);
        let configuration = pcc_model::Configuration::from([0.1, -0.2, 0.3, 0.4, -0.5, 0.6]);
        let mut lengths = [0.0; 9];
        robot.tendons.lengths(&configuration, &mut lengths);
        let rows = described.tendon_matrix_m_rad.chunks_exact(DOF);
        for (row, length) in rows.zip(lengths) {
            let products = row.iter().zip(configuration.iter());
            let told: f64 = products.map(|(a, b)| a * b).sum();
            assert!((told - length).abs() < 1e-12, "{told} for {length}");
        }
    }
}
