//! The interface of non-specular BSDFs ("rough": all lobes except δ lobes), in packets of 16 surfaces of one kind.
//!
//! A kind is a file that implements these traits, plus a line in the table of [`rough`](super::rough). No other file
//! distinguishes kinds: an integrator calls `f`, `pdf` and `sample` of a [`BsdfRow`](super::BsdfRow) for all lanes at once.
//!
//! A packet receives light from one side. A surface that also transmits light is two vertices with BSDFs of different kinds: one
//! is lit from the viewer's side, the other from behind, with its shading normal there. Both use the same random numbers, with
//! which [`RoughRow::sample`] continues at exactly one of them; the pdfs treat both as one ray. Where light
//! sampling finds nothing on one side, the vertex of the other side represents both, and its paths continue with [`SideSamples`].
//!
//! A kind may have a narrow lobe in addition to its wide ones, which is sampled with separate rays: see [`LobeSet::Narrow`].

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use super::footprint::TexturePoint;
use super::texture::Texture;
use crate::math::Vec3;
use crate::math::lanes::{F32x16, Mask, PACKET_SIZE, Simd, Vec3x16};

/// A packet of texture coordinates.
pub type UvRow = [[f64; PACKET_SIZE]; 2];

/// The lobes included in a view.
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
    /// All lobes, regardless of which are shown.
    All,
    /// Only the narrow lobe.
    Narrow,
}

/// BSDF values of a packet, for one direction per lane.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct BsdfValues {
    /// f in sr⁻¹ of the shown lobes.
    pub f: Vec3x16,
    /// Two numbers per surface shared by f, pdf and the parts of f; their meaning depends on the kind.
    pub(super) shared: [F32x16; 2],
}

/// Sampled directions in which paths continue, on either side of the surfaces.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct SideSamples {
    /// Unit directions.
    pub directions: Vec3x16,
    /// Their pdfs in sr⁻¹; 0 if no light arrives from there.
    pub densities: F32x16,
    /// f·cosθ of the lobe divided by the pdf.
    pub shares: F32x16,
    /// Factors on `shares` for the shown lobes.
    pub shown: F32x16,
    /// Mask of directions on the side opposite to the packet's light.
    pub beyond: Mask,
}

/// Directions at a surface.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Unit shading normal on the side of the light, adjusted by [`turned`](RoughRow::turned). This is the viewer's side, except
    /// for transmitted light.
    pub normal: Vec3,
    /// Unit direction to the viewer.
    pub to_eye: Vec3,
    /// ∂p/∂u; zero without texture coordinates.
    pub tangent: Vec3,
}

/// Shape of a narrow lobe for light selection: a power of the cosine around an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NarrowLobe {
    /// Unit direction of the axis.
    pub axis: Vec3,
    /// Exponent of the cosine.
    pub exponent: f32,
    /// f in sr⁻¹ at the peak, reduced to one channel.
    pub peak: f32,
    /// f in sr⁻¹ of the wide lobes, reduced to one channel.
    pub wide: f32,
}

impl NarrowLobe {
    /// A microfacet lobe with this α and reflectance, in addition to wide lobes. Around the mirror direction, an exponent of
    /// 1/2α² matches the curvature of its peak.
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

/// A non-specular material: its textures and parameters.
pub trait RoughMaterial {
    /// The material at one point.
    type Point: RoughPoint;

    /// Looks up its textures.
    fn at(&self, at: &TexturePoint, lookups: &mut u64) -> Self::Point;

    /// The material with white textures.
    fn with_white_textures(&self) -> Self::Point;

    /// The material, if it has no textures.
    fn constant(&self) -> Option<Self::Point>;

    /// Its main color. Adds to `lookups`.
    fn albedo(&self, at: &TexturePoint, lookups: &mut u64) -> Vec3;

    /// Reflectance of ambient light.
    fn ambient_at(&self, at: &TexturePoint, lookups: &mut u64) -> Vec3;

    /// Its textures.
    fn textures(&self) -> impl Iterator<Item = &Arc<Texture>>;

    /// Whether packets can be filled with it, with at most a lookup of [`RoughMaterial::row_texture`].
    fn fills_rows(&self) -> bool;

    /// The texture that packets look up. `None` if they look up nothing.
    fn row_texture(&self) -> Option<&Texture>;

    /// Whether it depends on [`Place::tangent`].
    #[inline]
    fn has_direction(&self) -> bool {
        false
    }
}

/// A non-specular material at one point.
pub trait RoughPoint {
    /// Whether it reflects nothing.
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

    /// Whether a ray in its narrow lobe continues where other paths end, to find what the lobe reflects.
    const SENDS_RAYS: bool;

    /// Whether its functions are inlined into every caller. Other kinds have one copy per instruction set: calls cost them
    /// little, and more copies would bloat the program.
    const IS_COPIED: bool = false;

    /// A packet with arbitrary contents.
    const EMPTY: Self;

    /// The shading normal used by its lobes, given one on the side of the light and the direction to the viewer. Microfacet lobes
    /// rotate it to face the viewer; see [`facing`](super::microfacet::facing).
    #[inline(always)]
    fn turned(normal: Vec3, _to_eye: Vec3) -> Vec3 {
        normal
    }

    /// Prepares the packet for other surfaces.
    fn reset(&mut self);

    /// Sets a surface.
    fn put(&mut self, i: usize, bsdf: &Self::Point, shown: ShownLobes, place: &Place);

    /// Copies a surface of another packet.
    fn copy(&mut self, i: usize, other: &Self, from: usize);

    /// Evaluates the shown lobes for light from these directions.
    fn f(&self, directions: &Vec3x16) -> BsdfValues;

    /// The parts of f from the wide and from the narrow lobes.
    fn parts(&self, directions: &Vec3x16, values: &BsdfValues) -> [Vec3x16; 2];

    /// f in sr⁻¹ of all lobes, regardless of which are shown, from the largest color components.
    fn max_component(&self, values: &BsdfValues) -> F32x16;

    /// Pdfs in sr⁻¹ of directions sampled from these lobes; `normals` are used for cosine lobes.
    fn pdf(&self, lobes: LobeSet, normals: &Vec3x16, directions: &Vec3x16, values: &BsdfValues) -> F32x16;

    /// Samples a unit direction for each surface; `choices` selects the lobes and `u` the directions within them, all in [0, 1).
    fn sample(&self, lobes: LobeSet, normals: &Vec3x16, choices: &F32x16, u: &[F32x16; 2]) -> Vec3x16;

    /// Whether any surface may have a narrow lobe; without one, [`RoughRow::sample`] ignores the choices.
    fn has_narrow_lobes(&self) -> bool;

    /// Whether a surface has a narrow lobe, shown or not.
    fn has_narrow_lobe(&self, i: usize) -> bool;

    /// Mask of surfaces that have a narrow lobe, shown or not.
    #[inline(always)]
    fn narrow_lobes(&self) -> u32 {
        let mut narrow = 0;
        for i in 0..PACKET_SIZE {
            narrow |= u32::from(self.has_narrow_lobe(i)) << i;
        }
        narrow
    }

    /// The narrow lobe of a surface. `None` if it has none.
    fn narrow_lobe(&self, i: usize) -> Option<NarrowLobe>;

    /// Mask of the surfaces in `of` whose narrow lobe is at least as narrow as a cosine to this power.
    fn narrower_than(&self, of: u32, exponent: f32) -> u32;

    /// f in sr⁻¹ of the shown lobes of a surface, if it is constant over all directions.
    fn constant_f(&self, i: usize) -> Option<Vec3>;

    /// f in sr⁻¹ of the shown lobes of a surface for light from a direction.
    fn f_at(&self, i: usize, direction: Vec3) -> Vec3;
}

/// Packets of surfaces that have this BSDF for all of their light, regardless of their surroundings.
pub trait MaterialRow: RoughRow {
    /// The material.
    type Material: RoughMaterial<Point = Self::Point>;

    /// Sets the surfaces of some lanes to a material, with textures looked up at `uv`, or white without `uv`. Later entries of
    /// `shown` override earlier ones. Returns a mask of surfaces that reflect nothing.
    fn fill(
        &mut self,
        material: &Self::Material,
        uv: Option<&UvRow>,
        shown: &[(u32, ShownLobes)],
        simd: impl Simd,
    ) -> u32;

    /// Sets shading normals on the viewer's side and incoming ray directions, for the lanes in `of` or for all. Replaces all
    /// normals by those of [`RoughRow::turned`].
    fn orient(&mut self, of: Option<&Mask>, normals: &mut Vec3x16, directions: &Vec3x16);
}
