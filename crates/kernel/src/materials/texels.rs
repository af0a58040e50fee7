//! Texels of an image, stored as compactly as in its file.

use crate::math::color::{LINEAR_OF_SRGB8, srgb8_to_linear};
use crate::math::lanes::{LANES, Lanes3, set_lane};
use crate::math::{DVec3, Vec3};

/// An image in memory, rows from top to bottom, RGB.
#[derive(Clone, Debug, PartialEq)]
pub struct Texels {
    /// Columns, ≥ 1.
    pub width: u32,
    /// Rows, ≥ 1.
    pub height: u32,
    /// `width·height` texels.
    pub data: TexelData,
    /// Number of texels that were negative or not finite in the file, and are 0 here.
    pub unusable: u64,
}

/// Storage of texels.
#[derive(Clone, Debug, PartialEq)]
pub enum TexelData {
    /// sRGB bytes, decoded at each look-up.
    Srgb8(Vec<[u8; 3]>),
    /// Bytes / 255, linear.
    Linear8(Vec<[u8; 3]>),
    /// Linear floats: 16-bit and float files.
    Float(Vec<Vec3>),
}

impl Texels {
    /// Linear value of column `x`, row `y` from the top; both in range.
    #[inline]
    pub fn get(&self, x: u32, y: u32) -> Vec3 {
        self.at(y as usize * self.width as usize + x as usize)
    }

    /// Linear value at an index of the data.
    #[inline]
    pub fn at(&self, place: usize) -> Vec3 {
        match &self.data {
            TexelData::Srgb8(bytes) => srgb8_to_linear(bytes[place]),
            TexelData::Linear8(bytes) => of_linear(bytes[place]),
            TexelData::Float(floats) => floats[place],
        }
    }

    /// Linear values at some indices of the data.
    #[inline(always)]
    pub fn at_each<const N: usize>(&self, places: &[usize; N]) -> [Vec3; N] {
        let mut values = [Vec3::ZERO; N];
        self.decode(places, |i, value| values[i] = value);
        values
    }

    /// Linear values at indices of the data, side by side. Written in place: rows are larger than compilers like to
    /// return.
    #[inline(always)]
    pub fn fill_row(&self, places: &[usize; LANES], values: &mut Lanes3) {
        self.decode(places, |i, value| set_lane(values, i, value));
    }

    /// Gives the linear value at each index of the data.
    #[inline(always)]
    fn decode<const N: usize>(&self, places: &[usize; N], mut put: impl FnMut(usize, Vec3)) {
        match &self.data {
            TexelData::Srgb8(bytes) => {
                let table = &*LINEAR_OF_SRGB8;
                for i in 0..N {
                    let [r, g, b] = bytes[places[i]];
                    let decoded = |byte: u8| table[usize::from(byte)];
                    put(i, Vec3::new(decoded(r), decoded(g), decoded(b)));
                }
            }
            TexelData::Linear8(bytes) => {
                for i in 0..N {
                    put(i, of_linear(bytes[places[i]]));
                }
            }
            TexelData::Float(floats) => {
                for i in 0..N {
                    put(i, floats[places[i]]);
                }
            }
        }
    }

    /// Linear values of all texels.
    pub fn into_linear(self) -> Vec<Vec3> {
        match self.data {
            TexelData::Srgb8(bytes) => bytes.into_iter().map(srgb8_to_linear).collect(),
            TexelData::Linear8(bytes) => bytes.into_iter().map(of_linear).collect(),
            TexelData::Float(floats) => floats,
        }
    }

    /// Mean of all texels.
    pub fn mean(&self) -> Vec3 {
        let rows = (0..self.height).flat_map(|y| (0..self.width).map(move |x| (x, y)));
        let sum: DVec3 = rows.map(|(x, y)| self.get(x, y).as_dvec3()).sum();
        (sum / self.len() as f64).as_vec3()
    }

    /// Whether all texels are 0.
    pub fn is_black(&self) -> bool {
        match &self.data {
            TexelData::Srgb8(bytes) | TexelData::Linear8(bytes) => bytes.iter().all(|texel| *texel == [0; 3]),
            TexelData::Float(floats) => floats.iter().all(|texel| *texel == Vec3::ZERO),
        }
    }

    /// Whether red, green and blue are equal in all texels.
    pub fn is_grey(&self) -> bool {
        match &self.data {
            TexelData::Srgb8(bytes) | TexelData::Linear8(bytes) => {
                bytes.iter().all(|[r, g, b]| r == g && g == b)
            }
            TexelData::Float(floats) => floats.iter().all(|texel| texel.x == texel.y && texel.y == texel.z),
        }
    }

    /// Whether all texels are 1.
    pub fn is_white(&self) -> bool {
        match &self.data {
            TexelData::Srgb8(bytes) | TexelData::Linear8(bytes) => {
                bytes.iter().all(|texel| *texel == [255; 3])
            }
            TexelData::Float(floats) => floats.iter().all(|texel| *texel == Vec3::ONE),
        }
    }

    /// Number of texels.
    pub fn len(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Never: an image has at least one texel.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes that the texels take.
    pub fn memory_bytes(&self) -> usize {
        match &self.data {
            TexelData::Srgb8(bytes) | TexelData::Linear8(bytes) => size_of_val(bytes.as_slice()),
            TexelData::Float(floats) => size_of_val(floats.as_slice()),
        }
    }
}

#[inline(always)]
fn of_linear(bytes: [u8; 3]) -> Vec3 {
    Vec3::from_array(bytes.map(|byte| f32::from(byte) / 255.0))
}
