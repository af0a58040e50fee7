//! Image texels, stored as compactly as they were in the file.

use crate::math::color::{SRGB8_TO_LINEAR, srgb8_color_to_linear};
use crate::math::lanes::{PACKET_SIZE, Vec3x16, set_lane};
use crate::math::{DVec3, DVec4, Vec3, Vec4};

/// An RGB image in memory. Rows are stored from top to bottom.
#[derive(Clone, Debug, PartialEq)]
pub struct Texels {
    /// Number of columns. At least 1.
    pub width: u32,
    /// Number of rows. At least 1.
    pub height: u32,
    /// The `width · height` texels.
    pub data: TexelData,
    /// Number of texels that were negative or not finite in the file. They are stored as 0.
    pub unusable: u64,
}

/// Storage format of texels.
#[derive(Clone, Debug, PartialEq)]
pub enum TexelData {
    /// sRGB bytes that are decoded in each lookup.
    Srgb8(Vec<[u8; 3]>),
    /// Linear bytes, scaled by 1/255.
    Linear8(Vec<[u8; 3]>),
    /// Linear floats from 16-bit and floating-point files.
    Float(Vec<Vec3>),
    /// sRGB bytes and alpha. Interpolation weights colors by alpha.
    SrgbAlpha8(Vec<[u8; 4]>),
    /// Linear bytes and alpha.
    LinearAlpha8(Vec<[u8; 4]>),
    /// Linear floats premultiplied by alpha, and alpha.
    FloatAlpha(Vec<Vec4>),
}

impl Texels {
    /// Linear value at column `x` and row `y` from the top, which must be in range.
    #[inline]
    pub fn get(&self, x: u32, y: u32) -> Vec3 {
        self.linear_color_at_index(y as usize * self.width as usize + x as usize)
    }

    /// Linear value at a texel index.
    #[inline]
    pub fn linear_color_at_index(&self, place: usize) -> Vec3 {
        match &self.data {
            TexelData::Srgb8(bytes) => srgb8_color_to_linear(bytes[place]),
            TexelData::Linear8(bytes) => unit_color_from_bytes(bytes[place]),
            TexelData::Float(floats) => floats[place],
            TexelData::SrgbAlpha8(_) | TexelData::LinearAlpha8(_) | TexelData::FloatAlpha(_) => {
                self.unpremultiplied_color(place)
            }
        }
    }

    /// Whether the texels have an alpha channel. If so, colors are weighted by alpha.
    #[inline(always)]
    pub fn has_alpha(&self) -> bool {
        match &self.data {
            TexelData::Srgb8(_) | TexelData::Linear8(_) | TexelData::Float(_) => false,
            TexelData::SrgbAlpha8(_) | TexelData::LinearAlpha8(_) | TexelData::FloatAlpha(_) => true,
        }
    }

    /// Linear color at a texel index, not premultiplied by alpha.
    #[cold]
    fn unpremultiplied_color(&self, place: usize) -> Vec3 {
        match &self.data {
            TexelData::SrgbAlpha8(bytes) => {
                let [red, green, blue, _] = bytes[place];
                srgb8_color_to_linear([red, green, blue])
            }
            TexelData::LinearAlpha8(bytes) => {
                let [red, green, blue, _] = bytes[place];
                unit_color_from_bytes([red, green, blue])
            }
            TexelData::FloatAlpha(floats) => unpremultiply(floats[place]),
            TexelData::Srgb8(_) | TexelData::Linear8(_) | TexelData::Float(_) => {
                self.linear_color_at_index(place)
            }
        }
    }

    /// Linear color premultiplied by alpha, and alpha, at a texel index.
    pub fn premultiplied_texel(&self, place: usize) -> Vec4 {
        let weight = match &self.data {
            TexelData::Srgb8(_) | TexelData::Linear8(_) | TexelData::Float(_) => 1.0,
            TexelData::SrgbAlpha8(bytes) | TexelData::LinearAlpha8(bytes) => {
                f32::from(bytes[place][3]) / 255.0
            }
            TexelData::FloatAlpha(floats) => return floats[place],
        };
        (self.linear_color_at_index(place) * weight).extend(weight)
    }

    /// Applies a threshold to the red channel. The result is 1 where the channel is at least `least`,
    /// otherwise 0.
    pub fn threshold_red_channel(&self, least: f32) -> Self {
        let texel =
            |place: usize| [if self.linear_color_at_index(place).x >= least { u8::MAX } else { 0 }; 3];
        let data = TexelData::Linear8((0..self.len()).map(texel).collect());
        Self { data, unusable: 0, ..*self }
    }

    /// Linear values at several texel indices.
    #[inline(always)]
    pub fn linear_colors_at_indices<const N: usize>(&self, places: &[usize; N]) -> [Vec3; N] {
        let mut values = [Vec3::ZERO; N];
        self.for_each_color_at_indices(places, |i, value| values[i] = value);
        values
    }

    /// Writes the linear values at packets of texel indices to `values`. They are not returned, because
    /// compilers handle large return values poorly.
    #[inline(always)]
    pub fn read_color_packets_into(&self, places: &[[usize; PACKET_SIZE]], values: &mut [Vec3x16]) {
        for (places, values) in places.iter().zip(values) {
            self.for_each_color_at_indices(places, |i, value| set_lane(values, i, value));
        }
    }

    /// Passes the linear value at each texel index to `put`.
    #[inline(always)]
    fn for_each_color_at_indices<const N: usize>(
        &self,
        places: &[usize; N],
        mut put: impl FnMut(usize, Vec3),
    ) {
        match &self.data {
            TexelData::Srgb8(bytes) => {
                let table = &*SRGB8_TO_LINEAR;
                for i in 0..N {
                    let [r, g, b] = bytes[places[i]];
                    let decoded = |byte: u8| table[usize::from(byte)];
                    put(i, Vec3::new(decoded(r), decoded(g), decoded(b)));
                }
            }
            TexelData::Linear8(bytes) => {
                for i in 0..N {
                    put(i, unit_color_from_bytes(bytes[places[i]]));
                }
            }
            TexelData::Float(floats) => {
                for i in 0..N {
                    put(i, floats[places[i]]);
                }
            }
            TexelData::SrgbAlpha8(_) | TexelData::LinearAlpha8(_) | TexelData::FloatAlpha(_) => {
                for i in 0..N {
                    put(i, self.unpremultiplied_color(places[i]));
                }
            }
        }
    }

    /// Linear values of all texels.
    pub fn into_linear_colors(self) -> Vec<Vec3> {
        if self.has_alpha() {
            return (0..self.len()).map(|place| self.linear_color_at_index(place)).collect();
        }
        match self.data {
            TexelData::Srgb8(bytes) => bytes.into_iter().map(srgb8_color_to_linear).collect(),
            TexelData::Linear8(bytes) => bytes.into_iter().map(unit_color_from_bytes).collect(),
            TexelData::Float(floats) => floats,
            TexelData::SrgbAlpha8(_) | TexelData::LinearAlpha8(_) | TexelData::FloatAlpha(_) => Vec::new(),
        }
    }

    /// Mean of all texels, weighted by alpha if there is an alpha channel.
    pub fn mean(&self) -> Vec3 {
        if self.has_alpha() {
            let sum: DVec4 = (0..self.len()).map(|place| self.premultiplied_texel(place).as_dvec4()).sum();
            return unpremultiply((sum / self.len() as f64).as_vec4());
        }
        self.mean_of_function(|texel| texel)
    }

    /// Mean of a function of the texels.
    pub fn mean_of_function(&self, function: impl Fn(Vec3) -> Vec3) -> Vec3 {
        let places = (0..self.height).flat_map(|y| (0..self.width).map(move |x| (x, y)));
        let sum: DVec3 = places.map(|(x, y)| function(self.get(x, y)).as_dvec3()).sum();
        (sum / self.len() as f64).as_vec3()
    }

    /// Whether all texels are 0.
    pub fn is_black(&self) -> bool {
        match &self.data {
            TexelData::Srgb8(bytes) | TexelData::Linear8(bytes) => bytes.iter().all(|texel| *texel == [0; 3]),
            TexelData::Float(floats) => floats.iter().all(|texel| *texel == Vec3::ZERO),
            TexelData::SrgbAlpha8(bytes) | TexelData::LinearAlpha8(bytes) => {
                bytes.iter().all(|[r, g, b, _]| [*r, *g, *b] == [0; 3])
            }
            TexelData::FloatAlpha(floats) => floats.iter().all(|texel| texel.truncate() == Vec3::ZERO),
        }
    }

    /// Whether red, green, and blue are equal in all texels.
    pub fn are_all_gray(&self) -> bool {
        match &self.data {
            TexelData::Srgb8(bytes) | TexelData::Linear8(bytes) => {
                bytes.iter().all(|[r, g, b]| r == g && g == b)
            }
            TexelData::Float(floats) => floats.iter().all(|texel| texel.x == texel.y && texel.y == texel.z),
            TexelData::SrgbAlpha8(bytes) | TexelData::LinearAlpha8(bytes) => {
                bytes.iter().all(|[r, g, b, _]| r == g && g == b)
            }
            TexelData::FloatAlpha(floats) => {
                floats.iter().all(|texel| texel.x == texel.y && texel.y == texel.z)
            }
        }
    }

    /// Whether all texels are 1.
    pub fn is_white(&self) -> bool {
        match &self.data {
            TexelData::Srgb8(bytes) | TexelData::Linear8(bytes) => {
                bytes.iter().all(|texel| *texel == [255; 3])
            }
            TexelData::Float(floats) => floats.iter().all(|texel| *texel == Vec3::ONE),
            TexelData::SrgbAlpha8(bytes) | TexelData::LinearAlpha8(bytes) => {
                bytes.iter().all(|[r, g, b, _]| [*r, *g, *b] == [255; 3])
            }
            TexelData::FloatAlpha(floats) => floats.iter().all(|texel| *texel == Vec4::splat(texel.w)),
        }
    }

    /// Number of texels.
    pub fn len(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Always false because an image has at least one texel.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Memory used by the texels, in bytes.
    pub fn memory_bytes(&self) -> usize {
        match &self.data {
            TexelData::Srgb8(bytes) | TexelData::Linear8(bytes) => size_of_val(bytes.as_slice()),
            TexelData::Float(floats) => size_of_val(floats.as_slice()),
            TexelData::SrgbAlpha8(bytes) | TexelData::LinearAlpha8(bytes) => size_of_val(bytes.as_slice()),
            TexelData::FloatAlpha(floats) => size_of_val(floats.as_slice()),
        }
    }
}

/// Divides a premultiplied color by its alpha. Returns black if alpha is 0.
pub fn unpremultiply(weighted: Vec4) -> Vec3 {
    if weighted.w > 0.0 { weighted.truncate() / weighted.w } else { Vec3::ZERO }
}

#[inline(always)]
fn unit_color_from_bytes(bytes: [u8; 3]) -> Vec3 {
    Vec3::from_array(bytes.map(|byte| f32::from(byte) / 255.0))
}
