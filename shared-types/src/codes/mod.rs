//! What each `u32` code on the wire means: one enum a field, one meaning a code.

mod declaration;
mod motion;
mod plan;

pub use declaration::UnknownCode;
pub use motion::*;
pub use plan::*;

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;
    use std::fmt::Debug;
    use std::hash::Hash;

    fn assert_one_meaning_a_code<T>(all: &[T])
    where
        T: Copy + Debug + Eq + Hash + Into<u32> + TryFrom<u32, Error = UnknownCode> + ToString,
    {
        let codes: HashSet<u32> = all.iter().map(|&value| value.into()).collect();
        let texts: HashSet<String> = all.iter().map(ToString::to_string).collect();
        assert_eq!(codes.len(), all.len(), "{all:?}");
        assert_eq!(texts.len(), all.len(), "{all:?}");
        let found: HashSet<T> = (0..1000)
            .filter_map(|code| T::try_from(code).ok())
            .collect();
        assert_eq!(
            found.len(),
            all.len(),
            "a code means nothing that is listed"
        );
        for &value in all {
            assert_eq!(T::try_from(value.into()), Ok(value));
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
        assert_one_meaning_a_code(Sampler::ALL);
        assert_one_meaning_a_code(Selection::ALL);
        assert_one_meaning_a_code(GoalKind::ALL);
        assert_one_meaning_a_code(Source::ALL);
        assert_one_meaning_a_code(Outcome::ALL);
        assert_one_meaning_a_code(Stage::ALL);
        assert_one_meaning_a_code(PlanField::ALL);
        assert_one_meaning_a_code(LoopState::ALL);
        assert_one_meaning_a_code(LoopFault::ALL);
        assert_one_meaning_a_code(Waiting::ALL);
        assert_one_meaning_a_code(Refusal::ALL);
        assert_one_meaning_a_code(SceneRefusal::ALL);
        assert_one_meaning_a_code(MotorState::ALL);
        assert_one_meaning_a_code(MotorFault::ALL);
        assert_one_meaning_a_code(ProcessKind::ALL);
        assert_one_meaning_a_code(CommandKind::ALL);
        assert_one_meaning_a_code(CommandRefusal::ALL);
    }

    #[test]
    fn the_stages_fill_their_array() {
        assert_eq!(Stage::ALL.len(), crate::capacity::STAGES);
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
