//! Non-specular ("rough") materials, which have no δ lobes, and the values that their BSDFs exchange with
//! integrators.
//!
//! To add a kind of BSDF, add a file that implements [`Bxdf`](super::bxdf::Bxdf), and a line in the table in
//! [`bxdfs`](super::bxdfs). If its parameters differ from those of all other kinds, also implement
//! [`SpatiallyVaryingBxdf`] and [`BxdfParameters`]. No other code distinguishes kinds: integrators call `f`,
//! `pdf`, and `sample` of a [`BsdfPacket`](super::BsdfPacket) for all lanes at once.

use std::f32::consts::FRAC_1_PI;

use super::lookup::ParameterLookup;
use super::texture::ColorOrTexture;
use crate::math::Vec3;
use crate::math::lanes::{F32x16, Mask, PACKET_SIZE, Vec3x16};

/// A packet of texture coordinates.
pub type UvPacket = [[f64; PACKET_SIZE]; 2];

/// The lobes that an image shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShownLobes {
    /// Lobes selected by role.
    Of {
        /// The wide lobes.
        diffuse: bool,
        /// The narrow lobe.
        specular: bool,
    },
    /// Replaces the surface's lobes with f = 1 sr⁻¹ in every direction.
    Unit,
}

impl ShownLobes {
    /// All lobes.
    pub const ALL: Self = Self::Of { diffuse: true, specular: true };
}

/// The lobes from which directions are sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LobesToSample {
    /// All lobes, whether or not they are shown.
    All,
    /// Only the narrow lobe.
    Narrow,
}

/// Values of the shown lobes of a packet of BSDFs, for one light direction per lane.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct BsdfValuePacket {
    /// f of the wide lobes in sr⁻¹.
    pub wide: Vec3x16,
    /// f of the narrow lobes in sr⁻¹.
    pub narrow: Vec3x16,
    /// The largest component of f of all lobes in sr⁻¹, whether they are shown or not.
    pub max: F32x16,
    /// [`LobeValue::shape`](super::bxdf::LobeValue::shape) of the narrow lobes.
    pub(super) shape: F32x16,
}

impl BsdfValuePacket {
    /// No light.
    pub const ZERO: Self = Self {
        wide: [[0.0; PACKET_SIZE]; 3],
        narrow: [[0.0; PACKET_SIZE]; 3],
        max: [0.0; PACKET_SIZE],
        shape: [0.0; PACKET_SIZE],
    };

    /// f of all shown lobes in sr⁻¹.
    #[inline(always)]
    pub fn f(&self) -> Vec3x16 {
        let mut f = self.wide;
        for axis in 0..3 {
            for i in 0..PACKET_SIZE {
                f[axis][i] += self.narrow[axis][i];
            }
        }
        f
    }

    /// Fractions of [`BsdfValuePacket::f`] from wide lobes, or 0 where f is 0.
    #[inline(never)]
    pub fn wide_fraction(&self) -> Vec3x16 {
        divide_lanes_or_zero(&self.wide, &self.f())
    }
}

/// Returns a/b in each lane, or 0 where b is 0.
#[inline(always)]
pub fn divide_lanes_or_zero(a: &Vec3x16, b: &Vec3x16) -> Vec3x16 {
    let mut ratio = *a;
    for axis in 0..3 {
        for i in 0..PACKET_SIZE {
            let quotient = a[axis][i] / b[axis][i];
            ratio[axis][i] = if b[axis][i] != 0.0 { quotient } else { 0.0 };
        }
    }
    ratio
}

/// Sampled directions in which paths continue, on either side of the surfaces.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct DielectricSamplePacket {
    /// Unit directions.
    pub directions: Vec3x16,
    /// Pdfs of the directions in sr⁻¹, or 0 for directions from which no light arrives.
    pub densities: F32x16,
    /// f·cosθ of the lobe divided by the pdf.
    pub shares: F32x16,
    /// Factors to apply to `shares` for the shown lobes.
    pub shown: F32x16,
    /// Mask of the directions on the side opposite the packet's light.
    pub beyond: Mask,
}

/// Shape of a narrow lobe for light selection, approximated as a power of a cosine around an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NarrowLobe {
    /// Unit direction of the axis.
    pub axis: Vec3,
    /// Exponent of the cosine.
    pub exponent: f32,
    /// f at the peak in sr⁻¹, reduced to one channel.
    pub peak: f32,
    /// f of the wide lobes in sr⁻¹, reduced to one channel.
    pub wide: f32,
}

impl NarrowLobe {
    /// Approximates a microfacet lobe with the given α and reflectance, in addition to wide lobes. An
    /// exponent of 1/2α² matches the curvature of the peak in the mirror direction.
    #[inline(always)]
    pub(super) fn from_microfacets(
        normal: Vec3,
        to_eye: Vec3,
        alpha: f32,
        reflectance: f32,
        wide: f32,
    ) -> Self {
        let squared = alpha * alpha;
        Self {
            axis: normal * (2.0 * normal.dot(to_eye)) - to_eye,
            exponent: 0.5 / squared,
            peak: reflectance * 0.25 * FRAC_1_PI / squared,
            wide,
        }
    }
}

/// A non-specular material with textures and parameters.
pub trait SpatiallyVaryingBxdf {
    /// The material at a single point.
    type Point: BxdfParameters;

    /// Looks up all parameters. Parameters that do not affect the result need not be looked up.
    fn look_up_parameters<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> Self::Point;

    /// The material's main color.
    fn main_color<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> Vec3;

    /// Reflectance for ambient light.
    fn look_up_ambient_reflectance<'m>(&'m self, _lookup: &mut impl ParameterLookup<'m>) -> Vec3 {
        Vec3::ZERO
    }

    /// The color that can be looked up for packets and set with
    /// [`Bxdf::set_looked_up_color`](super::bxdf::Bxdf::set_looked_up_color), or `None` if there is no such
    /// color.
    fn color_to_look_up(&self) -> Option<&ColorOrTexture> {
        None
    }

    /// Whether the material depends on [`ShadingGeometry::tangent`](super::bxdf::ShadingGeometry::tangent).
    #[inline]
    fn is_anisotropic(&self) -> bool {
        false
    }

    /// Whether the material may scatter light to the other side.
    fn is_transmissive(&self) -> bool {
        false
    }
}

/// A non-specular material at a single point.
pub trait BxdfParameters {
    /// Whether the surface reflects nothing.
    fn is_black(&self) -> bool;

    /// Reflectance for ambient light.
    fn ambient_reflectance(&self) -> Vec3;

    /// The material with its color multiplied by `color`.
    fn tinted(self, color: Vec3) -> Self;

    /// Reflectances of the wide and the narrow lobes for light that a coat reflects back down. 0 neglects
    /// this light.
    #[inline(always)]
    fn interreflection_reflectances(&self) -> [Vec3; 2] {
        [Vec3::ZERO; 2]
    }
}
