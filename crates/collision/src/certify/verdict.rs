//! What a certificate says of a motion.

/// Bisections of one piece; where there may still be contact then, nobody can tell.
pub(crate) const DEPTH: u32 = 10;

/// What is known of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// No contact is possible.
    Free,
    /// There is contact.
    Colliding {
        /// Where, not necessarily first: the time of a trajectory (s), the index and fraction of a polyline's edge, the fraction
        /// of an edge.
        at: f64,
    },
    /// Too close to decide.
    Undecided {
        /// Where, as above.
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
