//! Publishes a ball that moves, for some seconds, then takes its leave: `scene X Y Z RADIUS VX VY VZ SECONDS`, metres and m/s.

use std::error::Error;
use std::time::{Duration, Instant};

use client::ScenePublisher;
use shared_types::ipc::IpcOptions;
use shared_types::message::MovingBall;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = std::env::args().skip(1).map(|it| it.parse());
    let told: Vec<f64> = arguments.collect::<Result<_, _>>()?;
    let mut scene = ScenePublisher::connect(&IpcOptions::from_env(), "rust-example")?;
    let (begin, mut ball) = (Instant::now(), MovingBall::ZEROED);
    (ball.radius_m, ball.velocity_m_s) = (told[3], [told[4], told[5], told[6]]);
    while begin.elapsed().as_secs_f64() < told[7] {
        let elapsed_s = begin.elapsed().as_secs_f64();
        ball.centre_m = [0, 1, 2].map(|axis| told[axis] + elapsed_s * told[4 + axis]);
        scene.publish(&[ball], Duration::from_millis(200))?;
        std::thread::sleep(Duration::from_millis(30));
    }
    scene.take_leave()?;
    scene.confirm(Duration::from_secs(2))?;
    println!("every scene counted");
    Ok(())
}
