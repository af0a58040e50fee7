//! The worker's answers to queries about the current image.

use std::path::PathBuf;
use std::sync::Arc;

use crate::film::Rect;
use crate::scene::description::ResolvedCamera;

/// Position in an image, as fractions of its width and height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalizedPosition {
    /// Distance from the left edge.
    pub x: f64,
    /// Distance from the top edge.
    pub y: f64,
}

/// Rectangle in an image, as fractions of its width and height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalizedRect {
    /// Left edge.
    pub left: f64,
    /// Top edge.
    pub top: f64,
    /// Width of the rectangle.
    pub width: f64,
    /// Height of the rectangle.
    pub height: f64,
}

impl NormalizedRect {
    /// Returns the smallest rectangle that contains both positions.
    pub fn between(a: NormalizedPosition, b: NormalizedPosition) -> Self {
        let (left, top) = (a.x.min(b.x), a.y.min(b.y));
        Self { left, top, width: (a.x - b.x).abs(), height: (a.y - b.y).abs() }
    }

    /// Normalizes a pixel rectangle of an image with `columns` × `rows` pixels.
    pub(super) fn from_pixels(rect: Rect, columns: u32, rows: u32) -> Self {
        let share = |pixels: u32, side: u32| f64::from(pixels) / f64::from(side);
        Self {
            left: share(rect.x, columns),
            top: share(rect.y, rows),
            width: share(rect.width, columns),
            height: share(rect.height, rows),
        }
    }

    /// Returns the pixels that overlap the rectangle in an image with `columns` × `rows` pixels.
    pub(super) fn to_pixel_rect(self, columns: u32, rows: u32) -> Rect {
        let along = |start: f64, length: f64, side: u32| {
            let at = |share: f64| share.clamp(0.0, 1.0) * f64::from(side);
            let first = (at(start) as u32).min(side.saturating_sub(1));
            (first, (libm::ceil(at(start + length)) as u32).saturating_sub(first).max(1))
        };
        let (x, width) = along(self.left, self.width, columns);
        let (y, height) = along(self.top, self.height, rows);
        Rect { x, y, width, height }
    }

    /// Maps a position relative to this rectangle to a position in the image.
    pub fn position_in_image(self, position: NormalizedPosition) -> NormalizedPosition {
        NormalizedPosition { x: self.left + position.x * self.width, y: self.top + position.y * self.height }
    }
}

/// Object and color at an image position.
#[derive(Clone, Debug, PartialEq)]
pub struct PickedPixel {
    /// Column and row of the pixel.
    pub pixel: [u32; 2],
    /// The visible object, or `None` if the ray hits nothing.
    pub object: Option<PickedObject>,
    /// Current linear pixel color, or `None` before the first sample.
    pub color: Option<[f32; 3]>,
}

/// Shape hit by a camera ray.
#[derive(Clone, Debug, PartialEq)]
pub struct PickedObject {
    /// Name of the shape's table in the scene file.
    pub shape: &'static str,
    /// Name of the shape, if it has one.
    pub name: Option<String>,
    /// The scene file.
    pub path: PathBuf,
    /// 1-based line number where the shape starts. `None` if the scene is not text.
    pub line: Option<usize>,
    /// The instance that contains the shape, if the shape is in a group.
    pub instance: Option<PickedInstance>,
    /// Type and name of the material.
    pub material: String,
    /// Hit point.
    pub position: [f64; 3],
    /// Unit normal at the hit point, pointing to the front side.
    pub normal: [f32; 3],
    /// Whether the front side faces the camera.
    pub is_front: bool,
    /// Distance from the camera.
    pub distance: f64,
    /// Distance from the camera along the view axis.
    pub depth: f64,
}

/// The instance that contains a picked shape.
#[derive(Clone, Debug, PartialEq)]
pub struct PickedInstance {
    /// Name of the instance, if it has one.
    pub name: Option<String>,
    /// 1-based line number where the instance starts. `None` if the scene is not text.
    pub line: Option<usize>,
}

/// A camera that the user moved with the keyboard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UserMovedCamera {
    /// The camera after the move.
    pub camera: ResolvedCamera,
    /// The scene's camera before the move.
    pub own: ResolvedCamera,
}

/// Result of saving the camera to the scene file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CameraSaveResult {
    /// The scene file.
    pub path: PathBuf,
    /// Whether the file was written. `false` if it already contained this camera.
    pub is_new: bool,
    /// Whether loading the file with the command-line overrides would yield exactly this camera.
    pub is_own: bool,
    /// Whether a new scene file was created next to the model. The model remains open.
    pub of_model: bool,
    /// The edit that the `u` key undoes, or `None` if nothing was written or the file is new.
    pub edit: Option<SavedCameraEdit>,
}

/// An edit that saved a camera to a scene file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SavedCameraEdit {
    /// The scene file.
    pub path: PathBuf,
    /// Text before the edit.
    pub before: Arc<str>,
    /// Text after the edit.
    pub after: Arc<str>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn section_covers_all_overlapping_pixels() {
        let (columns, rows) = (40, 30);
        for rect in [
            Rect { x: 0, y: 0, width: 40, height: 30 },
            Rect { x: 7, y: 11, width: 13, height: 1 },
            Rect { x: 39, y: 29, width: 1, height: 1 },
        ] {
            // Rounding errors must not add pixels.
            let NormalizedRect { left, top, width, height } =
                NormalizedRect::from_pixels(rect, columns, rows);
            let inside = NormalizedRect {
                left: left + 1e-9,
                top: top + 1e-9,
                width: width - 2e-9,
                height: height - 2e-9,
            };
            assert_eq!(inside.to_pixel_rect(columns, rows), rect);
        }
        let one = NormalizedRect::between(
            NormalizedPosition { x: 0.99, y: 0.5 },
            NormalizedPosition { x: 0.99, y: 0.5 },
        );
        assert_eq!(one.to_pixel_rect(columns, rows), Rect { x: 39, y: 15, width: 1, height: 1 });
        let wide = NormalizedRect::between(
            NormalizedPosition { x: 1.5, y: -0.2 },
            NormalizedPosition { x: 0.5, y: 2.0 },
        );
        assert_eq!(wide.to_pixel_rect(columns, rows), Rect { x: 20, y: 0, width: 20, height: 30 });
    }
}
