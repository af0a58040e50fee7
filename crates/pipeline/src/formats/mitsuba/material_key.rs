//! Identifies materials that several shapes share.

use super::graph::GraphObjectIndex;

/// Everything that determines a converted material. Shapes with equal keys share a material.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct MaterialKey {
    /// The BSDF, or `None` for the default one.
    pub(super) bsdf: Option<GraphObjectIndex>,
    /// The area light of the shape.
    pub(super) emitter: Option<GraphObjectIndex>,
    /// Texture coordinates of the shape, or the default if the material has no textures.
    pub(super) uv: UvFlips,
    /// The mesh whose attributes the material uses.
    pub(super) mesh: Option<usize>,
    /// Bits of the transmittance of the medium inside.
    pub(super) tint: Option<[u64; 3]>,
}

/// How a shape's texture coordinates in glimt differ from Mitsuba's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct UvFlips {
    /// Mitsuba's u is 1 − glimt's u.
    pub(super) flips_u: bool,
    /// Mitsuba's v is 1 − glimt's v.
    pub(super) flips_v: bool,
}

/// Identifies the material of a part of a blend within one shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct BlendPartKey {
    pub(super) bsdf: GraphObjectIndex,
    pub(super) uv: UvFlips,
    /// Whether a `twosided` contains the blend.
    pub(super) is_two_sided: bool,
    /// The `mask` and the `coating` that contain the blend.
    pub(super) mask: Option<GraphObjectIndex>,
    pub(super) coat: Option<GraphObjectIndex>,
}
