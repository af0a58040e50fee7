//! The interface of non-specular BSDFs. Each one is written once, for a single point and direction; packets
//! ([`BxdfPacket`](super::bxdf_packet::BxdfPacket)) evaluate it lane by lane, in loops that compile to vector
//! instructions. All functions must therefore be branch-free and `#[inline(always)]`, and must not call
//! closures.
//!
//! A BSDF is the sum of wide lobes, which are sampled like a diffuse surface, and narrow lobes, for which
//! light samples are inefficient. It receives light from one side. A surface that also transmits light is
//! represented by two vertices with BSDFs of different kinds. One is lit from the viewer's side, and the
//! other from behind, with its shading normal on that side. Both vertices use the same random numbers, so
//! [`Bxdf::sample`] continues the path at exactly one of them. The pdfs include the directions on both
//! sides.

use super::bsdf::{BxdfParameters, LobesToSample, NarrowLobe};
use crate::math::Vec3;
use crate::math::soa::Soa;

/// Properties of a BSDF, or properties that at least one BSDF in a packet has. The bits from
/// [`BxdfFlags::FIRST_OWN`] up belong to the kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BxdfFlags(pub u32);

impl BxdfFlags {
    /// Has wide lobes.
    pub const WIDE: Self = Self(1);

    /// Has narrow lobes.
    pub const NARROW: Self = Self(2);

    /// The first bit for properties that exist only for one kind of BSDF.
    pub const FIRST_OWN: u32 = 2;

    /// Whether all given flags are set.
    #[inline(always)]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// These flags if the condition holds, and no flags otherwise.
    #[inline(always)]
    pub const fn when(self, condition: bool) -> Self {
        Self(if condition { self.0 } else { 0 })
    }

    /// All flags that are set in either operand.
    #[inline(always)]
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// These flags without the flags in `other`.
    #[inline(always)]
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }
}

/// Value of one or more lobes for a light direction.
#[derive(Clone, Copy, Debug)]
pub struct LobeValue {
    /// f in sr⁻¹.
    pub f: Vec3,
    /// The largest component of f, computed from the largest components of colors.
    pub max: f32,
    /// An intermediate result shared by f and [`Bxdf::pdf`], such as f for a reflectance of 1.
    pub shape: f32,
}

impl LobeValue {
    /// No light.
    pub const ZERO: Self = Self { f: Vec3::ZERO, max: 0.0, shape: 0.0 };
}

/// Directions at a surface.
#[derive(Clone, Copy, Debug)]
pub struct ShadingGeometry {
    /// Unit shading normal on the lit side, rotated by [`lobe_shading_normal`]. Except for transmitted light,
    /// this is the viewer's side.
    pub normal: Vec3,
    /// Unit direction to the viewer.
    pub wo: Vec3,
    /// ∂p/∂u, or zero without texture coordinates.
    pub tangent: Vec3,
}

/// Lobes from which a direction is sampled.
#[derive(Clone, Copy, Debug)]
pub struct LobesWithNormal {
    /// The lobes.
    pub lobes: LobesToSample,
    /// The unit normal of cosine lobes.
    pub normal: Vec3,
}

/// A non-specular BSDF at a single point. Values that depend on the view direction are stored separately.
pub trait Bxdf: Soa + Default {
    /// The material's parameters at a single point.
    type Point: BxdfParameters;

    /// Values that depend on the view direction.
    type View: Soa + Default;

    /// Whether shading normals are rotated to face the viewer. See
    /// [`tilt_to_face_viewer_branchless`](super::microfacet::tilt_to_face_viewer_branchless).
    const TURNS_NORMALS: bool = true;

    /// Whether the BSDF is for light from behind the surface.
    const IS_TRANSMISSION: bool = false;

    /// Whether the first random number also chooses between the two sides of the surface.
    const CHOOSES_SIDE: bool = false;

    /// Whether rays in the narrow lobe continue beyond the point where other paths end, to show reflections.
    const SENDS_RAYS: bool = true;

    /// Whether the wide lobes are constant for all directions, even those behind the surface.
    const HAS_CONSTANT_WIDE: bool = false;

    /// Whether functions are inlined into every caller. For other kinds, there is one copy per instruction
    /// set, because a call is cheap compared with the work it does, and additional copies would bloat the
    /// program.
    const IS_INLINED: bool = false;

    /// Flags of all BSDFs of this kind.
    const ALWAYS: BxdfFlags;

    /// A flag for which [`Bxdf::narrow_lobe_value`] is compiled into two loops, one for surfaces with the
    /// flag and one for surfaces without it.
    const SPLITS_NARROW: BxdfFlags = BxdfFlags(0);

    /// Creates the BSDF. `tangent` is ∂p/∂u, or zero without texture coordinates.
    fn new(point: &Self::Point, tangent: Vec3) -> Self;

    /// Replaces the color that
    /// [`SpatiallyVaryingBxdf::color_to_look_up`](super::bsdf::SpatiallyVaryingBxdf::color_to_look_up) returns.
    /// Not called for materials without such a color.
    #[inline(always)]
    fn set_looked_up_color(&mut self, _point: &Self::Point, _color: Vec3) {}

    /// Properties of the BSDF, in addition to [`Bxdf::ALWAYS`].
    fn flags(&self) -> BxdfFlags;

    /// Whether the surface reflects nothing.
    #[inline(always)]
    fn is_black(&self) -> bool {
        false
    }

    /// Computes the values that depend on the view direction. `any` are the flags of the packet.
    fn compute_view_terms(&self, directions: &ShadingGeometry, any: BxdfFlags) -> Self::View;

    /// Value of the wide lobes.
    #[inline(always)]
    fn wide_lobe_value(&self, _view: &Self::View, _wi: Vec3, _any: BxdfFlags) -> LobeValue {
        LobeValue::ZERO
    }

    /// Value of the narrow lobes. Also called for surfaces without narrow lobes in packets that contain
    /// surfaces with narrow lobes. f must then be 0.
    fn narrow_lobe_value(&self, view: &Self::View, wi: Vec3, any: BxdfFlags) -> LobeValue;

    /// Pdf in sr⁻¹ of a direction sampled from these lobes. `shape` is the narrow lobes'
    /// [`LobeValue::shape`].
    fn pdf(&self, view: &Self::View, from: LobesWithNormal, wi: Vec3, shape: f32, any: BxdfFlags) -> f32;

    /// Samples a unit direction from these lobes. The first random number selects the lobe, and the others
    /// select the direction within it. All are in [0, 1).
    fn sample(&self, view: &Self::View, from: LobesWithNormal, random: [f32; 3], any: BxdfFlags) -> Vec3;

    /// Probability that sampling all lobes chooses a narrow lobe.
    #[inline(always)]
    fn narrow_lobe_probability(&self, _view: &Self::View) -> f32 {
        1.0
    }

    /// Estimate of the directional albedo, which determines how often a coat over the lobes is sampled. May
    /// be 0 only for black surfaces.
    #[inline(always)]
    fn albedo_estimate(&self, _view: &Self::View) -> f32 {
        1.0
    }

    /// Shape of the narrow lobe, for light selection. Only called if the flags indicate a narrow lobe. With
    /// `None`, lights are selected as for a wide lobe.
    #[inline(always)]
    fn narrow_lobe(&self, _view: &Self::View) -> Option<NarrowLobe> {
        None
    }

    /// Exponent of the narrow lobe if it is approximated as a power of a cosine, or 0 for kinds whose narrow
    /// lobes send rays. Light samples are inefficient for large exponents.
    #[inline(always)]
    fn narrow_lobe_exponent(&self) -> f32 {
        0.0
    }
}

/// Chooses one of two vectors without a branch.
#[inline(always)]
pub(super) fn choose_vec3_by_bool(condition: bool, yes: Vec3, no: Vec3) -> Vec3 {
    let pick = |yes: f32, no: f32| if condition { yes } else { no };
    Vec3::new(pick(yes.x, no.x), pick(yes.y, no.y), pick(yes.z, no.z))
}

/// Computes the lobes' shading normal from a normal on the lit side and the direction to the viewer.
#[inline(always)]
pub fn lobe_shading_normal<B: Bxdf>(normal: Vec3, wo: Vec3) -> Vec3 {
    use super::microfacet::tilt_to_face_viewer as turn;
    match (B::TURNS_NORMALS, B::IS_TRANSMISSION) {
        (false, _) => normal,
        (true, false) => turn(normal, wo),
        (true, true) => -turn(-normal, wo),
    }
}
