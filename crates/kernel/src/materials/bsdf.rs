//! The interface of rough BSDFs: lobes that are not δ, in rows of sixteen surfaces of one kind.
//!
//! A kind is a file that implements the traits, and a line in the table of [`rough`](super::rough). No other file tells kinds
//! apart: an integrator asks a [`BsdfRow`](super::BsdfRow) for `f`, `pdf` and `sample` of all lanes at once.
//!
//! A row has the light of one side. A surface that also lets light through is two vertices, whose BSDFs are of two kinds: one is lit
//! from the viewer's side, the other from behind, with its shading normal there. Both take the same random numbers, by which
//! [`RoughRow::sample`] goes on at exactly one of them; the pdfs are those of one ray from both. Where light samples find nothing on
//! one of its sides, the vertex of the other stands for both: its paths go on by [`SideSamples`].
//!
//! A kind may have a narrow lobe beside its wide ones, whose light has rays of its own: see [`LobeSet::Narrow`].

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use super::footprint::TexturePoint;
use super::texture::Texture;
use crate::math::Vec3;
use crate::math::lanes::{F32x16, Mask, PACKET_SIZE, Simd, Vec3x16};

/// Texture coordinates, side by side.
pub type UvRow = [[f64; PACKET_SIZE]; 2];

/// Lobes that a view shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShownLobes {
    /// Lobes by their role.
    Of {
        /// The wide lobes.
        diffuse: bool,
        /// The narrow lobe.
        specular: bool,
    },
    /// Not the surface's lobes, but f = 1 in sr⁻¹ for every direction.
    Unit,
}

impl ShownLobes {
    /// All lobes.
    pub const ALL: Self = Self::Of { diffuse: true, specular: true };
}

/// Lobes from which directions are sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LobeSet {
    /// All lobes, whatever lobes are shown.
    All,
    /// The narrow lobe alone.
    Narrow,
}

/// The BSDFs of a row for one direction each.
#[derive(Clone, Debug)]
pub struct BsdfValues {
    /// f in sr⁻¹ of the shown lobes.
    pub f: Vec3x16,
    /// Two numbers for each surface that f, pdf and the parts of f share; each kind has its own.
    pub(super) shared: [F32x16; 2],
}

/// Directions in which paths go on, on either side of surfaces.
#[derive(Clone, Debug)]
pub struct SideSamples {
    /// Unit directions.
    pub directions: Vec3x16,
    /// Their pdfs in sr⁻¹; 0 if nothing arrives from there.
    pub densities: F32x16,
    /// f·cosθ of the lobe over the pdf.
    pub shares: F32x16,
    /// Factors on `shares` for what is shown.
    pub shown: F32x16,
    /// Directions on the other side than the row's own light.
    pub beyond: Mask,
}

/// Directions at a surface.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Unit shading normal on the side of the light: the viewer's, but for light that comes through the surface. It is
    /// [`turned`](RoughRow::turned).
    pub normal: Vec3,
    /// Unit direction to the viewer.
    pub to_eye: Vec3,
    /// Derivative of the position by u; zero without texture coordinates.
    pub tangent: Vec3,
}

/// Shape of a narrow lobe, as far as the choice of lights needs it: a power of the cosine about an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NarrowLobe {
    /// Unit direction of the axis.
    pub axis: Vec3,
    /// Exponent of the cosine.
    pub exponent: f32,
    /// f in sr⁻¹ at the peak, grey.
    pub peak: f32,
    /// f in sr⁻¹ of the wide lobes, grey.
    pub wide: f32,
}

impl NarrowLobe {
    /// The lobe of microfacets with this α and this reflectance, beside wide lobes. About the mirrored direction, a power of 1/2α² has
    /// the curvature of its peak.
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

/// A rough material: its textures and numbers.
pub trait RoughMaterial {
    /// The material at one point.
    type Point: RoughPoint;

    /// Looks its textures up.
    fn at(&self, at: &TexturePoint, lookups: &mut u64) -> Self::Point;

    /// The material with white in place of its textures.
    fn bleached(&self) -> Self::Point;

    /// Its constant value. `None` if it has textures.
    fn constant(&self) -> Option<Self::Point>;

    /// Its main colour.
    fn albedo(&self, at: &TexturePoint, lookups: &mut u64) -> Vec3;

    /// Reflectance of ambient light.
    fn ambient_at(&self, at: &TexturePoint, lookups: &mut u64) -> Vec3;

    /// Its textures.
    fn textures(&self) -> impl Iterator<Item = &Arc<Texture>>;

    /// Whether rows are filled with it, at most by a look-up of [`RoughMaterial::row_texture`].
    fn fills_rows(&self) -> bool;

    /// The texture that rows look up. `None` if they look up nothing.
    fn row_texture(&self) -> Option<&Texture>;

    /// Whether it depends on [`Place::tangent`].
    #[inline]
    fn has_direction(&self) -> bool {
        false
    }
}

/// A rough material at one point.
pub trait RoughPoint {
    /// Whether it reflects nothing.
    fn is_black(&self) -> bool;

    /// Reflectance of ambient light.
    fn ambient(&self) -> Vec3;

    /// The material with its colour multiplied by another one.
    fn tinted(self, color: Vec3) -> Self;
}

/// Rough surfaces of one kind, side by side. All functions run inside of loops for each instruction set.
pub trait RoughRow: Clone {
    /// The material at one point.
    type Point: RoughPoint;

    /// Whether a ray in its narrow lobe goes on where other paths end, to find what the lobe mirrors.
    const SENDS_RAYS: bool;

    /// Whether its functions are compiled into each place that calls them. Other kinds have one copy for each instruction set: a call
    /// costs them little, and copies make a large program.
    const IS_COPIED: bool = false;

    /// A row of any content.
    const EMPTY: Self;

    /// The shading normal by which its lobes are lit, given one on the side of the light, and the direction to the viewer. Lobes of
    /// microfacets turn it to the viewer, see [`facing`](super::microfacet::facing).
    #[inline(always)]
    fn turned(normal: Vec3, _to_eye: Vec3) -> Vec3 {
        normal
    }

    /// Prepares the row for other surfaces.
    fn reset(&mut self);

    /// Sets a surface.
    fn put(&mut self, i: usize, bsdf: &Self::Point, shown: ShownLobes, place: &Place);

    /// Takes a surface of another row.
    fn copy(&mut self, i: usize, other: &Self, from: usize);

    /// Evaluates the shown lobes for light from these directions.
    fn f(&self, directions: &Vec3x16) -> BsdfValues;

    /// The parts of f: of the wide lobes, and of the narrow lobes.
    fn parts(&self, directions: &Vec3x16, values: &BsdfValues) -> [Vec3x16; 2];

    /// f in sr⁻¹ of all lobes, whatever lobes are shown, by the largest components of their colours.
    fn grey(&self, values: &BsdfValues) -> F32x16;

    /// Pdfs in sr⁻¹ of directions among the samples of lobes, with these normals for the cosine.
    fn pdf(&self, lobes: LobeSet, normals: &Vec3x16, directions: &Vec3x16, values: &BsdfValues) -> F32x16;

    /// Samples a unit direction for each surface; `choices` choose the lobes and `u` the directions in them, all in [0, 1).
    fn sample(&self, lobes: LobeSet, normals: &Vec3x16, choices: &F32x16, u: &[F32x16; 2]) -> Vec3x16;

    /// Whether any surface may have a narrow lobe; without one, [`RoughRow::sample`] ignores the choices.
    fn has_narrow_lobes(&self) -> bool;

    /// Whether a surface has a narrow lobe, shown or not.
    fn has_narrow_lobe(&self, i: usize) -> bool;

    /// A bit for each surface that has a narrow lobe, shown or not.
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

    /// A bit for each surface with a narrow lobe that is at least as narrow as a cosine to this power.
    fn narrower_than(&self, of: u32, exponent: f32) -> u32;

    /// f in sr⁻¹ of the shown lobes of a surface, if it is the same for all directions.
    fn even(&self, i: usize) -> Option<Vec3>;

    /// f in sr⁻¹ of the shown lobes of a surface for light from a direction.
    fn f_at(&self, i: usize, direction: Vec3) -> Vec3;
}

/// Rows of surfaces that have this BSDF for all of their light, whatever is around them.
pub trait MaterialRow: RoughRow {
    /// The material.
    type Material: RoughMaterial<Point = Self::Point>;

    /// Sets the surfaces of some lanes to a material, looked up at these texture coordinates, or bleached without them. Each entry
    /// of `shown` replaces those before it. Returns a bit for each surface that reflects nothing.
    fn fill(
        &mut self,
        material: &Self::Material,
        uv: Option<&UvRow>,
        shown: &[(u32, ShownLobes)],
        simd: impl Simd,
    ) -> u32;

    /// Sets shading normals on the viewer's side, and directions from the viewer; in these lanes only, if any are given. All normals
    /// are replaced by those of [`RoughRow::turned`].
    fn orient(&mut self, of: Option<&Mask>, normals: &mut Vec3x16, directions: &Vec3x16);
}
