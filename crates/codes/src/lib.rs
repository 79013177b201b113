//! What each `u32` code on the wire means: one enum a field, one meaning a code.

mod declaration;
mod motion;
mod plan;

pub use declaration::{CodeSet, CodeValue, UnknownCode};
pub use motion::*;
pub use plan::*;

/// Every code, as data.
pub const SETS: &[CodeSet] = &[
    Sampler::SET,
    Selection::SET,
    GoalKind::SET,
    StartKind::SET,
    Execute::SET,
    Source::SET,
    Outcome::SET,
    Stage::SET,
    PlanField::SET,
    PlanDependence::SET,
    LoopState::SET,
    LoopFault::SET,
    Waiting::SET,
    Refusal::SET,
    SceneRefusal::SET,
    MotorState::SET,
    MotorFault::SET,
    ProcessKind::SET,
    CommandKind::SET,
    CommandRefusal::SET,
    CommandSender::SET,
    MotionStart::SET,
    MotionOutcome::SET,
    StopCause::SET,
    GoalState::SET,
];

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;
    use std::fmt::Debug;
    use std::hash::Hash;

    fn assert_one_meaning_a_code<T>(all: &[T], code: fn(T) -> u32)
    where
        T: Copy + Debug + Eq + Hash + TryFrom<u32, Error = UnknownCode> + ToString,
    {
        let codes: HashSet<u32> = all.iter().map(|&value| code(value)).collect();
        let texts: HashSet<String> = all.iter().map(ToString::to_string).collect();
        assert_eq!(codes.len(), all.len(), "{all:?}");
        assert_eq!(texts.len(), all.len(), "{all:?}");
        let found: HashSet<T> = (0..1000)
            .filter_map(|number| T::try_from(number).ok())
            .collect();
        assert_eq!(
            found.len(),
            all.len(),
            "a code means nothing that is listed"
        );
        for &value in all {
            assert_eq!(T::try_from(code(value)), Ok(value));
        }
        let unknown = T::try_from(u32::MAX).unwrap_err();
        assert!(
            all.iter()
                .all(|value| unknown.to_string().contains(&value.to_string())),
            "{unknown}"
        );
    }

    #[test]
    fn every_code_has_exactly_one_meaning() {
        assert_one_meaning_a_code(Sampler::ALL, Sampler::code);
        assert_one_meaning_a_code(Selection::ALL, Selection::code);
        assert_one_meaning_a_code(GoalKind::ALL, GoalKind::code);
        assert_one_meaning_a_code(StartKind::ALL, StartKind::code);
        assert_one_meaning_a_code(Execute::ALL, Execute::code);
        assert_one_meaning_a_code(Source::ALL, Source::code);
        assert_one_meaning_a_code(Outcome::ALL, Outcome::code);
        assert_one_meaning_a_code(Stage::ALL, Stage::code);
        assert_one_meaning_a_code(PlanField::ALL, PlanField::code);
        assert_one_meaning_a_code(LoopState::ALL, LoopState::code);
        assert_one_meaning_a_code(LoopFault::ALL, LoopFault::code);
        assert_one_meaning_a_code(Waiting::ALL, Waiting::code);
        assert_one_meaning_a_code(Refusal::ALL, Refusal::code);
        assert_one_meaning_a_code(SceneRefusal::ALL, SceneRefusal::code);
        assert_one_meaning_a_code(MotorState::ALL, MotorState::code);
        assert_one_meaning_a_code(MotorFault::ALL, MotorFault::code);
        assert_one_meaning_a_code(ProcessKind::ALL, ProcessKind::code);
        assert_one_meaning_a_code(CommandKind::ALL, CommandKind::code);
        assert_one_meaning_a_code(CommandRefusal::ALL, CommandRefusal::code);
        assert_one_meaning_a_code(CommandSender::ALL, CommandSender::code);
        assert_one_meaning_a_code(MotionStart::ALL, MotionStart::code);
        assert_one_meaning_a_code(MotionOutcome::ALL, MotionOutcome::code);
        assert_one_meaning_a_code(StopCause::ALL, StopCause::code);
        assert_one_meaning_a_code(GoalState::ALL, GoalState::code);
    }

    #[test]
    fn every_code_is_among_the_sets() {
        let sources = [include_str!("plan.rs"), include_str!("motion.rs")];
        let declared = sources.iter().flat_map(|source| source.lines());
        let declared = declared.filter_map(|line| line.trim().strip_prefix("pub enum "));
        let declared: HashSet<&str> = declared.map(|line| line.trim_end_matches(" {")).collect();
        let described: HashSet<&str> = SETS.iter().map(|set| set.name).collect();
        assert_eq!(declared, described);
    }

    #[test]
    fn an_unknown_code_says_what_is_allowed() {
        let error = GoalKind::try_from(7).unwrap_err();
        assert_eq!(
            error.to_string(),
            "7 is no goal kind; allowed are 0 (tip), 1 (configuration)"
        );
    }
}
