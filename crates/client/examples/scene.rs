//! Publishes a ball that moves, for some seconds, then takes its leave: `scene X Y Z RADIUS VX VY VZ SECONDS`, metres and m/s.

use std::env::args;
use std::error::Error;
use std::iter::repeat_with;
use std::time::{Duration, Instant};

use client::ScenePublisher;
use shared_types::ipc::IpcOptions;
use shared_types::message::MovingBall;

fn main() -> Result<(), Box<dyn Error>> {
    let number = |text: String| text.parse::<f64>().map_err(|e| format!("{text:?}: {e}"));
    let told = args().skip(1).map(number).collect::<Result<Vec<_>, _>>()?;
    let [_, _, _, radius_m, vx, vy, vz, seconds] = told[..] else {
        eprintln!("usage: scene X Y Z RADIUS VX VY VZ SECONDS, metres and m/s");
        std::process::exit(2);
    };
    let mut live = ScenePublisher::connect(&IpcOptions::from_env(), "rust-example")?;
    let (begin, mut ball) = (Instant::now(), MovingBall::ZEROED);
    (ball.radius_m, ball.velocity_m_s) = (radius_m, [vx, vy, vz]);
    for elapsed_s in repeat_with(|| begin.elapsed().as_secs_f64()).take_while(|it| *it < seconds) {
        ball.centre_m = [0, 1, 2].map(|i| told[i] + elapsed_s * told[4 + i]);
        live.publish(&[ball], Duration::from_millis(200))?;
        std::thread::sleep(Duration::from_millis(30));
    }
    let counted = live.take_leave().and(live.confirm(Duration::from_secs(2)));
    Ok(counted.map(|()| println!("every scene counted"))?)
}
