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

/// Where a tip that moves along the straight lines between positions passes places in their order: within `tolerance_m`, each after the one
/// before; none where it is not within it any more. Of all times between the passages of its neighbours the nearest one is told.
#[must_use]
pub fn passages(
    positions: &[Position],
    places: &[Position],
    tolerance_m: f64,
) -> Vec<Option<Passage>> {
    let mut from = 0.0;
    let mut passed: Vec<Option<Passage>> = Vec::new();
    for place in places {
        let passage = first_passage(positions, place, tolerance_m, from);
        from = passage.map_or(from, |passage| passage.at);
        passed.push(passage);
    }
    let (mut from, end) = (0.0, positions.len() as f64);
    for (index, place) in places.iter().enumerate() {
        let next = passed[index + 1..].iter().flatten().next();
        let until = next.map_or(end, |next| next.at);
        if let Some(passage) = &mut passed[index] {
            *passage = nearest_between(positions, place, from, until).unwrap_or(*passage);
            from = passage.at;
        }
    }
    passed
}

/// The nearest passage of a place from one instant to another, as far as whole lines lie before that.
fn nearest_between(
    positions: &[Position],
    place: &Position,
    from: f64,
    until: f64,
) -> Option<Passage> {
    let first = from as usize;
    let lines = positions.windows(2).enumerate().skip(first);
    let lines = lines.take_while(|(index, _)| (*index + 1) as f64 <= until.max(from.ceil()));
    let passages = lines.map(|(index, line)| {
        let after = if index == first { from.fract() } else { 0.0 };
        let passage = nearest(line, place, after);
        Passage {
            at: index as f64 + passage.at,
            ..passage
        }
    });
    passages.min_by(|a, b| a.miss_m.total_cmp(&b.miss_m))
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
    fn of_two_approaches_the_nearer_one_counts_if_the_next_place_comes_after_it() {
        let way = [
            [0.0; 3],
            [1.0, 0.0, 0.0],
            [1.0, 0.005, 0.0],
            [0.0, 0.005, 0.0],
        ];
        let place = [0.5, 0.005, 0.0];
        let alone = passages(&way, &[place], 0.01)[0].unwrap();
        assert!(
            (alone.at - 2.5).abs() < 1e-9 && alone.miss_m < 1e-12,
            "{alone:?}"
        );
        let followed = passages(&way, &[place, [0.9, 0.0, 0.0], [1.0, 0.005, 0.0]], 0.002);
        let at: Vec<bool> = followed.iter().map(Option::is_some).collect();
        assert_eq!(at, [true, false, false]);
        let first = passages(&way, &[place, [1.0, 0.0, 0.0]], 0.01)[0].unwrap();
        assert!((first.miss_m - 0.005).abs() < 1e-9, "{first:?}");
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
