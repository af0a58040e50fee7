//! Answers of the worker to questions about the current picture.

use std::path::PathBuf;
use std::sync::Arc;

use crate::film::Rect;
use crate::scene::description::Viewpoint;

/// A place in a picture: how far it is from the left and from the top, where the whole picture is 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// From the left.
    pub x: f64,
    /// From the top.
    pub y: f64,
}

/// A part of a picture, whose own width and height are 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Left edge.
    pub left: f64,
    /// Top edge.
    pub top: f64,
    /// Width.
    pub width: f64,
    /// Height.
    pub height: f64,
}

impl Section {
    /// The smallest one with two places in it.
    pub fn between(one: Spot, other: Spot) -> Self {
        let (left, top) = (one.x.min(other.x), one.y.min(other.y));
        Self { left, top, width: (one.x - other.x).abs(), height: (one.y - other.y).abs() }
    }

    /// These pixels of a picture of so many columns and rows.
    pub(super) fn of(rect: Rect, (columns, rows): (u32, u32)) -> Self {
        let share = |pixels: u32, side: u32| f64::from(pixels) / f64::from(side);
        Self {
            left: share(rect.x, columns),
            top: share(rect.y, rows),
            width: share(rect.width, columns),
            height: share(rect.height, rows),
        }
    }

    /// The pixels that it touches in a picture of so many columns and rows.
    pub(super) fn pixels(self, (columns, rows): (u32, u32)) -> Rect {
        let along = |start: f64, length: f64, side: u32| {
            let at = |share: f64| share.clamp(0.0, 1.0) * f64::from(side);
            let first = (at(start) as u32).min(side.saturating_sub(1));
            (first, (libm::ceil(at(start + length)) as u32).saturating_sub(first).max(1))
        };
        let (x, width) = along(self.left, self.width, columns);
        let (y, height) = along(self.top, self.height, rows);
        Rect { x, y, width, height }
    }

    /// The place in the picture of a place in the section.
    pub fn place(self, spot: Spot) -> Spot {
        Spot { x: self.left + spot.x * self.width, y: self.top + spot.y * self.height }
    }
}

/// The object and the colour at a place of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Picked {
    /// Column and row.
    pub pixel: [u32; 2],
    /// First object seen there. `None` if the ray meets nothing.
    pub thing: Option<Thing>,
    /// Linear colour of the pixel so far. `None` if it has no sample yet.
    pub color: Option<[f32; 3]>,
}

/// A shape, where a ray meets it.
#[derive(Clone, Debug, PartialEq)]
pub struct Thing {
    /// Name of the shape's table in the scene file.
    pub shape: &'static str,
    /// Its own name, if it has one.
    pub name: Option<String>,
    /// The scene file.
    pub path: PathBuf,
    /// The line in which it begins there, from 1.
    pub line: usize,
    /// Type and name of its material.
    pub material: String,
    /// The place on it.
    pub position: [f64; 3],
    /// Its unit normal there, on its front.
    pub normal: [f32; 3],
    /// Whether its front is seen.
    pub is_front: bool,
    /// From the eye.
    pub distance: f64,
    /// From the eye along the view axis.
    pub depth: f64,
}

/// A camera that keys moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovedCamera {
    /// The camera as it is now.
    pub camera: Viewpoint,
    /// The scene's own camera that it was moved from.
    pub own: Viewpoint,
}

/// A camera that is in its scene file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Kept {
    /// The scene file.
    pub path: PathBuf,
    /// Whether the file was written; else it had this camera already.
    pub is_new: bool,
    /// Whether the file gives this camera, with what the call sets.
    pub is_own: bool,
    /// Whether it is a new scene beside a model, which stays the file that is shown.
    pub of_model: bool,
    /// The edit, by which the key `u` takes it back. `None` if nothing was written, or a new file.
    pub edit: Option<CameraEdit>,
}

/// A camera that was written into a scene file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CameraEdit {
    /// The scene file.
    pub path: PathBuf,
    /// Its text before that.
    pub before: Arc<str>,
    /// Its text with the camera.
    pub after: Arc<str>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_has_the_pixels_that_it_touches() {
        let size = (40, 30);
        for rect in [
            Rect { x: 0, y: 0, width: 40, height: 30 },
            Rect { x: 7, y: 11, width: 13, height: 1 },
            Rect { x: 39, y: 29, width: 1, height: 1 },
        ] {
            // What is lost by rounding is no pixel more.
            let Section { left, top, width, height } = Section::of(rect, size);
            let inside =
                Section { left: left + 1e-9, top: top + 1e-9, width: width - 2e-9, height: height - 2e-9 };
            assert_eq!(inside.pixels(size), rect);
        }
        let one = Section::between(Spot { x: 0.99, y: 0.5 }, Spot { x: 0.99, y: 0.5 });
        assert_eq!(one.pixels(size), Rect { x: 39, y: 15, width: 1, height: 1 });
        let wide = Section::between(Spot { x: 1.5, y: -0.2 }, Spot { x: 0.5, y: 2.0 });
        assert_eq!(wide.pixels(size), Rect { x: 20, y: 0, width: 20, height: 30 });
    }
}
