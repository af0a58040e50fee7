//! Modulated emission: radiance that varies with position because of textures, opacity or blend weights, or
//! with direction because of a clear coat.
//!
//! The texture is importance sampled on quads, but not on other shapes. Each sample is multiplied by the
//! texture value at its point. Pdfs depend only on the emitter.

use std::sync::Arc;

use crate::geometry::triangle::barycentric_weights_at_point;
use crate::geometry::{RayF64, Shape};
use crate::materials::texture::Texture;
use crate::materials::{
    Coat, ExtraCoordinates, Footprint, ObjectPoint, Opacity, ScalarParameter, SecondUvPoint, TexturePoint,
};
use crate::math::transform::Transform;
use crate::math::{DVec2, DVec3, Vec2, Vec3};

/// A factor on a light's radiance that varies with position or direction. It is the sum of its terms.
#[derive(Clone, Debug, PartialEq)]
pub struct EmissionModulation {
    terms: Vec<EmissionTerm>,
    chart: UvMapping,
    /// The map from the shape's own coordinates to world coordinates, if a texture uses them.
    object_frame: Option<Box<Transform>>,
}

/// A part of a light's radiance. A blend has one term per emissive part.
#[derive(Clone, Debug, PartialEq)]
pub struct EmissionTerm {
    /// Constant factor.
    pub scale: Vec3,
    /// Texture that modulates the radiance.
    pub texture: Option<Arc<Texture>>,
    /// Opacity, if it varies.
    pub opacity: Option<Opacity>,
    /// Clear coat.
    pub coat: Option<Arc<Coat>>,
    /// Varying weights of the blends that contain the term.
    pub weights: Vec<BlendPartWeight>,
}

/// Weight of one part of a blend.
#[derive(Clone, Debug, PartialEq)]
pub struct BlendPartWeight {
    /// Weight of the second part.
    pub second: ScalarParameter,
    /// Whether this is the weight of the second part.
    pub is_second: bool,
}

impl BlendPartWeight {
    /// Weight of this part, given the weight `second` of the second part.
    pub fn part_weight_from_second(&self, second: f32) -> f32 {
        let second = second.clamp(0.0, 1.0);
        if self.is_second { second } else { 1.0 - second }
    }
}

impl EmissionTerm {
    /// Unmodulated emission.
    pub const CONSTANT: Self =
        Self { scale: Vec3::ONE, texture: None, opacity: None, coat: None, weights: Vec::new() };

    /// Whether the term varies with position.
    fn varies_with_position(&self) -> bool {
        self.texture.is_some() || self.opacity.is_some() || !self.weights.is_empty()
    }

    /// Whether the term varies with position or direction.
    pub fn varies_in_space_or_angle(&self) -> bool {
        self.varies_with_position() || self.coat.is_some()
    }

    /// The factor without the coat.
    #[inline]
    fn lookup_without_coat(&self, at: &TexturePoint) -> Vec3 {
        let color = self.texture.as_ref().map_or(Vec3::ONE, |texture| texture.lookup(at));
        let mut color = color * self.scale;
        if let Some(opacity) = &self.opacity {
            color *= opacity.evaluate(at, &mut 0);
        }
        for weight in &self.weights {
            color *= weight.part_weight_from_second(weight.second.evaluate(at, &mut 0));
        }
        color
    }

    /// The mean of the factor, estimated as the product of the means.
    pub fn mean(&self) -> Vec3 {
        let color = self.texture.as_ref().map_or(Vec3::ONE, |texture| texture.mean());
        let mut mean = color * self.scale * self.opacity.as_ref().map_or(1.0, Opacity::mean);
        for weight in &self.weights {
            let second = weight.second.texture().map_or(1.0, |texture| texture.mean().x);
            mean *= weight.part_weight_from_second(weight.second.as_untextured().unwrap_or(second));
        }
        mean
    }

    /// All textures that vary with position.
    fn textures(&self) -> impl Iterator<Item = &Arc<Texture>> {
        let of_opacity = self.opacity.as_ref().and_then(|opacity| opacity.value.texture());
        let of_weights = self.weights.iter().filter_map(|weight| weight.second.texture());
        self.texture.iter().chain(of_opacity).chain(of_weights)
    }
}

/// Maps points on a light to texture coordinates.
#[derive(Clone, Debug, PartialEq)]
pub enum UvMapping {
    /// The shape's own UV parameterization.
    Shape(Shape),
    /// UVs of a mesh's triangles, sorted by primitive index.
    Triangles(Vec<TriangleWithUvs>),
}

/// A triangle with UV coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleWithUvs {
    /// Primitive index in its object.
    pub primitive: u32,
    /// Corners in world coordinates.
    pub corners: [DVec3; 3],
    /// UVs of the corners.
    pub uvs: [Vec2; 3],
    /// The corners' UVs in the second set, or `None` if there is no second set.
    pub second_uvs: Option<[Vec2; 3]>,
}

impl EmissionModulation {
    /// Creates the factor from a texture and an opacity. Returns `None` if there is neither.
    pub fn new(texture: Option<&Arc<Texture>>, opacity: Option<&Opacity>, chart: UvMapping) -> Option<Self> {
        let (texture, opacity) = (texture.cloned(), opacity.cloned());
        Self::from_terms(vec![EmissionTerm { texture, opacity, ..EmissionTerm::CONSTANT }], chart)
    }

    /// Creates the factor from its terms. Returns `None` if none of them varies.
    pub fn from_terms(terms: Vec<EmissionTerm>, chart: UvMapping) -> Option<Self> {
        terms.iter().any(EmissionTerm::varies_in_space_or_angle).then_some(Self {
            terms,
            chart,
            object_frame: None,
        })
    }

    /// Sets the map from the shape's own coordinates to world coordinates, for textures that use them.
    #[must_use]
    pub fn with_object_frame(self, frame: &Transform) -> Self {
        let is_used = |term: &EmissionTerm| {
            let of_coat = term.coat.as_ref().is_some_and(|coat| coat.uses_object_point());
            of_coat || term.textures().any(|texture| texture.uses_object_point())
        };
        let object_frame = self.terms.iter().any(is_used).then(|| Box::new(*frame));
        Self { object_frame, ..self }
    }

    /// Whether the factor varies with position.
    pub fn varies_with_position(&self) -> bool {
        self.terms.iter().any(EmissionTerm::varies_with_position)
    }

    /// The factor at a point with the given texture coordinates, without coats.
    #[inline]
    pub fn factor_at_uv(&self, uv: DVec2, point: impl FnOnce() -> DVec3) -> Vec3 {
        let extra = self.object_frame.as_ref().map(|frame| {
            let object = Some(ObjectPoint::new(frame, point()));
            Box::new(ExtraCoordinates { second: None, object })
        });
        self.sum_without_coat(&TexturePoint { extra, ..TexturePoint::from_uv(uv) })
    }

    /// The point for texture lookups.
    fn texture_point(&self, point: DVec3, primitive: u32) -> TexturePoint {
        let mut at = self.chart.texture_point(point, primitive);
        if let Some(frame) = &self.object_frame {
            let (second, object) = (at.second_uv_point().copied(), Some(ObjectPoint::new(frame, point)));
            at.extra = Some(Box::new(ExtraCoordinates { second, object }));
        }
        at
    }

    #[inline]
    fn sum_without_coat(&self, at: &TexturePoint) -> Vec3 {
        self.terms.iter().map(|term| term.lookup_without_coat(at)).sum()
    }

    /// Largest number of texels per unit of u and v in any of the textures.
    pub fn texels_per_uv_unit(&self) -> [f64; 2] {
        let across = self.terms.iter().flat_map(EmissionTerm::textures).map(|one| one.texels_per_unit());
        let finer = |[u, v]: [f64; 2], [own_u, own_v]: [f64; 2]| [u.max(own_u), v.max(own_v)];
        across.reduce(finer).unwrap_or([1.0; 2])
    }

    /// The factor at a point on the light, for a ray in a given direction. `primitive` is the mesh triangle
    /// that contains the point.
    #[inline]
    pub fn radiance_factor(&self, point: Vec3, primitive: u32, direction: Vec3) -> Vec3 {
        self.radiance_factor_without_coat(point, primitive)
            * self.coat_transmittance(point, primitive, direction)
    }

    /// [`EmissionModulation::radiance_factor`] without coats.
    pub fn radiance_factor_without_coat(&self, point: Vec3, primitive: u32) -> Vec3 {
        self.sum_without_coat(&self.texture_point(point.as_dvec3(), primitive))
    }

    /// Transmittance of the clear coats for a ray in a given direction, averaged with the emission as
    /// weights.
    pub fn coat_transmittance(&self, point: Vec3, primitive: u32, direction: Vec3) -> Vec3 {
        if self.terms.iter().all(|term| term.coat.is_none()) {
            return Vec3::ONE;
        }
        let (point, direction) = (point.as_dvec3(), direction.as_dvec3());
        let at = self.texture_point(point, primitive);
        // At a shape's edge, the probe ray may miss the shape because of rounding.
        let normal = self.chart.geometric_normal_at_point(point, primitive, direction);
        let cosine = normal.map_or(1.0, |normal| normal.dot(direction)) as f32;
        let left = |term: &EmissionTerm| {
            term.coat.as_ref().map_or(Vec3::ONE, |coat| coat.transmittance(&at, cosine, &mut 0))
        };
        if let [term] = &self.terms[..] {
            return left(term);
        }
        let coated: Vec3 = self.terms.iter().map(|term| term.lookup_without_coat(&at) * left(term)).sum();
        let bare = self.sum_without_coat(&at);
        let part = |coated: f32, bare: f32| if bare > 0.0 { coated / bare } else { 0.0 };
        Vec3::new(part(coated.x, bare.x), part(coated.y, bare.y), part(coated.z, bare.z))
    }
}

/// Length of the probe ray that finds the normal at a point, as a fraction of the light's size.
const PROBE: f64 = 1e-3;

impl UvMapping {
    /// The unit normal on the front side at a point, which may be viewed from either side. Returns `None` if
    /// the probe ray misses the surface.
    fn geometric_normal_at_point(&self, point: DVec3, primitive: u32, direction: DVec3) -> Option<DVec3> {
        match self {
            Self::Shape(shape) => {
                let size = f64::from(shape.bounds()?.extent().max_element());
                // Approach the point from the viewer's side.
                let ray =
                    RayF64 { origin: point - direction * (PROBE * size), direction, t_max: f64::INFINITY };
                let hit = shape.intersect(&ray)?;
                Some(shape.surface_point_at_hit(&ray, &hit).normal.as_dvec3())
            }
            Self::Triangles(patches) => {
                let index = patches.binary_search_by_key(&primitive, |patch| patch.primitive).ok()?;
                let [a, b, c] = patches[index].corners;
                (b - a).cross(c - a).try_normalize()
            }
        }
    }

    fn texture_point(&self, point: DVec3, primitive: u32) -> TexturePoint {
        let patches = match self {
            Self::Shape(shape) => return TexturePoint::from_uv(shape.uv_at_point(point)),
            Self::Triangles(patches) => patches,
        };
        let found = patches.binary_search_by_key(&primitive, |patch| patch.primitive);
        let Ok(TriangleWithUvs { corners, uvs, second_uvs, .. }) = found.map(|index| patches[index]) else {
            return TexturePoint::from_uv(DVec2::ZERO);
        };
        let weights = barycentric_weights_at_point(corners, point);
        let between = |uvs: [Vec2; 3]| {
            let [a, b, c] = uvs.map(|uv| uv.as_dvec2());
            a + (b - a) * weights.x + (c - a) * weights.y
        };
        // Colors and scalars do not need tangents.
        let second = |uvs| {
            let (footprint, tangents) = (Footprint::POINT, [Vec3::ZERO; 2]);
            let second = Some(SecondUvPoint { uv: between(uvs), footprint, tangents });
            Box::new(ExtraCoordinates { second, object: None })
        };
        TexturePoint { extra: second_uvs.map(second), ..TexturePoint::from_uv(between(uvs)) }
    }
}
