//! A hash of cases, by which records say what they are of.

use crate::hash_text::hexadecimal;
use datasets::Case;
use pcc_model::BitHash;

/// A text that is equal for equal cases in the same order.
pub(crate) fn hash_of(cases: &[Case]) -> String {
    let mut hash = BitHash::new();
    for case in cases {
        let balls = case.scene.balls();
        let ball = balls
            .iter()
            .flat_map(|it| it.centre.iter().chain([&it.radius]));
        let numbers = case.start.iter().chain(case.target_tip.iter()).chain(ball);
        hash.add(balls.len() as u64);
        numbers.for_each(|number| hash.add(number.to_bits()));
    }
    hexadecimal(hash.value())
}
