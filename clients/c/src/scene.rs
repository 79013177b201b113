//! Publishing the obstacles that a source knows.

use std::ffi::c_char;

use client::ScenePublisher;
use shared_types::message::MovingBall;

use crate::error::or_fail;
use crate::pointer::{array, duration, free, give, options, text, time_limit, write};

/// Publishes what one source knows of the obstacles.
pub struct Scene(ScenePublisher);

/// Joins the services as a source of this name, 1 to 32 characters of printable ASCII. Null where it fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_scene_connect(
    prefix: *const c_char,
    root: *const c_char,
    source: *const c_char,
) -> *mut Scene {
    let connect = || {
        let scene = ScenePublisher::connect(&options(prefix, root)?, text(source, "source")?)?;
        Ok(give(Scene(scene)))
    };
    or_fail(connect(), std::ptr::null_mut())
}

/// Ends it, which is no leave: once the lifetime of its last scene is over the daemon executes nothing more. Nothing where the pointer is
/// null.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_scene_free(scene: *mut Scene) {
    free(scene);
}

/// Publishes all obstacles that this source knows of now, at most 1024; they count for `lifetime_s` seconds. 0, or -1 where it fails, also
/// where the daemon has refused an earlier one and that was not told yet.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_scene_publish(
    scene: *mut Scene,
    balls: *const MovingBall,
    count: usize,
    lifetime_s: f64,
) -> i32 {
    let publish = || {
        let Scene(scene) = write(scene, "scene")?;
        scene.publish(
            array(balls, count, "balls")?,
            duration("lifetime_s", lifetime_s)?,
        )?;
        Ok(0)
    };
    or_fail(publish(), -1)
}

/// Waits until the daemon has judged the last scene, `timeout_s` seconds at most: 0, or -1 where it has refused it or there is no verdict.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_scene_confirm(scene: *mut Scene, timeout_s: f64) -> i32 {
    let confirm = || {
        let Scene(scene) = write(scene, "scene")?;
        scene.confirm(time_limit(timeout_s)?)?;
        Ok(0)
    };
    or_fail(confirm(), -1)
}

/// Signs the source off: its obstacles are gone, and no scene of it is expected any more. 0, or -1 where it fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_scene_leave(scene: *mut Scene) -> i32 {
    let leave = || {
        let Scene(scene) = write(scene, "scene")?;
        scene.take_leave()?;
        Ok(0)
    };
    or_fail(leave(), -1)
}
