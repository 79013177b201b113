//! The result of certifying a motion.

/// The most bisections of one piece; where contact is not excluded then, the verdict is undecided.
pub(crate) const DEPTH: u32 = 10;

/// The result of certifying a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// No contact is possible.
    Free,
    /// There is contact.
    Colliding {
        /// Where there is contact, not necessarily first: the time of a trajectory (s), the index and fraction of a polyline's edge, the
        /// fraction of an edge.
        at: f64,
    },
    /// Too close to decide.
    Undecided {
        /// Where contact is not excluded: the time of a trajectory (s), the index and fraction of a polyline's edge, the fraction of an
        /// edge.
        at: f64,
    },
}

impl Verdict {
    /// Whether the motion is certified.
    #[must_use]
    pub fn is_free(self) -> bool {
        self == Self::Free
    }
}
