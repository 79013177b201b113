//! What the page's pictures are drawn with.

mod bars;
mod canvas;
mod lines;
mod scene;

pub(super) use self::bars::{Bar, Bars};
pub(super) use self::canvas::{Area, COLOURS, Drawn, GREY, INK, blend, font, svg};
pub(super) use self::lines::{Axis, Line, Lines};
pub(super) use self::scene::{Camera, Scene3d};
