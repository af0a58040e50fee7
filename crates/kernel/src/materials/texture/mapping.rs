//! Maps the texture coordinates of surfaces to the coordinates of a texture.

use crate::materials::footprint::{SecondUvPoint, TexturePoint, UvSet};
use crate::math::lanes::PACKET_SIZE;
use crate::math::transform::sin_cos_degrees;
use crate::math::{DVec2, Vec2, Vec3};

/// Repetition, rotation and translation of a texture. One repetition of the texture is [0, 1]².
#[derive(Clone, Debug, PartialEq)]
pub struct TextureMapping {
    /// Number of repetitions along u and v.
    pub repeat: Vec2,
    /// Transform that is applied after repetition, or `None` if it is the identity on the first UV set.
    pub moved: Option<Box<UvTransform>>,
}

impl TextureMapping {
    /// Leaves coordinates of the first UV set as they are.
    pub const IDENTITY: Self = Self { repeat: Vec2::ONE, moved: None };

    /// Repeated and transformed coordinates.
    #[inline]
    pub fn map_point(&self, at: &TexturePoint) -> DVec2 {
        let repeat = self.repeat.as_dvec2();
        let Some(moved) = &self.moved else { return at.uv * repeat };
        moved.transform_point(moved.second_uv_point_if_used(at).map_or(at.uv, |second| second.uv) * repeat)
    }

    /// Packet version of [`TextureMapping::map_point`].
    pub fn map_packet(&self, uv: &[[f64; PACKET_SIZE]; 2]) -> [[f64; PACKET_SIZE]; 2] {
        let mut row = *uv;
        for i in 0..PACKET_SIZE {
            let repeated = DVec2::new(uv[0][i], uv[1][i]) * self.repeat.as_dvec2();
            let moved = self.moved.as_ref().map_or(repeated, |moved| moved.transform_point(repeated));
            (row[0][i], row[1][i]) = (moved.x, moved.y);
        }
        row
    }

    /// The UV set used for lookups.
    #[inline]
    pub fn uv_set(&self) -> UvSet {
        self.moved.as_ref().map_or(UvSet::First, |moved| moved.of)
    }

    /// Tangents ∂p/∂u and ∂p/∂v of the UV set used for lookups. `first` contains the tangents of the first
    /// set.
    #[inline]
    pub fn untransformed_tangents(&self, at: &TexturePoint, first: [Vec3; 2]) -> [Vec3; 2] {
        let second = self.moved.as_ref().and_then(|moved| moved.second_uv_point_if_used(at));
        second.map_or(first, |second| second.tangents)
    }

    /// Tangents along the repeated and transformed coordinates. Only the directions matter.
    pub fn transformed_tangents(&self, [dpdu, dpdv]: [Vec3; 2]) -> [Vec3; 2] {
        let sides = self.repeat.signum();
        let Some(moved) = &self.moved else { return [dpdu * sides.x, dpdv * sides.y] };
        [DVec2::X, DVec2::Y].map(|axis| {
            let by = moved.inverse_transform_vector(axis).as_vec2() / self.repeat;
            dpdu * by.x + dpdv * by.y
        })
    }

    /// Converts slopes along the texture's own coordinates to slopes along u and v.
    pub fn texture_slopes_to_uv(&self, slopes: DVec2) -> Vec2 {
        let slopes = self.moved.as_ref().map_or(slopes, |moved| moved.inverse_transform_vector(slopes));
        slopes.as_vec2() * self.repeat
    }

    /// Number of cells per unit of u and v if one repetition of the texture has `cells` cells.
    pub fn cells_per_uv_unit(&self, cells: DVec2) -> [f64; 2] {
        let repeat = self.repeat.as_dvec2();
        let Some(moved) = &self.moved else { return (cells * repeat).abs().to_array() };
        let along = |axis: DVec2| (moved.transform_vector(axis * repeat) * cells).length();
        [along(DVec2::X), along(DVec2::Y)]
    }

    /// Length of the footprint's longer axis, in cells.
    #[inline]
    pub fn major_axis_length(&self, at: &TexturePoint, cells: Vec2) -> f32 {
        let Some(moved) = &self.moved else {
            return at.footprint.major_axis_texels(cells * self.repeat);
        };
        let footprint = moved.second_uv_point_if_used(at).map_or(&at.footprint, |second| &second.footprint);
        footprint.transformed_major_axis_length(|axis| {
            moved.transform_vector((axis * self.repeat).as_dvec2()).as_vec2() * cells
        })
    }

    /// Extents of the footprint's bounding box, in repetitions.
    #[inline]
    pub fn footprint_extents(&self, at: &TexturePoint) -> DVec2 {
        let second = self.moved.as_ref().and_then(|moved| moved.second_uv_point_if_used(at));
        let axes = second.map_or(&at.footprint, |second| &second.footprint).axes();
        let [a, b] = axes.map(|axis| {
            let axis = (axis * self.repeat).as_dvec2();
            self.moved.as_ref().map_or(axis, |moved| moved.transform_vector(axis))
        });
        DVec2::new((a.x * a.x + b.x * b.x).sqrt(), (a.y * a.y + b.y * b.y).sqrt())
    }
}

/// A UV set, and a transform that rotates and then translates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UvTransform {
    /// Sine and cosine of the rotation angle, measured from u toward v.
    turn: (f64, f64),
    /// Translation.
    offset: DVec2,
    /// The UV set to transform.
    of: UvSet,
}

impl UvTransform {
    /// Creates a transform that first rotates about the origin by an angle in degrees, then translates.
    /// Returns `None` if it would change nothing.
    pub fn new(of: UvSet, degrees: f64, offset: DVec2) -> Option<Self> {
        let is_moved = of != UvSet::First || degrees != 0.0 || offset != DVec2::ZERO;
        is_moved.then(|| Self { turn: sin_cos_degrees(degrees), offset, of })
    }

    /// The point in the second UV set, if the transform applies to that set.
    #[inline]
    fn second_uv_point_if_used<'a>(&self, at: &'a TexturePoint) -> Option<&'a SecondUvPoint> {
        match self.of {
            UvSet::First => None,
            UvSet::Second => at.second_uv_point(),
        }
    }

    /// Transforms a point.
    #[inline]
    fn transform_point(&self, at: DVec2) -> DVec2 {
        self.transform_vector(at) + self.offset
    }

    /// Transforms a vector.
    #[inline]
    fn transform_vector(&self, by: DVec2) -> DVec2 {
        let (sin, cos) = self.turn;
        DVec2::new(by.x * cos - by.y * sin, by.x * sin + by.y * cos)
    }

    /// The vector that transforms to `moved`.
    #[inline]
    fn inverse_transform_vector(&self, moved: DVec2) -> DVec2 {
        let (sin, cos) = self.turn;
        DVec2::new(moved.x * cos + moved.y * sin, moved.y * cos - moved.x * sin)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_turns_change_nothing() {
        assert_eq!(UvTransform::new(UvSet::First, 0.0, DVec2::ZERO), None);
        let (sin, cos) = UvTransform::new(UvSet::First, -270.0, DVec2::ZERO).expect("a rotation").turn;
        assert_eq!((sin, cos), (1.0, 0.0));
    }
}
