//! Certified edges between configurations, and the budget of a search over them.

use crate::request::Interrupt;
use collision::{Scene, certify_edge};
use pcc_model::{Configuration, UnitRobot};

/// Bisection depth of an edge's certificate; undecided edges count as colliding.
const EDGE_DEPTH: u32 = 7;

/// Budgets of one search, all of them counts.
#[derive(Clone, Copy, Debug)]
pub struct RrtSettings {
    /// Random samples at most.
    pub samples: usize,
    /// Attempts to shorten the path found.
    pub shortcuts: usize,
}

impl Default for RrtSettings {
    fn default() -> Self {
        Self {
            samples: 3000,
            shortcuts: 120,
        }
    }
}

/// The robot and the scene for which edges are certified, and the budget.
pub(crate) struct Search<'a> {
    pub(crate) robot: &'a UnitRobot,
    pub(crate) scene: &'a Scene,
    pub(crate) settings: &'a RrtSettings,
    pub(crate) interrupt: Interrupt<'a>,
}

impl Search<'_> {
    /// Whether the edge between two configurations is certified free for the whole body and the whole motion.
    pub(crate) fn edge_is_free(&self, a: &Configuration, b: &Configuration) -> bool {
        certify_edge(self.robot, self.scene, a, b, EDGE_DEPTH).is_free()
    }
}
