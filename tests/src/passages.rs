//! When a tip passes the places that it is to pass, one after the other, from its positions alone.

/// A position, m.
pub type Position = [f64; 3];

/// A place that was passed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage {
    /// Where along the positions: the index of one of them, and the share of the line to the next one.
    pub at: f64,
    /// Distance of the tip from the place there, m.
    pub miss_m: f64,
}

/// Where a tip that moves along the straight lines between positions passes places in their order: each where the tip is nearest to it
/// during the first stay within `tolerance_m` of it that is after the passage of the one before; none where there is no such stay.
#[must_use]
pub fn passages(
    positions: &[Position],
    places: &[Position],
    tolerance_m: f64,
) -> Vec<Option<Passage>> {
    let mut from = 0.0;
    let mut passed = |place: &Position| {
        let passage = first_passage(positions, place, tolerance_m, from)?;
        from = passage.at;
        Some(passage)
    };
    places.iter().map(&mut passed).collect()
}

/// The nearest place of the first stay within a tolerance from `from` on.
fn first_passage(
    positions: &[Position],
    place: &Position,
    tolerance_m: f64,
    from: f64,
) -> Option<Passage> {
    let first = from as usize;
    let lines = positions.windows(2).enumerate().skip(first);
    let mut best: Option<Passage> = None;
    for (index, line) in lines {
        let after = if index == first { from.fract() } else { 0.0 };
        let passage = nearest(line, place, after);
        let is_within = passage.miss_m <= tolerance_m;
        if !is_within && best.is_some() {
            break;
        }
        if is_within && best.is_none_or(|best| passage.miss_m < best.miss_m) {
            best = Some(Passage {
                at: index as f64 + passage.at,
                ..passage
            });
        }
    }
    best
}

/// The point of a line that is nearest to a place, no earlier than a share of it.
fn nearest(line: &[Position], place: &Position, after: f64) -> Passage {
    let along: Position = std::array::from_fn(|axis| line[1][axis] - line[0][axis]);
    let to_place: Position = std::array::from_fn(|axis| place[axis] - line[0][axis]);
    let length_squared = dot(&along, &along);
    let share = match length_squared > 0.0 {
        true => dot(&along, &to_place) / length_squared,
        false => 0.0,
    };
    let at = share.clamp(after, 1.0);
    let apart: Position = std::array::from_fn(|axis| to_place[axis] - at * along[axis]);
    Passage {
        at,
        miss_m: dot(&apart, &apart).sqrt(),
    }
}

fn dot(a: &Position, b: &Position) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WAY: [Position; 4] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
    ];

    #[test]
    fn places_are_passed_between_positions_and_in_their_order() {
        let places = [[0.5, 0.005, 0.0], [1.0, 0.25, 0.0], [0.0, 1.0, 0.0]];
        let passed = passages(&WAY, &places, 0.01);
        let at: Vec<f64> = passed.iter().map(|passage| passage.unwrap().at).collect();
        assert_eq!(at, [0.5, 1.25, 3.0]);
        assert!((passed[0].unwrap().miss_m - 0.005).abs() < 1e-12);
    }

    #[test]
    fn what_is_passed_only_before_or_not_at_all_is_not_passed() {
        let (first, later, aside) = ([0.5, 0.0, 0.0], [1.0, 0.5, 0.0], [0.5, 0.5, 0.0]);
        let passed = passages(&WAY, &[later, first, aside, later], 0.01);
        let is_passed: Vec<bool> = passed.iter().map(Option::is_some).collect();
        assert_eq!(is_passed, [true, false, false, true]);
    }

    #[test]
    fn a_place_that_comes_twice_is_passed_twice_only_where_the_tip_comes_back_or_stays() {
        let back = [[0.0; 3], [1.0, 0.0, 0.0], [0.0; 3]];
        let place = [0.3, 0.0, 0.0];
        let twice = passages(&back, &[place, [0.9, 0.0, 0.0], place], 0.01);
        let at: Vec<f64> = twice.iter().map(|passage| passage.unwrap().at).collect();
        assert!((at[2] - 1.7).abs() < 1e-9, "{at:?}");
    }
}
