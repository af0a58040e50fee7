//! Image textures.

use std::sync::Arc;

use super::mapping::TextureMapping;
use super::wrap::{Wrap, finite_or_zero, mirror_sign};
use crate::choice;
use crate::materials::footprint::TexturePoint;
use crate::materials::mipmaps::Mipmaps;
use crate::materials::texels::{Texels, unpremultiply};
use crate::math::elementary::{exp2, log2};
use crate::math::lanes::{F32x16, PACKET_SIZE, Vec3x16, lane, set_lane};
use crate::math::{DVec2, Vec2, Vec3, Vec4};

choice! {
    /// Texture interpolation.
    pub enum TextureFilter {
        /// The texel that contains the point.
        Nearest = "nearest",
        /// Bilinear interpolation between the four nearest texel centers.
        Bilinear = "bilinear",
        /// Trilinear interpolation between two mip levels, which are chosen by the footprint.
        Mipmap = "mipmap",
    }
}

/// An image with settings for looking up texels.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageTexture {
    /// The image.
    pub texels: Arc<Texels>,
    /// Mip levels, if the filter is [`TextureFilter::Mipmap`].
    pub mipmaps: Option<Arc<Mipmaps>>,
    /// Interpolation.
    pub filter: TextureFilter,
    /// How the texture continues beyond [0, 1].
    pub wrap: Wrap,
    /// Maps texture coordinates to the image.
    pub mapping: TextureMapping,
    /// Scale and offset applied to looked-up values, or `None` for the identity. Heights and their slopes are
    /// not affected.
    pub factor: Option<ValueScaleAndOffset>,
}

/// Scale and offset applied to looked-up values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValueScaleAndOffset {
    /// The scale.
    pub gain: Vec3,
    /// The offset, added after scaling.
    pub base: Vec3,
}

impl ValueScaleAndOffset {
    /// Leaves values as they are.
    pub const IDENTITY: Self = Self { gain: Vec3::ONE, base: Vec3::ZERO };

    /// A scale without an offset, or `None` if the scale is 1.
    pub fn from_scale(gain: Vec3) -> Option<Self> {
        Self::from_scale_and_offset(gain, Vec3::ZERO)
    }

    /// A scale and an offset, or `None` for the identity.
    pub fn from_scale_and_offset(gain: Vec3, base: Vec3) -> Option<Self> {
        (gain != Vec3::ONE || base != Vec3::ZERO).then_some(Self { gain, base })
    }

    /// The scaled value plus the offset, clamped to be nonnegative.
    #[inline]
    fn apply(&self, value: Vec3) -> Vec3 {
        (value * self.gain + self.base).max(Vec3::ZERO)
    }

    /// Multiplies the result by a factor.
    pub fn scaled_by(self, factor: f32) -> Self {
        Self { gain: self.gain * factor, base: self.base * factor }
    }
}

impl ImageTexture {
    /// The linear value at the given texture coordinates. v = 0 is the bottom row. Non-finite coordinates are
    /// treated as 0.
    pub fn lookup(&self, at: &TexturePoint) -> Vec3 {
        let tiles = self.mapping.map_point(at);
        let value = self.lookup_transformed_uv(tiles, || self.fractional_mip_level(at));
        self.factor.map_or(value, |factor| factor.apply(value))
    }

    /// The value at the given tile coordinates. `level` is called only if the filter uses mip levels.
    #[inline]
    fn lookup_transformed_uv(&self, tiles: DVec2, level: impl FnOnce() -> f32) -> Vec3 {
        let folded =
            [self.wrap.fold(finite_or_zero(tiles.x)) as f32, self.wrap.fold(finite_or_zero(tiles.y)) as f32];
        match self.filter {
            TextureFilter::Nearest => self.nearest(folded),
            TextureFilter::Bilinear => self.bilinear(&self.texels, folded),
            TextureFilter::Mipmap => self.trilinear(level(), folded),
        }
    }

    /// Slopes of the red channel along u and v. They are central differences over one texel of the image or,
    /// with mip levels, over one texel of the level chosen by the footprint.
    pub fn slopes(&self, at: &TexturePoint) -> Vec2 {
        let tiles = self.mapping.map_point(at);
        let level = match (self.filter, &self.mipmaps) {
            (TextureFilter::Mipmap, Some(mipmaps)) => {
                self.fractional_mip_level(at).min(mipmaps.reduced_level_count() as f32)
            }
            (TextureFilter::Mipmap | TextureFilter::Nearest | TextureFilter::Bilinear, _) => 0.0,
        };
        // Look up on both sides, along the axes of the image.
        let steps = float_size(&self.texels).as_dvec2().recip() * f64::from(exp2(level));
        let beside = |by: DVec2| self.lookup_transformed_uv(tiles + by, || level).x;
        let change = |half: DVec2| beside(half) - beside(-half);
        let changes =
            Vec2::new(change(DVec2::new(steps.x * 0.5, 0.0)), change(DVec2::new(0.0, steps.y * 0.5)));
        // Rotate the gradient from image coordinates back to surface coordinates.
        self.mapping.texture_slopes_to_uv(changes.as_dvec2() / steps)
    }

    /// Converts slopes in the image to slopes along the texture's own coordinates. [`Wrap::Mirror`] may flip
    /// them.
    pub fn flip_slopes_in_mirrored_tiles(&self, at: &TexturePoint, slopes: Vec2) -> Vec2 {
        if self.wrap != Wrap::Mirror {
            return slopes;
        }
        let tiles = self.mapping.map_point(at);
        slopes * Vec2::from([tiles.x, tiles.y].map(|tile| mirror_sign(tile) as f32))
    }

    /// Number of texels per unit of u and v.
    pub fn texels_per_unit(&self) -> [f64; 2] {
        self.mapping.cells_per_uv_unit(float_size(&self.texels).as_dvec2())
    }

    /// Packet version of [`ImageTexture::lookup`], for textures without mip levels.
    #[inline(always)]
    pub fn lookup_packet(&self, uv: &[[f64; PACKET_SIZE]; 2]) -> Vec3x16 {
        let mut row = match &self.mapping.moved {
            None => self.lookup_packet_with_uv_scale(uv, self.mapping.repeat.as_dvec2()),
            Some(_) => self.transform_and_lookup_packet(uv),
        };
        if let Some(factor) = self.factor {
            let (gain, base) = (factor.gain.to_array(), factor.base.to_array());
            for (channel, lanes) in row.iter_mut().enumerate() {
                lanes.iter_mut().for_each(|lane| *lane = (*lane * gain[channel] + base[channel]).max(0.0));
            }
        }
        row
    }

    /// [`ImageTexture::lookup_packet`] for textures that have a transform.
    #[cold]
    #[inline(never)]
    fn transform_and_lookup_packet(&self, uv: &[[f64; PACKET_SIZE]; 2]) -> Vec3x16 {
        self.lookup_packet_with_uv_scale(&self.mapping.map_packet(uv), DVec2::ONE)
    }

    /// [`ImageTexture::lookup_packet`] at coordinates scaled by `repeat`.
    #[inline(always)]
    fn lookup_packet_with_uv_scale(&self, uv: &[[f64; PACKET_SIZE]; 2], repeat: DVec2) -> Vec3x16 {
        let (texels, size) = (&*self.texels, float_size(&self.texels));
        let folded = [
            self.wrap.scale_and_fold_packet(&uv[0], repeat.x),
            self.wrap.scale_and_fold_packet(&uv[1], repeat.y),
        ];
        let extent = integer_size(texels);
        let (mut first, mut part) = ([[0; PACKET_SIZE]; 2], [[0.0; PACKET_SIZE]; 2]);
        let (shift, count) = match self.filter {
            TextureFilter::Nearest => (0.0, 1),
            TextureFilter::Bilinear | TextureFilter::Mipmap if texels.has_alpha() => {
                return self.unpremultiplied_bilinear_packet(&folded);
            }
            TextureFilter::Bilinear | TextureFilter::Mipmap => (0.5, 4),
        };
        for axis in 0..2 {
            for i in 0..PACKET_SIZE {
                let x = folded[axis][i] * size[axis] - shift;
                first[axis][i] = x.floor() as i32;
                part[axis][i] = x - x.floor();
            }
        }
        let columns = self.wrap.wrap_index_packet(&first[0], 0, extent[0]);
        let rows = self.wrap.wrap_index_packet(&first[1], 0, extent[1]);
        let mut around = [texel_index_packet(&columns, &rows, extent); 4];
        if count == 4 {
            let right = self.wrap.wrap_index_packet(&first[0], 1, extent[0]);
            let upper = self.wrap.wrap_index_packet(&first[1], 1, extent[1]);
            around[1] = texel_index_packet(&right, &rows, extent);
            around[2] = texel_index_packet(&columns, &upper, extent);
            around[3] = texel_index_packet(&right, &upper, extent);
        }
        let mut corners = [[[0.0; PACKET_SIZE]; 3]; 4];
        texels.read_color_packets_into(&around[..count], &mut corners);
        if count == 1 {
            return corners[0];
        }
        let mut colors = [[0.0; PACKET_SIZE]; 3];
        for i in 0..PACKET_SIZE {
            let corner = |number: usize| lane(&corners[number], i);
            let lower = corner(0).lerp(corner(1), part[0][i]);
            let upper = corner(2).lerp(corner(3), part[0][i]);
            set_lane(&mut colors, i, lower.lerp(upper, part[1][i]));
        }
        colors
    }

    /// Whether the texture is 0 everywhere, with its scale and offset applied.
    pub fn is_black(&self) -> bool {
        let has_offset = self.factor.is_some_and(|factor| factor.base.max_element() > 0.0);
        self.texels.is_black() && !has_offset
    }

    /// Mean of the image. This is the mean of the texture if a whole number of tiles fits into [0, 1]².
    pub fn mean(&self) -> Vec3 {
        let last = self.mipmaps.as_ref().and_then(|mipmaps| mipmaps.level(mipmaps.reduced_level_count()));
        let mean = last.map_or_else(|| self.texels.mean(), |last| last.get(0, 0));
        match self.factor {
            // Texels below 0 are clamped before they are averaged.
            Some(factor) if factor.base.min_element() < 0.0 || factor.gain.min_element() < 0.0 => {
                self.texels.mean_of_function(|texel| factor.apply(texel))
            }
            Some(factor) => factor.apply(mean),
            None => mean,
        }
    }

    /// The mip level at which the footprint is one texel wide. It is nonnegative, and may be fractional.
    fn fractional_mip_level(&self, at: &TexturePoint) -> f32 {
        let texels = self.mapping.major_axis_length(at, float_size(&self.texels));
        if texels > 1.0 { log2(texels) } else { 0.0 }
    }

    fn nearest(&self, [u, v]: [f32; 2]) -> Vec3 {
        let (size, extent) = (float_size(&self.texels), integer_size(&self.texels));
        let column = self.wrap.wrap_index(floor_to_i32(u * size.x), extent[0]);
        let row = self.wrap.wrap_index(floor_to_i32(v * size.y), extent[1]);
        self.texels.linear_color_at_index(texel_index(column, row, extent))
    }

    /// Interpolates between the two levels around `level`.
    fn trilinear(&self, level: f32, folded: [f32; 2]) -> Vec3 {
        let Some((near, far, part)) = self.adjacent_levels(level) else {
            return self.bilinear(&self.texels, folded);
        };
        if self.texels.has_alpha() {
            let [near, far] = [near, far].map(|texels| self.bilinear_premultiplied_rgba(texels, folded));
            return unpremultiply(near.lerp(far, part));
        }
        self.bilinear(near, folded).lerp(self.bilinear(far, folded), part)
    }

    /// The two images closest to a fractional mip level, and the weight of the second image, or `None` if
    /// only the original image is used.
    #[inline(always)]
    fn adjacent_levels(&self, level: f32) -> Option<(&Texels, &Texels, f32)> {
        let mipmaps = self.mipmaps.as_ref().filter(|_| level > 0.0)?;
        let level = level.min(mipmaps.reduced_level_count() as f32);
        let number = level as usize;
        let of = |number: usize| match number {
            0 => &*self.texels,
            number => mipmaps.level(number).unwrap_or(&self.texels),
        };
        Some((of(number), of(number + 1), level - number as f32))
    }

    /// The fraction of the footprint where the red channel is at least `cutoff`. In the original image, the
    /// fraction is 0 or 1. The mip levels must be computed from [`Texels::threshold_red_channel`].
    pub fn coverage_above_cutoff(&self, at: &TexturePoint, cutoff: f32) -> f32 {
        let tiles = self.mapping.map_point(at);
        let folded =
            [self.wrap.fold(finite_or_zero(tiles.x)) as f32, self.wrap.fold(finite_or_zero(tiles.y)) as f32];
        let cut = |value: f32| f32::from(u8::from(value >= cutoff));
        let Some((near, far, part)) = self.adjacent_levels(self.fractional_mip_level(at)) else {
            return cut(self.bilinear(&self.texels, folded).x);
        };
        let of = |texels: &Texels| {
            let value = self.bilinear(texels, folded).x;
            if std::ptr::eq(texels, &*self.texels) { cut(value) } else { value }
        };
        let near = of(near);
        near + (of(far) - near) * part
    }

    /// Bilinear lookups of texels with alpha, for a packet.
    #[cold]
    #[inline(never)]
    fn unpremultiplied_bilinear_packet(&self, folded: &[F32x16; 2]) -> Vec3x16 {
        let mut colors = [[0.0; PACKET_SIZE]; 3];
        for i in 0..PACKET_SIZE {
            let color = self.bilinear(&self.texels, [folded[0][i], folded[1][i]]);
            set_lane(&mut colors, i, color);
        }
        colors
    }

    /// Interpolates premultiplied texels and their alpha bilinearly.
    #[cold]
    #[inline(never)]
    fn bilinear_premultiplied_rgba(&self, texels: &Texels, folded: [f32; 2]) -> Vec4 {
        let (places, [fx, fy]) = self.bilinear_corner_indices(texels, folded);
        let corners = places.map(|place| texels.premultiplied_texel(place));
        corners[0].lerp(corners[1], fx).lerp(corners[2].lerp(corners[3], fx), fy)
    }

    fn bilinear(&self, texels: &Texels, folded: [f32; 2]) -> Vec3 {
        if texels.has_alpha() {
            return unpremultiply(self.bilinear_premultiplied_rgba(texels, folded));
        }
        let (places, [fx, fy]) = self.bilinear_corner_indices(texels, folded);
        let corners = texels.linear_colors_at_indices(&places);
        let (lower, upper) = (corners[0].lerp(corners[1], fx), corners[2].lerp(corners[3], fx));
        lower.lerp(upper, fy)
    }

    /// Indices of the four nearest texels, and the interpolation weights.
    #[inline(always)]
    fn bilinear_corner_indices(&self, texels: &Texels, [u, v]: [f32; 2]) -> ([usize; 4], [f32; 2]) {
        let (size, extent) = (float_size(texels), integer_size(texels));
        let (x, y) = (u * size.x - 0.5, v * size.y - 0.5);
        let first = [floor_to_i32(x), floor_to_i32(y)];
        let (fx, fy) = (x - first[0] as f32, y - first[1] as f32);
        let [left, right] = self.wrap.neighbor_indices(first[0], extent[0]);
        let [bottom, top] = self.wrap.neighbor_indices(first[1], extent[1]);
        let place = |column, row| texel_index(column, row, extent);
        ([place(left, bottom), place(right, bottom), place(left, top), place(right, top)], [fx, fy])
    }
}

/// Rounds down without the slow library call that [`f32::floor`] makes on processors without a rounding
/// instruction.
#[inline(always)]
fn floor_to_i32(x: f32) -> i32 {
    let towards_zero = x as i32;
    towards_zero - i32::from(towards_zero as f32 > x)
}

/// Index of the texel in a column and a row. Rows are counted from the bottom.
#[inline(always)]
fn texel_index(column: i32, row: i32, [width, height]: [i32; 2]) -> usize {
    (height - 1 - row) as usize * width as usize + column as usize
}

/// [`texel_index`] for a packet of texels.
#[inline(always)]
fn texel_index_packet(
    columns: &[i32; PACKET_SIZE],
    rows: &[i32; PACKET_SIZE],
    extent: [i32; 2],
) -> [usize; PACKET_SIZE] {
    let mut places = [0; PACKET_SIZE];
    for i in 0..PACKET_SIZE {
        places[i] = texel_index(columns[i], rows[i], extent);
    }
    places
}

/// Width and height in texels, as integers.
#[inline(always)]
fn integer_size(texels: &Texels) -> [i32; 2] {
    [texels.width as i32, texels.height as i32]
}

/// Width and height in texels, as a float vector.
fn float_size(texels: &Texels) -> Vec2 {
    Vec2::new(texels.width as f32, texels.height as f32)
}

#[cfg(test)]
#[path = "image_tests.rs"]
mod tests;
