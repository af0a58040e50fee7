//! Sums of samples, tone mapping, pictures.

pub mod tone;

use crate::math::Vec3;

/// A rectangle of pixels; (0, 0) is the top left one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Rect {
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// Columns, ≥ 1.
    pub width: u32,
    /// Rows, ≥ 1.
    pub height: u32,
}

impl Rect {
    /// Pixels in it.
    pub fn area(&self) -> usize {
        self.width as usize * self.height as usize
    }
}

/// What an integrator made of a tile: `samples` radiances for each pixel of `rect`, pixel after pixel in rows.
#[derive(Clone, Debug)]
pub struct TileSamples {
    /// The pixels.
    pub rect: Rect,
    /// Samples for each.
    pub samples: u32,
    /// `rect.area() · samples` radiances, already weighted by the reconstruction filter.
    pub radiance: Vec<Vec3>,
}

/// Linear radiance, rows from the top, unexposed.
#[derive(Clone, Debug, PartialEq)]
pub struct RadianceImage {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width·height` pixels.
    pub pixels: Vec<Vec3>,
}

/// An sRGB picture for eyes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width·height` pixels.
    pub pixels: Vec<[u8; 3]>,
}
