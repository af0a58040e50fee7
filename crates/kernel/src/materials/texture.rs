//! Texture lookup.

use std::sync::Arc;

use super::footprint::{SecondUvPoint, TexturePoint, UvSet};
use super::mipmaps::Mipmaps;
use super::texels::{Texels, unpremultiply};
use crate::choice;
use crate::math::elementary::{exp2, log2};
use crate::math::lanes::{F32x16, PACKET_SIZE, Vec3x16, lane, set_lane};
use crate::math::transform::sin_cos_degrees;
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

choice! {
    /// How a texture continues beyond [0, 1].
    pub enum Wrap {
        /// Periodic.
        Repeat = "repeat",
        /// Border texels are repeated outside the image.
        Clamp = "clamp",
        /// Periodic. Every other tile is mirrored.
        Mirror = "mirror",
    }
}

/// An image with settings for looking up texels.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// The image.
    pub texels: Arc<Texels>,
    /// Mip levels, if the filter is [`TextureFilter::Mipmap`].
    pub mipmaps: Option<Arc<Mipmaps>>,
    /// Interpolation.
    pub filter: TextureFilter,
    /// How the texture continues beyond [0, 1].
    pub wrap: Wrap,
    /// Number of repetitions along u and v.
    pub repeat: Vec2,
    /// Transform that is applied after repetition, or `None` if it is the identity on the first UV set.
    pub moved: Option<Box<UvTransform>>,
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
    fn second_uv_set_point<'a>(&self, at: &'a TexturePoint) -> Option<&'a SecondUvPoint> {
        match self.of {
            UvSet::First => None,
            UvSet::Second => at.second.as_deref(),
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
    pub fn inverse_transform_vector(&self, moved: DVec2) -> DVec2 {
        let (sin, cos) = self.turn;
        DVec2::new(moved.x * cos + moved.y * sin, moved.y * cos - moved.x * sin)
    }

    /// Multiplies a packet of coordinates by `repeat` and transforms them.
    fn scale_and_transform_packet(
        &self,
        uv: &[[f64; PACKET_SIZE]; 2],
        repeat: DVec2,
    ) -> [[f64; PACKET_SIZE]; 2] {
        let mut row = *uv;
        for i in 0..PACKET_SIZE {
            let moved = self.transform_point(DVec2::new(uv[0][i], uv[1][i]) * repeat);
            (row[0][i], row[1][i]) = (moved.x, moved.y);
        }
        row
    }
}

/// A color parameter, constant or textured.
#[derive(Clone, Debug, PartialEq)]
pub enum ColorOrTexture {
    /// A constant color.
    Constant(Vec3),
    /// A color texture.
    Texture(Arc<Texture>),
}

impl ColorOrTexture {
    /// The constant color, or `None` for a texture.
    pub fn as_untextured(&self) -> Option<Vec3> {
        match self {
            Self::Constant(color) => Some(*color),
            Self::Texture(_) => None,
        }
    }

    /// The texture, or `None` for a constant.
    pub fn texture(&self) -> Option<&Arc<Texture>> {
        match self {
            Self::Constant(_) => None,
            Self::Texture(texture) => Some(texture),
        }
    }

    /// The color at the given texture coordinates. Counts texture lookups in `lookups`.
    pub fn evaluate(&self, at: &TexturePoint, lookups: &mut u64) -> Vec3 {
        match self {
            Self::Constant(color) => *color,
            Self::Texture(texture) => {
                *lookups += 1;
                texture.lookup(at)
            }
        }
    }
}

impl Texture {
    /// The linear value at the given texture coordinates. v = 0 is the bottom row. Non-finite coordinates are
    /// treated as 0.
    pub fn lookup(&self, at: &TexturePoint) -> Vec3 {
        let tiles = self.transformed_uv(at);
        let value = self.lookup_transformed_uv(tiles, || self.mip_level(at));
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

    /// Repeated and transformed coordinates, in units of the image size.
    #[inline]
    fn transformed_uv(&self, at: &TexturePoint) -> DVec2 {
        let repeat = self.repeat.as_dvec2();
        let Some(moved) = &self.moved else { return at.uv * repeat };
        moved.transform_point(moved.second_uv_set_point(at).map_or(at.uv, |second| second.uv) * repeat)
    }

    /// The UV set used for lookups.
    #[inline]
    pub fn uv_set(&self) -> UvSet {
        self.moved.as_ref().map_or(UvSet::First, |moved| moved.of)
    }

    /// Tangents ∂p/∂u and ∂p/∂v of the UV set used for lookups. `first` contains the tangents of the first
    /// set.
    #[inline]
    pub fn uv_set_tangents(&self, at: &TexturePoint, first: [Vec3; 2]) -> [Vec3; 2] {
        let second = self.moved.as_ref().and_then(|moved| moved.second_uv_set_point(at));
        second.map_or(first, |second| second.tangents)
    }

    /// Slopes of the red channel along u and v. They are central differences over one texel of the image or,
    /// with mip levels, over one texel of the level chosen by the footprint.
    pub fn slopes(&self, at: &TexturePoint) -> Vec2 {
        let tiles = self.transformed_uv(at);
        let level = match (self.filter, &self.mipmaps) {
            (TextureFilter::Mipmap, Some(mipmaps)) => self.mip_level(at).min(mipmaps.count() as f32),
            (TextureFilter::Mipmap | TextureFilter::Nearest | TextureFilter::Bilinear, _) => 0.0,
        };
        // Look up on both sides, along the axes of the image.
        let steps = float_size(&self.texels).as_dvec2().recip() * f64::from(exp2(level));
        let beside = |by: DVec2| self.lookup_transformed_uv(tiles + by, || level).x;
        let change = |half: DVec2| beside(half) - beside(-half);
        let changes =
            Vec2::new(change(DVec2::new(steps.x * 0.5, 0.0)), change(DVec2::new(0.0, steps.y * 0.5)));
        // Rotate the gradient from image coordinates back to surface coordinates.
        let slopes = changes.as_dvec2() / steps;
        let slopes = self.moved.as_ref().map_or(slopes, |moved| moved.inverse_transform_vector(slopes));
        slopes.as_vec2() * self.repeat
    }

    /// Converts slopes in the image to slopes along the texture's own coordinates. [`Wrap::Mirror`] may flip
    /// them.
    pub fn flip_slopes_in_mirrored_tiles(&self, at: &TexturePoint, slopes: Vec2) -> Vec2 {
        if self.wrap != Wrap::Mirror {
            return slopes;
        }
        let tiles = self.transformed_uv(at);
        slopes * Vec2::from([tiles.x, tiles.y].map(|tile| mirror_sign(tile) as f32))
    }

    /// Tangents along the texture's repeated and transformed coordinates. Only the directions matter.
    pub fn transformed_tangents(&self, [dpdu, dpdv]: [Vec3; 2]) -> [Vec3; 2] {
        let sides = self.repeat.signum();
        let Some(moved) = &self.moved else { return [dpdu * sides.x, dpdv * sides.y] };
        [DVec2::X, DVec2::Y].map(|axis| {
            let by = moved.inverse_transform_vector(axis).as_vec2() / self.repeat;
            dpdu * by.x + dpdv * by.y
        })
    }

    /// Number of texels per unit of u and v.
    pub fn texels_per_unit(&self) -> [f64; 2] {
        let (size, repeat) = (float_size(&self.texels).as_dvec2(), self.repeat.as_dvec2());
        let Some(moved) = &self.moved else { return (size * repeat).abs().to_array() };
        let along = |axis: DVec2| (moved.transform_vector(axis * repeat) * size).length();
        [along(DVec2::X), along(DVec2::Y)]
    }

    /// Packet version of [`Texture::lookup`], for textures without mip levels.
    #[inline(always)]
    pub fn lookup_packet(&self, uv: &[[f64; PACKET_SIZE]; 2]) -> Vec3x16 {
        let mut row = match &self.moved {
            None => self.lookup_packet_at_scaled_uv(uv, self.repeat.as_dvec2()),
            Some(moved) => self.transform_and_lookup_packet(moved, uv),
        };
        if let Some(factor) = self.factor {
            let (gain, base) = (factor.gain.to_array(), factor.base.to_array());
            for (channel, lanes) in row.iter_mut().enumerate() {
                lanes.iter_mut().for_each(|lane| *lane = (*lane * gain[channel] + base[channel]).max(0.0));
            }
        }
        row
    }

    /// [`Texture::lookup_packet`] for textures that have a transform.
    #[cold]
    #[inline(never)]
    fn transform_and_lookup_packet(&self, moved: &UvTransform, uv: &[[f64; PACKET_SIZE]; 2]) -> Vec3x16 {
        self.lookup_packet_at_scaled_uv(
            &moved.scale_and_transform_packet(uv, self.repeat.as_dvec2()),
            DVec2::ONE,
        )
    }

    /// [`Texture::lookup_packet`] at coordinates scaled by `repeat`.
    #[inline(always)]
    fn lookup_packet_at_scaled_uv(&self, uv: &[[f64; PACKET_SIZE]; 2], repeat: DVec2) -> Vec3x16 {
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
                return self.bilinear_packet_with_alpha(&folded);
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
        let last = self.mipmaps.as_ref().and_then(|mipmaps| mipmaps.level(mipmaps.count()));
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
    fn mip_level(&self, at: &TexturePoint) -> f32 {
        let texels = match &self.moved {
            None => at.footprint.major_axis_texels(float_size(&self.texels) * self.repeat),
            Some(moved) => {
                let size = float_size(&self.texels);
                let footprint =
                    moved.second_uv_set_point(at).map_or(&at.footprint, |second| &second.footprint);
                footprint.transformed_major_axis_length(|axis| {
                    moved.transform_vector((axis * self.repeat).as_dvec2()).as_vec2() * size
                })
            }
        };
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
        let level = level.min(mipmaps.count() as f32);
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
        let tiles = self.transformed_uv(at);
        let folded =
            [self.wrap.fold(finite_or_zero(tiles.x)) as f32, self.wrap.fold(finite_or_zero(tiles.y)) as f32];
        let cut = |value: f32| f32::from(u8::from(value >= cutoff));
        let Some((near, far, part)) = self.adjacent_levels(self.mip_level(at)) else {
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
    fn bilinear_packet_with_alpha(&self, folded: &[F32x16; 2]) -> Vec3x16 {
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
        let (places, [fx, fy]) = self.bilinear_corners(texels, folded);
        let corners = places.map(|place| texels.premultiplied_texel(place));
        corners[0].lerp(corners[1], fx).lerp(corners[2].lerp(corners[3], fx), fy)
    }

    fn bilinear(&self, texels: &Texels, folded: [f32; 2]) -> Vec3 {
        if texels.has_alpha() {
            return unpremultiply(self.bilinear_premultiplied_rgba(texels, folded));
        }
        let (places, [fx, fy]) = self.bilinear_corners(texels, folded);
        let corners = texels.linear_colors_at_indices(&places);
        let (lower, upper) = (corners[0].lerp(corners[1], fx), corners[2].lerp(corners[3], fx));
        lower.lerp(upper, fy)
    }

    /// Indices of the four nearest texels, and the interpolation weights.
    #[inline(always)]
    fn bilinear_corners(&self, texels: &Texels, [u, v]: [f32; 2]) -> ([usize; 4], [f32; 2]) {
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

impl Wrap {
    /// Multiplies coordinates by `repeat` and folds them into [0, 1].
    #[inline(always)]
    fn scale_and_fold_packet(self, x: &[f64; PACKET_SIZE], repeat: f64) -> F32x16 {
        let mut folded = [0.0; PACKET_SIZE];
        macro_rules! by {
            ($wrap:expr) => {
                for i in 0..PACKET_SIZE {
                    folded[i] = $wrap.fold(finite_or_zero(x[i] * repeat)) as f32;
                }
            };
        }
        match self {
            Self::Repeat => by!(Self::Repeat),
            Self::Clamp => by!(Self::Clamp),
            Self::Mirror => by!(Self::Mirror),
        }
        folded
    }

    /// Wraps `numbers` + `more` with [`Wrap::wrap_index`].
    #[inline(always)]
    fn wrap_index_packet(self, numbers: &[i32; PACKET_SIZE], more: i32, size: i32) -> [i32; PACKET_SIZE] {
        let mut indices = [0; PACKET_SIZE];
        macro_rules! by {
            ($wrap:expr) => {
                for i in 0..PACKET_SIZE {
                    indices[i] = $wrap.wrap_index(numbers[i] + more, size);
                }
            };
        }
        match self {
            Self::Repeat => by!(Self::Repeat),
            Self::Clamp => by!(Self::Clamp),
            Self::Mirror => by!(Self::Mirror),
        }
        indices
    }

    /// Folds a coordinate into [0, 1].
    #[inline(always)]
    fn fold(self, x: f64) -> f64 {
        match self {
            Self::Repeat => x - x.floor(),
            Self::Clamp => x.clamp(0.0, 1.0),
            Self::Mirror => {
                let period = x - 2.0 * (x * 0.5).floor();
                if period > 1.0 { 2.0 - period } else { period }
            }
        }
    }

    /// The wrapped index and its wrapped successor.
    #[inline(always)]
    fn neighbor_indices(self, first: i32, size: i32) -> [i32; 2] {
        [self.wrap_index(first, size), self.wrap_index(first + 1, size)]
    }

    /// Wraps an index in the range −1 to `size`.
    #[inline(always)]
    fn wrap_index(self, i: i32, size: i32) -> i32 {
        match self {
            Self::Repeat => i + if i < 0 { size } else { 0 } - if i >= size { size } else { 0 },
            // Mirroring also repeats the texel at the border.
            Self::Clamp | Self::Mirror => i.max(0).min(size - 1),
        }
    }
}

/// −1 in tiles that [`Wrap::Mirror`] mirrors, 1 in all other tiles.
fn mirror_sign(x: f64) -> f64 {
    let x = finite_or_zero(x);
    if x - 2.0 * (x * 0.5).floor() > 1.0 { -1.0 } else { 1.0 }
}

/// Replaces non-finite coordinates with 0.
#[inline(always)]
fn finite_or_zero(x: f64) -> f64 {
    if x.is_finite() { x } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::materials::footprint::Footprint;
    use crate::materials::mipmaps::ImageHalver;
    use crate::materials::texels::TexelData;

    /// A texture with the values [[0, 1], [2, 3]]. The bottom row comes first.
    fn numbered(filter: TextureFilter, wrap: Wrap) -> Texture {
        let data = [2.0, 3.0, 0.0, 1.0].map(Vec3::splat).to_vec();
        let texels = Arc::new(Texels { width: 2, height: 2, data: TexelData::Float(data), unusable: 0 });
        Texture { texels, mipmaps: None, filter, wrap, repeat: Vec2::ONE, moved: None, factor: None }
    }

    fn bilinear(wrap: Wrap, u: f32, v: f32) -> f32 {
        numbered(TextureFilter::Bilinear, wrap).lookup(&TexturePoint::from_uv(Vec2::new(u, v).as_dvec2())).x
    }

    #[test]
    fn bilinear_lookups_return_expected_values() {
        for (u, v, expected) in [(0.25, 0.25, 0.0), (0.5, 0.5, 1.5), (0.5, 0.25, 0.5), (0.75, 0.75, 3.0)] {
            for wrap in [Wrap::Repeat, Wrap::Clamp, Wrap::Mirror] {
                assert!((bilinear(wrap, u, v) - expected).abs() < 1e-6, "{wrap:?} at {u}, {v}");
            }
        }
        assert!((bilinear(Wrap::Repeat, 0.0, 0.0) - 1.5).abs() < 1e-6);
        assert!((bilinear(Wrap::Clamp, 0.0, 0.0) - 0.0).abs() < 1e-6);
        assert!((bilinear(Wrap::Mirror, 0.0, 0.0) - 0.0).abs() < 1e-6);
    }

    #[test]
    fn coordinates_wrap_outside_the_unit_square() {
        assert!((bilinear(Wrap::Repeat, -0.75, 3.25) - bilinear(Wrap::Repeat, 0.25, 0.25)).abs() < 1e-5);
        assert!((bilinear(Wrap::Mirror, 1.25, 0.25) - bilinear(Wrap::Mirror, 0.75, 0.25)).abs() < 1e-5);
        assert!((bilinear(Wrap::Mirror, -0.25, -0.25) - bilinear(Wrap::Mirror, 0.25, 0.25)).abs() < 1e-5);
        assert!((bilinear(Wrap::Clamp, 9.0, 9.0) - 3.0).abs() < 1e-6);
        let mut repeated = numbered(TextureFilter::Nearest, Wrap::Repeat);
        repeated.repeat = Vec2::new(2.0, 1.0);
        assert_eq!(repeated.lookup(&TexturePoint::from_uv(DVec2::new(0.6, 0.1))).x, 0.0);
        assert_eq!(repeated.lookup(&TexturePoint::from_uv(DVec2::new(0.4, 0.1))).x, 1.0);
    }

    #[test]
    fn coordinates_repeat_then_rotate_then_translate() {
        let at =
            |texture: &Texture, u: f64, v: f64| texture.lookup(&TexturePoint::from_uv(DVec2::new(u, v))).x;
        let mut texture = numbered(TextureFilter::Nearest, Wrap::Repeat);
        texture.repeat = Vec2::new(2.0, 1.0);
        texture.moved = UvTransform::new(UvSet::First, 90.0, DVec2::new(0.0, 0.5)).map(Box::new);
        // (u, v) is mapped to (−v, 2u + ½). For example, (0.1, 0.3) maps to (−0.3, 0.7), which wraps to (0.7,
        // 0.7).
        assert_eq!(at(&texture, 0.1, 0.3), 3.0);
        assert_eq!(at(&texture, 0.1, 0.7), 2.0);
        assert_eq!(at(&texture, 0.3, 0.3), 1.0);
        assert_eq!(texture.texels_per_unit(), [4.0, 2.0]);
        assert_eq!(UvTransform::new(UvSet::First, 0.0, DVec2::ZERO), None);
        let (sin, cos) = UvTransform::new(UvSet::First, -270.0, DVec2::ZERO).expect("a rotation").turn;
        assert_eq!((sin, cos), (1.0, 0.0));
    }

    #[test]
    fn second_uv_set_is_used_if_present() {
        let second = SecondUvPoint {
            uv: DVec2::new(0.9, 0.9),
            footprint: Footprint::POINT,
            tangents: [Vec3::Y * 2.0, Vec3::NEG_X],
        };
        let at =
            TexturePoint { second: Some(Box::new(second)), ..TexturePoint::from_uv(DVec2::new(0.1, 0.1)) };
        let mut texture = numbered(TextureFilter::Nearest, Wrap::Repeat);
        let first = [Vec3::X, Vec3::Y];
        assert_eq!((texture.lookup(&at).x, texture.uv_set_tangents(&at, first)), (0.0, first));
        texture.moved = UvTransform::new(UvSet::Second, 0.0, DVec2::ZERO).map(Box::new);
        assert_eq!((texture.lookup(&at).x, texture.uv_set_tangents(&at, first)), (3.0, second.tangents));
        assert_eq!(texture.lookup(&at.without_footprint()).x, 3.0);
        let alone = TexturePoint { second: None, ..at };
        assert_eq!((texture.lookup(&alone).x, texture.uv_set_tangents(&alone, first)), (0.0, first));
        // The second set is repeated, rotated, and translated like the first set.
        texture.repeat = Vec2::new(1.0, 0.5);
        texture.moved = UvTransform::new(UvSet::Second, 90.0, DVec2::new(0.5, 0.0)).map(Box::new);
        assert_eq!(texture.lookup(&at).x, 2.0);
    }

    #[test]
    fn factor_scales_values_and_mean_but_not_slopes() {
        let plain = numbered(TextureFilter::Bilinear, Wrap::Repeat);
        let factor = Vec3::new(0.5, 2.0, 3.0);
        let texture = Texture { factor: ValueScaleAndOffset::from_scale(factor), ..plain.clone() };
        let at = TexturePoint::from_uv(DVec2::new(0.3, 0.6));
        assert_eq!(texture.lookup(&at), plain.lookup(&at) * factor);
        assert_eq!((texture.mean(), texture.slopes(&at)), (plain.mean() * factor, plain.slopes(&at)));
        let uv = [[0.3; PACKET_SIZE], [0.6; PACKET_SIZE]];
        let [row, before] = [&texture, &plain].map(|one| lane(&one.lookup_packet(&uv), 3));
        assert_eq!(row, before * factor);
    }

    #[test]
    fn clamped_values_have_a_clamped_mean() {
        let data = TexelData::Float(vec![Vec3::ZERO, Vec3::ONE]);
        let texels = Arc::new(Texels { width: 2, height: 1, data, unusable: 0 });
        let mut texture = numbered(TextureFilter::Nearest, Wrap::Repeat);
        texture.texels = texels;
        for (base, gain, expected) in [(-0.5, 1.0, 0.25), (1.0, -2.0, 0.5), (-2.0, 1.0, 0.0)] {
            texture.factor = ValueScaleAndOffset::from_scale_and_offset(Vec3::splat(gain), Vec3::splat(base));
            assert_eq!(texture.mean(), Vec3::splat(expected), "{base} {gain}");
            let at = TexturePoint::from_uv(DVec2::new(0.1, 0.5));
            assert_eq!(texture.lookup(&at), Vec3::splat(f32::max(base, 0.0)), "{base} {gain}");
        }
        let black = TexelData::Float(vec![Vec3::ZERO; 2]);
        texture.texels = Arc::new(Texels { width: 2, height: 1, data: black, unusable: 0 });
        for (base, is_black) in [(-0.5, true), (0.0, true), (1.0, false)] {
            texture.factor = ValueScaleAndOffset::from_scale_and_offset(Vec3::ONE, Vec3::splat(base));
            assert_eq!(texture.is_black(), is_black, "{base}");
        }
    }

    #[test]
    fn slopes_follow_the_texture_transform() {
        // Near the center, values increase by 1 per texel to the right and by 2 per texel upward. Relative to
        // the image size, the slopes are 2 and 4.
        let mut texture = numbered(TextureFilter::Bilinear, Wrap::Repeat);
        let at = |texture: &Texture, u: f64, v: f64| texture.slopes(&TexturePoint::from_uv(DVec2::new(u, v)));
        assert_eq!(at(&texture, 0.5, 0.5), Vec2::new(2.0, 4.0));
        texture.repeat = Vec2::new(2.0, -3.0);
        assert_eq!(at(&texture, 0.25, -0.5), Vec2::new(4.0, -12.0));
        // (u, v) maps to (−v, 2u), so the slope along u is the vertical slope of the image.
        (texture.repeat, texture.moved) =
            (Vec2::new(2.0, 1.0), UvTransform::new(UvSet::First, 90.0, DVec2::new(1.0, 0.0)).map(Box::new));
        assert_eq!(at(&texture, 0.25, 0.5), Vec2::new(8.0, -2.0));
        // Clamped borders and non-finite coordinates have no slope.
        let clamped = numbered(TextureFilter::Bilinear, Wrap::Clamp);
        assert_eq!(at(&clamped, -1.0, 0.5), Vec2::new(0.0, 4.0));
        assert_eq!(at(&clamped, f64::NAN, f64::INFINITY), Vec2::ZERO);
    }

    #[test]
    fn extreme_coordinates_stay_in_range() {
        for filter in [TextureFilter::Nearest, TextureFilter::Bilinear] {
            for wrap in [Wrap::Repeat, Wrap::Clamp, Wrap::Mirror] {
                let texture = numbered(filter, wrap);
                for bad in [f32::NAN, f32::INFINITY, -1e30, 1e30, 1.0, 0.0, -0.0, 1.0_f32.next_down(), -1e-9]
                {
                    assert!(
                        (0.0..=3.0).contains(
                            &texture.lookup(&TexturePoint::from_uv(Vec2::new(bad, bad).as_dvec2())).x
                        ),
                        "{filter:?} {wrap:?} {bad}"
                    );
                }
            }
        }
    }

    #[test]
    fn packet_lookups_match_single_lookups() {
        let bytes: Vec<[u8; 3]> = (0..35_u8).map(|i| [i * 7, 255 - i, i.wrapping_mul(41)]).collect();
        let floats = bytes.iter().map(|[r, g, b]| Vec3::new(f32::from(*r), f32::from(*g), f32::from(*b)));
        let images = [
            (7, 5, TexelData::Srgb8(bytes.clone())),
            (5, 7, TexelData::Linear8(bytes.clone())),
            (35, 1, TexelData::Float(floats.collect())),
            (1, 1, TexelData::Srgb8(vec![[200, 100, 50]])),
        ];
        let hostile =
            [f64::NAN, f64::INFINITY, -1e300, 1e300, 0.0, -0.0, 1.0, 1.0_f64.next_down(), -1e-20, 7.0];
        let number = |i: usize| match i % 3 {
            0 => hostile[i / 3 % hostile.len()],
            _ => (i as f64 * 0.618_033_988).fract() * 6.0 - 3.0,
        };
        for (width, height, data) in images {
            let texels = Arc::new(Texels { width, height, data, unusable: 0 });
            for filter in [TextureFilter::Nearest, TextureFilter::Bilinear] {
                for wrap in [Wrap::Repeat, Wrap::Clamp, Wrap::Mirror] {
                    for (repeat, degrees) in
                        [(Vec2::ONE, 0.0), (Vec2::new(2.5, -3.0), 0.0), (Vec2::new(2.0, 3.0), 25.0)]
                    {
                        let texels = Arc::clone(&texels);
                        let moved = UvTransform::new(UvSet::First, degrees, DVec2::new(degrees, 0.25))
                            .filter(|_| degrees != 0.0);
                        let moved = moved.map(Box::new);
                        let texture =
                            Texture { texels, mipmaps: None, filter, wrap, repeat, moved, factor: None };
                        for first in 0..60 {
                            let u = std::array::from_fn(|i| number(first + i));
                            let v = std::array::from_fn(|i| number(first + 5 * i));
                            let row = texture.lookup_packet(&[u, v]);
                            for i in 0..PACKET_SIZE {
                                let alone = texture.lookup(&TexturePoint::from_uv(DVec2::new(u[i], v[i])));
                                assert_eq!(lane(&row, i), alone, "{filter:?} {wrap:?} {} {}", u[i], v[i]);
                            }
                        }
                    }
                }
            }
        }
    }

    /// Creates an image's mip levels.
    fn levels(image: &Texels) -> Option<Arc<Mipmaps>> {
        let halved = |level: &Texels| -> Result<Texels, ()> {
            let halving = ImageHalver::new(level);
            let mut rows = halving.allocate_halved_rows();
            (0..halving.halved_height()).for_each(|y| halving.append_row(y, &mut rows));
            Ok(halving.assemble_image(rows))
        };
        Mipmaps::build(image, halved).ok().map(Arc::new)
    }

    /// Creates a clamped texture from a row of texels.
    fn row(width: u32, data: TexelData, filter: TextureFilter) -> Texture {
        let texels = Arc::new(Texels { width, height: 1, data, unusable: 0 });
        let (mipmaps, wrap, repeat) = (levels(&texels), Wrap::Clamp, Vec2::ONE);
        Texture { texels, mipmaps, filter, wrap, repeat, moved: None, factor: None }
    }

    #[test]
    fn transparent_texels_do_not_bleed_color() {
        for data in [
            TexelData::SrgbAlpha8(vec![[255, 255, 255, 0], [0, 255, 0, 255]]),
            TexelData::LinearAlpha8(vec![[255, 0, 0, 0], [0, 255, 0, 51]]),
            TexelData::FloatAlpha(vec![Vec4::ZERO, Vec4::new(0.0, 0.5, 0.0, 0.5)]),
        ] {
            for filter in [TextureFilter::Bilinear, TextureFilter::Mipmap] {
                let texture = row(2, data.clone(), filter);
                for u in [0.3, 0.5, 0.7, 0.9] {
                    let color = texture.lookup(&TexturePoint::from_uv(DVec2::new(u, 0.5)));
                    assert!((color - Vec3::Y).length() < 1e-6, "{data:?} {filter:?} {u}: {color}");
                }
                for level in [0.5, 1.0] {
                    let color = texture.trilinear(level, [0.2, 0.5]);
                    assert!((color - Vec3::Y).length() < 1e-6, "{data:?} {level}: {color}");
                }
                assert!((texture.mean() - Vec3::Y).length() < 1e-6);
            }
            let texture = Texture { mipmaps: None, ..row(2, data, TextureFilter::Bilinear) };
            let uv = [std::array::from_fn(|i| i as f64 / 15.0), [0.5; PACKET_SIZE]];
            let lanes = texture.lookup_packet(&uv);
            for i in 0..PACKET_SIZE {
                let alone = texture.lookup(&TexturePoint::from_uv(DVec2::new(uv[0][i], 0.5)));
                assert_eq!(lane(&lanes, i), alone, "{i}");
            }
        }
        // Partially transparent texels weight the colors by their alpha.
        let half = TexelData::LinearAlpha8(vec![[255, 0, 0, 51], [0, 255, 0, 204]]);
        let color =
            row(2, half, TextureFilter::Bilinear).lookup(&TexturePoint::from_uv(DVec2::new(0.5, 0.5)));
        assert!((color - Vec3::new(0.2, 0.8, 0.0)).length() < 1e-6, "{color}");
    }

    #[test]
    fn mip_levels_preserve_cutoff_coverage() {
        // Four of the ten texels are visible, with an alpha just above the cutoff.
        let alphas = [140, 140, 120, 0, 0, 140, 120, 0, 140, 0].map(|alpha| [alpha; 3]);
        let mut texture = row(10, TexelData::Linear8(alphas.to_vec()), TextureFilter::Mipmap);
        texture.mipmaps = levels(&texture.texels.threshold_red_channel(0.5));
        let at = |u: f64, width: f32| {
            let footprint = Footprint::from_ray_cone(width, Vec3::Z, Vec3::Z, [Vec3::X, Vec3::Y]);
            TexturePoint { footprint, ..TexturePoint::from_uv(DVec2::new(u, 0.5)) }
        };
        for u in [0.1, 0.3, 0.9] {
            let coverage = texture.coverage_above_cutoff(&at(u, 1e3), 0.5);
            assert!((coverage - 0.4).abs() < 1e-6, "{coverage}");
        }
        // In the original image, coverage is 0 or 1.
        for (u, expected) in [(0.05, 1.0), (0.25, 0.0), (0.35, 0.0), (0.55, 1.0)] {
            assert_eq!(texture.coverage_above_cutoff(&at(u, 0.0), 0.5), expected, "{u}");
        }
        // Coverage is continuous between the original image and its first mip level.
        let near =
            [1.0 + 1e-4, 1.0].map(|texels| texture.coverage_above_cutoff(&at(0.05, texels * 0.1), 0.5));
        assert!((near[0] - near[1]).abs() < 1e-2, "{near:?}");
    }
}
