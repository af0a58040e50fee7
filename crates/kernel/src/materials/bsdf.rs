//! The interface of non-specular ("rough") BSDFs, which have no δ lobes. They are evaluated in packets of 16
//! surfaces of the same kind.
//!
//! To add a kind of BSDF, add a file that implements these traits, and a line in the table in
//! [`rough`](super::rough). No other code distinguishes kinds: integrators call `f`, `pdf`, and `sample` of a
//! [`BsdfRow`](super::BsdfRow) for all lanes at once.
//!
//! A packet receives light from one side. A surface that also transmits light is represented by two vertices
//! with BSDFs of different kinds. One is lit from the viewer's side, and the other from behind, with its
//! shading normal on that side. Both vertices use the same random numbers, so [`RoughRow::sample`] continues
//! the path at exactly one of them. The pdfs include the directions on both sides. If light sampling is
//! impossible on one side, the vertex of the other side represents both, and its paths continue with
//! [`SideSamples`].
//!
//! In addition to wide lobes, a kind may have a narrow lobe that is sampled with separate rays, see
//! [`LobeSet::Narrow`].

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use super::footprint::TexturePoint;
use super::texture::Texture;
use crate::math::Vec3;
use crate::math::lanes::{F32x16, Mask, PACKET_SIZE, Simd, Vec3x16};

/// A packet of texture coordinates.
pub type UvRow = [[f64; PACKET_SIZE]; 2];

/// The lobes that contribute to an image.
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
pub enum LobeSet {
    /// All lobes, whether or not they are shown.
    All,
    /// Only the narrow lobe.
    Narrow,
}

/// BSDF values of a packet, for one direction per lane.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct BsdfValues {
    /// f of the shown lobes in sr⁻¹.
    pub f: Vec3x16,
    /// Two intermediate values per surface that f, the pdf, and the parts of f share. Their meaning depends
    /// on the kind.
    pub(super) shared: [F32x16; 2],
}

/// Sampled directions for continuing paths, on either side of the surfaces.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct SideSamples {
    /// Unit directions.
    pub directions: Vec3x16,
    /// Pdfs of the directions in sr⁻¹. 0 if no light arrives from there.
    pub densities: F32x16,
    /// f·cosθ of the lobe divided by the pdf.
    pub shares: F32x16,
    /// Factors to be applied to `shares` for the shown lobes.
    pub shown: F32x16,
    /// Mask of directions on the opposite side from the packet's light.
    pub beyond: Mask,
}

/// Directions at a surface.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceDirections {
    /// Unit shading normal on the lit side, rotated by [`RoughRow::normal_facing_viewer`]. Except for
    /// transmitted light, this is the side of the viewer.
    pub normal: Vec3,
    /// Unit direction to the viewer.
    pub to_eye: Vec3,
    /// ∂p/∂u, or zero without texture coordinates.
    pub tangent: Vec3,
}

/// Shape of a narrow lobe for light selection, as a power of the cosine around an axis.
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
    /// A microfacet lobe with the given α and reflectance, in addition to wide lobes. Around the mirror
    /// direction, an exponent of 1/2α² matches the curvature of the peak.
    #[inline(always)]
    pub(super) fn of_microfacets(
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
pub trait RoughMaterial {
    /// The material at one point.
    type Point: RoughPoint;

    /// The material at one point, with its textures looked up. Counts texture lookups in `lookups`.
    fn at(&self, at: &TexturePoint, lookups: &mut u64) -> Self::Point;

    /// The material with all textures replaced by white.
    fn with_white_textures(&self) -> Self::Point;

    /// The material's values if it has no textures.
    fn constant(&self) -> Option<Self::Point>;

    /// The material's main color. Counts texture lookups in `lookups`.
    fn albedo(&self, at: &TexturePoint, lookups: &mut u64) -> Vec3;

    /// Reflectance of ambient light.
    fn ambient_at(&self, at: &TexturePoint, lookups: &mut u64) -> Vec3;

    /// All textures of the material.
    fn textures(&self) -> impl Iterator<Item = &Arc<Texture>>;

    /// Whether packets can be filled with the material, with at most a lookup of
    /// [`RoughMaterial::row_texture`].
    fn supports_packets(&self) -> bool;

    /// The texture that packets look up, if any.
    fn row_texture(&self) -> Option<&Texture>;

    /// Whether the material depends on [`SurfaceDirections::tangent`].
    #[inline]
    fn has_direction(&self) -> bool {
        false
    }
}

/// A non-specular material at one point.
pub trait RoughPoint {
    /// Whether the surface reflects nothing.
    fn is_black(&self) -> bool;

    /// Reflectance of ambient light.
    fn ambient(&self) -> Vec3;

    /// The material with its color multiplied by `color`.
    fn tinted(self, color: Vec3) -> Self;
}

/// A packet of non-specular surfaces of one kind. All functions must be called inside a SIMD kernel.
pub trait RoughRow: Clone {
    /// The material at one point.
    type Point: RoughPoint;

    /// Whether rays in the narrow lobe continue beyond the point where other paths end, to show reflections.
    const SENDS_RAYS: bool;

    /// Whether functions are inlined into every caller. Other kinds have one copy per instruction set,
    /// because calls cost little compared with their work, and additional copies would bloat the program.
    const IS_COPIED: bool = false;

    /// A packet with unspecified contents.
    const EMPTY: Self;

    /// The shading normal for the lobes, given a normal on the lit side and the direction to the viewer.
    /// Microfacet lobes rotate it to face the viewer, see
    /// [`rotate_toward_viewer`](super::microfacet::rotate_toward_viewer).
    #[inline(always)]
    fn normal_facing_viewer(normal: Vec3, _to_eye: Vec3) -> Vec3 {
        normal
    }

    /// Prepares the packet for reuse with other surfaces.
    fn reset(&mut self);

    /// Sets a surface.
    fn put(&mut self, i: usize, bsdf: &Self::Point, shown: ShownLobes, place: &SurfaceDirections);

    /// Copies a surface from another packet.
    fn copy(&mut self, i: usize, other: &Self, from: usize);

    /// Evaluates the shown lobes for the given light directions.
    fn f(&self, directions: &Vec3x16) -> BsdfValues;

    /// The contributions of the wide and the narrow lobes to f.
    fn wide_and_narrow(&self, directions: &Vec3x16, values: &BsdfValues) -> [Vec3x16; 2];

    /// f of all lobes in sr⁻¹, whether they are shown or not. Uses the largest color components.
    fn max_component(&self, values: &BsdfValues) -> F32x16;

    /// Pdfs in sr⁻¹ of directions sampled from the given lobes. Cosine lobes use `normals`.
    fn pdf(&self, lobes: LobeSet, normals: &Vec3x16, directions: &Vec3x16, values: &BsdfValues) -> F32x16;

    /// Samples a unit direction for each surface. `choices` selects the lobes, and `u` the directions within
    /// them. All random numbers are in [0, 1).
    fn sample(&self, lobes: LobeSet, normals: &Vec3x16, choices: &F32x16, u: &[F32x16; 2]) -> Vec3x16;

    /// Whether any surface may have a narrow lobe. If not, [`RoughRow::sample`] ignores `choices`.
    fn has_narrow_lobes(&self) -> bool;

    /// Whether a surface has a narrow lobe, even if it is not shown.
    fn has_narrow_lobe(&self, i: usize) -> bool;

    /// Mask of surfaces that have a narrow lobe, even if it is not shown.
    #[inline(always)]
    fn narrow_lobes(&self) -> u32 {
        let mut narrow = 0;
        for i in 0..PACKET_SIZE {
            narrow |= u32::from(self.has_narrow_lobe(i)) << i;
        }
        narrow
    }

    /// The narrow lobe of a surface, if it has one.
    fn narrow_lobe(&self, i: usize) -> Option<NarrowLobe>;

    /// Mask of the surfaces in `of` with a narrow lobe that is at least as narrow as a cosine to the given
    /// power.
    fn narrower_than(&self, of: u32, exponent: f32) -> u32;

    /// f of a surface's shown lobes in sr⁻¹, if it is constant over all directions.
    fn constant_f(&self, i: usize) -> Option<Vec3>;

    /// f of a surface's shown lobes in sr⁻¹ for light from a direction.
    fn f_at(&self, i: usize, direction: Vec3) -> Vec3;
}

/// A packet of a kind that is an entire material. The surfaces have this BSDF for light from either side,
/// regardless of their surroundings.
pub trait MaterialRow: RoughRow {
    /// The material.
    type Material: RoughMaterial<Point = Self::Point>;

    /// Sets the surfaces of some lanes to a material. Textures are looked up at `uv`, or replaced with white
    /// if there is no `uv`. Later entries of `shown` override earlier ones. Returns a mask of surfaces that
    /// reflect nothing.
    fn fill(
        &mut self,
        material: &Self::Material,
        uv: Option<&UvRow>,
        shown: &[(u32, ShownLobes)],
        simd: impl Simd,
    ) -> u32;

    /// Sets the shading normals on the viewer's side and the incoming ray directions of the lanes in `of`, or
    /// of all lanes. Replaces `normals` with the results of [`RoughRow::normal_facing_viewer`].
    fn orient(&mut self, of: Option<&Mask>, normals: &mut Vec3x16, directions: &Vec3x16);
}
