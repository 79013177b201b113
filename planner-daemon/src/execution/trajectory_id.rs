//! Ids of trajectories, unique from one boot of the machine to the next.

/// Clock time that one trajectory id stands for, nanoseconds: after 497 days of uptime they begin again.
const ID_STEP_NS: i64 = 10_000_000;

/// An id after the last one of this daemon (0: none) and after those of every daemon before on this machine since it was booted, as
/// long as none publishes more than a hundred trajectories a second. After the largest one ids begin again at 1; none of those that
/// the controller speaks of is used.
pub(crate) fn next_id(last_id: u32, spoken_of: [u32; 2], now_mono_ns: i64) -> u32 {
    let after = |id: u32| id.checked_add(1).unwrap_or(1);
    let steps = (now_mono_ns / ID_STEP_NS).rem_euclid(i64::from(u32::MAX));
    let by_clock = u32::try_from(steps + 1).unwrap_or(1);
    // By less than half the circle.
    let clock_is_ahead = (1..=u32::MAX / 2).contains(&by_clock.wrapping_sub(last_id));
    let mut id = if last_id == 0 || clock_is_ahead {
        by_clock
    } else {
        after(last_id)
    };
    while spoken_of.contains(&id) {
        id = after(id);
    }
    id
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: i64 = 5_000_000_000;

    #[test]
    fn ids_grow_within_a_daemon_and_across_restarts() {
        let none = [0, 0];
        let first = next_id(0, none, NOW);
        assert_eq!(first, 501);
        assert_eq!(next_id(first, none, NOW), 502);
        assert!(next_id(0, none, NOW + 2 * ID_STEP_NS) > 502);
    }

    #[test]
    fn ids_begin_again_after_the_largest_and_never_meet_zero_or_one_in_use() {
        let none = [0, 0];
        let circle_ns = i64::from(u32::MAX) * ID_STEP_NS;
        let last_ns = circle_ns - 1;
        assert_eq!(next_id(0, none, last_ns), u32::MAX);
        assert_eq!(next_id(u32::MAX, none, last_ns), 1);
        assert_eq!(next_id(1, none, last_ns), 2, "the clock is behind the ids");
        assert_eq!(next_id(u32::MAX, none, circle_ns), 1);
        assert_eq!(next_id(2, none, circle_ns), 3);
        assert_eq!(next_id(u32::MAX - 1, [u32::MAX, 1], last_ns), 2);
        let mut id = next_id(0, none, last_ns - 3 * ID_STEP_NS);
        for step in 0..100 {
            let next = next_id(id, [id, 0], last_ns + (step - 3) * ID_STEP_NS / 2);
            assert!(next != 0 && next != id);
            id = next;
        }
        for now_ns in [i64::MAX, 40 * circle_ns] {
            assert_ne!(next_id(0, none, now_ns), 0);
        }
    }
}
