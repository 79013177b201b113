//! Measures motions that begin in motion against stopping first: `cargo run --release --example joining_figures`.
//!
//! Random instants of random motions of the unit robot, random paths from where it could rest: time won ÷ the shortest stop, by turn.

use pcc_model::Configuration;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::time::Instant;
use trajectory::*;

#[path = "../src/test_paths.rs"]
mod test_paths;
use test_paths::{smooth_path, unit_limits, unit_tendons};

fn main() {
    let (tendons, limits) = (unit_tendons(), unit_limits());
    let options = ParameterizationOptions::default();
    let mut random = Pcg64::seed_from_u64(3);
    let mut parameterizer = TimeParameterizer::default();
    let turns: [&[f64]; 6] = [
        &[1.0],
        &[0.6],
        &[0.9, 0.5],
        &[0.8, 0.6, 0.4],
        &[1.0, 0.7, 0.4],
        &[1.0, 0.8, 0.6, 0.5, 0.4, 0.3],
    ];
    let mut won: Vec<Vec<f64>> = vec![vec![]; turns.len()];
    let (mut best, mut failed) = (vec![], 0);
    let mut shortest = vec![];
    let mut time_of_calls = vec![vec![]; 6];
    let mut by_count = [0; 64];
    for case in 0..1000 {
        let waves = case % 2 == 0;
        let before = parameterizer
            .parameterize(&smooth_path(&mut random, 64), &tendons, &limits, &options)
            .unwrap();
        let at = before.at(before.duration() * random.random_range(0.0..1.0));
        let state = Knot {
            time: 0.0,
            position: at.position,
            velocity: at.velocity,
            acceleration: at.acceleration,
        };
        let stop = stopping_motion(&state, &tendons, &limits).unwrap();
        let rest = stop.knots()[stop.knots().len() - 1].position;
        let smooth = smooth_path(&mut random, 64);
        let path: Vec<Configuration> = if waves {
            let off = rest - smooth[0];
            (0..64)
                .map(|i| smooth[i] + off * (1.0 - i as f64 / 63.0))
                .collect()
        } else {
            (0..64)
                .map(|i| rest.lerp(&smooth[63], i as f64 / 63.0))
                .collect()
        };
        let after = parameterizer
            .parameterize(&path, &tendons, &limits, &options)
            .unwrap();
        let stop_then_go = stop.duration() + after.duration();
        shortest.push(stop.duration());
        let mut gain: f64 = 0.0;
        for (i, share) in turns.iter().enumerate() {
            let start = MovingStart {
                state,
                path: &path,
                braking_shares: share,
            };
            let clock = Instant::now();
            let joined = parameterizer.parameterize_from(&start, &tendons, &limits, &options);
            time_of_calls[i].push(clock.elapsed().as_secs_f64() * 1e6);
            match joined {
                Ok(joined) => {
                    assert_eq!(joined.knots()[0], state);
                    let g = (stop_then_go - joined.duration()) / stop.duration();
                    gain = gain.max(g);
                    by_count[i] += 1;
                    won[i].push(g);
                }
                Err(_) => won[i].push(0.0),
            }
        }
        if gain == 0.0 {
            failed += 1;
        }
        best.push(gain);
    }
    let print = |name: &str, values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        let at = |p: f64| values[((values.len() - 1) as f64 * p) as usize];
        println!(
            "{name}: p10 {:.3} p25 {:.3} median {:.3} p75 {:.3} p90 {:.3}",
            at(0.1),
            at(0.25),
            at(0.5),
            at(0.75),
            at(0.9)
        );
    };
    for (i, values) in won.iter_mut().enumerate() {
        print(&format!("{:?} feasible {}", turns[i], by_count[i]), values);
    }
    print("best", &mut best);
    print("shortest stop, s", &mut shortest);
    for calls in &mut time_of_calls {
        print("call, us", calls);
    }
    println!("nothing won {failed}");
}
