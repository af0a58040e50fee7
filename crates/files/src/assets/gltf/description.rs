//! Contents of a glTF file, expressed in glimt's scene parameters.

use crate::math::{DMat3, DVec3, Vec2};

/// Visible contents of a glTF file.
#[derive(Debug, Default)]
pub struct ModelScene {
    /// Parts placed by nodes, in node order.
    pub instances: Vec<ModelInstance>,
    /// Materials used by the instances.
    pub materials: Vec<ModelMaterial>,
    /// Names of the images, possibly empty.
    pub images: Vec<String>,
    /// Lights placed by nodes.
    pub lights: Vec<ModelLight>,
    /// Cameras placed by nodes.
    pub cameras: Vec<ModelCamera>,
    /// Notes about approximations and omissions, each with its location in the file.
    pub notes: Vec<String>,
    /// Minimum and maximum coordinates of all instances, or `None` if there are no instances.
    pub bounds: Option<[DVec3; 2]>,
    /// Sample points on the instances, including the extremes in every direction.
    pub outline: Vec<DVec3>,
}

/// An affine transform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AffineMap {
    /// Linear part of the transform.
    pub linear: DMat3,
    /// Translation, applied after the linear part.
    pub translate: DVec3,
}

impl AffineMap {
    pub(super) const IDENTITY: Self = Self { linear: DMat3::IDENTITY, translate: DVec3::ZERO };

    /// Composes two transforms. `inner` is applied first.
    pub(super) fn compose(self, inner: Self) -> Self {
        Self { linear: self.linear * inner.linear, translate: self.transform_point(inner.translate) }
    }

    /// Transforms a point.
    pub fn transform_point(&self, at: DVec3) -> DVec3 {
        self.linear * at + self.translate
    }
}

/// A part placed by a node.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelInstance {
    /// Name of the node or its mesh, possibly empty.
    pub name: String,
    /// Index of the node.
    pub node: usize,
    /// Index of the part.
    pub part: usize,
    /// Transform to scene coordinates.
    pub placed: AffineMap,
    /// Index into [`ModelScene::materials`].
    pub material: usize,
    /// Whether the vertices have normals.
    pub has_normals: bool,
    /// Whether the vertices have colors.
    pub has_colors: bool,
}

/// A scalar or color factor, optionally multiplied by a texture.
#[derive(Clone, Debug, PartialEq)]
pub struct TexturedValue {
    /// The factor. A scalar is stored in all components.
    pub factor: DVec3,
    /// Texture scaled by the factor.
    pub texture: Option<TextureLookup>,
}

impl TexturedValue {
    /// A scalar without a texture.
    pub fn from_scalar(number: f64) -> Self {
        Self { factor: DVec3::splat(number), texture: None }
    }
}

/// Wrap mode for texture coordinates outside [0, 1].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TextureWrap {
    /// Repeats the texture.
    Repeat,
    /// Extends the edge texels outward.
    Clamp,
    /// Repeats the texture, mirroring every other copy.
    Mirror,
}

/// A texture lookup, with v = 0 at the bottom. Coordinates are scaled, then rotated, then translated.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureLookup {
    /// Index of the image.
    pub image: usize,
    /// Whether to use the nearest texel instead of interpolating.
    pub is_nearest: bool,
    /// Wrap mode for coordinates outside [0, 1].
    pub wrap: TextureWrap,
    /// Whether the lookup uses the part's second set of texture coordinates.
    pub is_second: bool,
    /// Scale factors for the coordinates, never 0.
    pub repeat: Vec2,
    /// Rotation angle in degrees, from u to v.
    pub rotate: f64,
    /// Offset added to the coordinates.
    pub offset: Vec2,
}

/// Opacity of a surface.
#[derive(Clone, Debug, PartialEq)]
pub enum AlphaMode {
    /// Fully opaque.
    Opaque,
    /// Opaque where the opacity reaches the cutoff, invisible elsewhere.
    Mask {
        /// Opacity, from the texture's alpha.
        value: TexturedValue,
        /// Minimum opacity at which points are visible.
        cutoff: f64,
    },
    /// Partially transparent.
    Blend(TexturedValue),
}

/// Solid glass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TintedGlass {
    /// Transmittance per unit distance.
    pub tint: DVec3,
}

/// Diffuse transmission, which replaces part of the diffuse reflection.
#[derive(Clone, Debug, PartialEq)]
pub struct DiffuseTransmission {
    /// Fraction t of the diffuse light that is transmitted, from the texture's alpha.
    pub weight: TexturedValue,
    /// Color of the transmitted light, which replaces the base color.
    pub color: TexturedValue,
}

/// A glTF material, converted to `principled` parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelMaterial {
    /// Name, possibly empty.
    pub name: String,
    /// Base color.
    pub color: TexturedValue,
    /// Metallic weight, from the texture's blue channel.
    pub metallic: TexturedValue,
    /// Roughness, from the texture's green channel.
    pub roughness: TexturedValue,
    /// Index of refraction.
    pub ior: f64,
    /// Scale factor for the specular reflection, from the texture's alpha.
    pub specular: TexturedValue,
    /// Color of the specular reflection at normal incidence.
    pub specular_color: TexturedValue,
    /// Transmission, from the texture's red channel.
    pub transmission: TexturedValue,
    /// Diffuse transmission, or `None` if there is none.
    pub diffuse_transmission: Option<DiffuseTransmission>,
    /// Clear coat weight, from the texture's red channel.
    pub clearcoat: TexturedValue,
    /// Clear coat roughness, from the texture's green channel.
    pub clearcoat_roughness: TexturedValue,
    /// Emitted radiance.
    pub emission: TexturedValue,
    /// Normal map.
    pub normal: Option<TextureLookup>,
    /// Scale factor for the normal map's slopes.
    pub normal_strength: f64,
    /// Opacity.
    pub alpha: AlphaMode,
    /// Whether both sides are visible and emit light.
    pub is_two_sided: bool,
    /// Solid glass. If set, all other parameters except the roughness and the emission are ignored.
    pub glass: Option<TintedGlass>,
}

impl ModelMaterial {
    /// A gray dielectric material.
    pub(super) fn named_gray_dielectric(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            color: TexturedValue::from_scalar(0.8),
            metallic: TexturedValue::from_scalar(0.0),
            roughness: TexturedValue::from_scalar(0.5),
            ior: 1.5,
            specular: TexturedValue::from_scalar(1.0),
            specular_color: TexturedValue::from_scalar(1.0),
            transmission: TexturedValue::from_scalar(0.0),
            diffuse_transmission: None,
            clearcoat: TexturedValue::from_scalar(0.0),
            clearcoat_roughness: TexturedValue::from_scalar(0.0),
            emission: TexturedValue::from_scalar(0.0),
            normal: None,
            normal_strength: 1.0,
            alpha: AlphaMode::Opaque,
            is_two_sided: false,
            glass: None,
        }
    }
}

/// A punctual light (`KHR_lights_punctual`).
#[derive(Clone, Debug, PartialEq)]
pub struct ModelLight {
    /// Name, possibly empty.
    pub name: String,
    /// Type of the light.
    pub kind: ModelLightKind,
    /// RGB intensity in cd, or RGB illuminance in lx for directional lights.
    pub intensity: DVec3,
    /// Position.
    pub position: DVec3,
    /// Direction of light propagation.
    pub direction: DVec3,
}

/// Type of a punctual light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ModelLightKind {
    /// Emits in all directions.
    Point,
    /// Emits in a cone.
    Spot {
        /// Full cone angle in degrees.
        angle: f64,
        /// Width of the falloff region, as a fraction of the half angle.
        blend: f64,
    },
    /// Parallel light.
    Directional,
}

/// A camera.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelCamera {
    /// Name, possibly empty.
    pub name: String,
    /// Eye position.
    pub position: DVec3,
    /// Viewing direction, a unit vector.
    pub direction: DVec3,
    /// Up direction in the image.
    pub up: DVec3,
    /// Projection.
    pub projection: ModelProjection,
    /// Aspect ratio (width / height), or `None` if the file does not specify it.
    pub aspect: Option<f64>,
}

/// Projection of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ModelProjection {
    /// Perspective.
    Perspective {
        /// Vertical field of view in degrees.
        fov: f64,
    },
    /// Orthographic.
    Orthographic {
        /// Height of the view in scene units.
        view_height: f64,
    },
}

/// Deduplicated notes about an import.
#[derive(Debug, Default)]
pub(super) struct ImportNotes(pub(super) Vec<String>);

impl ImportNotes {
    /// Maximum number of notes per file.
    const MAX_NOTES: usize = 200;

    /// Adds a note about an element in the file.
    pub(super) fn add(&mut self, place: &str, what: &str) {
        let note = format!("{place}: {what}");
        if !self.0.contains(&note) && self.0.len() < Self::MAX_NOTES {
            self.0.push(note);
        }
    }
}
