//! Identifies materials that several shapes share.

use super::graph::ObjectIndex;

/// Everything that determines a material of the document. Shapes with equal keys share a material.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct MaterialKey {
    /// The BSDF, or `None` for the default one.
    pub(super) bsdf: Option<ObjectIndex>,
    /// The area light of the shape.
    pub(super) emitter: Option<ObjectIndex>,
    /// Texture coordinates of the shape. The same for all shapes if the material has no textures.
    pub(super) uv: UvConvention,
    /// The mesh whose attributes the material uses.
    pub(super) mesh: Option<usize>,
    /// Bits of the transmittance of the medium inside.
    pub(super) tint: Option<[u64; 3]>,
}

/// How a shape's texture coordinates in glimt differ from Mitsuba's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct UvConvention {
    /// Mitsuba's u is 1 − u.
    pub(super) flips_u: bool,
    /// Mitsuba's v is 1 − v.
    pub(super) flips_v: bool,
}
