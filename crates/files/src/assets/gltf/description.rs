//! The content of a glTF file, in the terms of scenes.

use crate::math::{DMat3, DVec3, Vec2};

/// The content of a file that is seen.
#[derive(Debug, Default)]
pub struct ModelScene {
    /// Placed parts, in the order of the nodes.
    pub instances: Vec<ModelInstance>,
    /// Materials that instances use.
    pub materials: Vec<ModelMaterial>,
    /// Names of the images, which may be empty.
    pub images: Vec<String>,
    /// Lights that nodes place.
    pub lights: Vec<ModelLight>,
    /// Cameras that nodes place.
    pub cameras: Vec<ModelCamera>,
    /// Approximations, each with its place in the file.
    pub notes: Vec<String>,
    /// Least and greatest coordinates of all instances. `None` without one.
    pub bounds: Option<[DVec3; 2]>,
    /// Points of the instances, some of them far out in every direction.
    pub outline: Vec<DVec3>,
}

/// An affine map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Images of the axes.
    pub linear: DMat3,
    /// Image of the origin.
    pub translate: DVec3,
}

impl Placed {
    pub(super) const IDENTITY: Self = Self { linear: DMat3::IDENTITY, translate: DVec3::ZERO };

    /// This map after another.
    pub(super) fn after(self, inner: Self) -> Self {
        Self { linear: self.linear * inner.linear, translate: self.point(inner.translate) }
    }

    /// The image of a point.
    pub fn point(&self, at: DVec3) -> DVec3 {
        self.linear * at + self.translate
    }
}

/// A part at its place.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelInstance {
    /// Name of its node or its mesh; may be empty.
    pub name: String,
    /// Number of its node.
    pub node: usize,
    /// Number of its part.
    pub part: usize,
    /// Its placement.
    pub placed: Placed,
    /// Index into [`ModelScene::materials`].
    pub material: usize,
    /// Whether its vertices have normals.
    pub has_normals: bool,
    /// Whether its vertices have colours.
    pub has_colors: bool,
}

/// A number or a colour: a factor, by which a texture is multiplied.
#[derive(Clone, Debug, PartialEq)]
pub struct Slot {
    /// The factor; a number in all three.
    pub factor: DVec3,
    /// The texture.
    pub texture: Option<TextureRef>,
}

impl Slot {
    /// A number without a texture.
    pub fn number(number: f64) -> Self {
        Self { factor: DVec3::splat(number), texture: None }
    }
}

/// Continuation of a texture outside [0, 1].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TextureWrap {
    /// Periodic.
    Repeat,
    /// The border's texels.
    Clamp,
    /// Periodic, every second tile mirrored.
    Mirror,
}

/// An image with its look-up. Coordinates count v from the bottom; they are repeated, rotated, then moved.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureRef {
    /// Number of the image.
    pub image: usize,
    /// Whether texels are shown without interpolation.
    pub is_nearest: bool,
    /// Continuation outside [0, 1].
    pub wrap: TextureWrap,
    /// Whether it has the second set of coordinates of a part.
    pub is_second: bool,
    /// Repetitions; not 0.
    pub repeat: Vec2,
    /// Angle in degrees from u to v.
    pub rotate: f64,
    /// Offset.
    pub offset: Vec2,
}

/// The chance that a surface is there.
#[derive(Clone, Debug, PartialEq)]
pub enum Alpha {
    /// It is there.
    Opaque,
    /// It is there from a value on.
    Mask {
        /// The chance, by the alpha of a texture.
        value: Slot,
        /// The value from which on the surface is there.
        cutoff: f64,
    },
    /// It is there by chance.
    Blend(Slot),
}

/// Glass that fills its shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glass {
    /// Transmittance per unit of length.
    pub tint: DVec3,
}

/// A material in the terms of `principled`.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelMaterial {
    /// Its name; may be empty.
    pub name: String,
    /// Base colour.
    pub color: Slot,
    /// Weight of the metal: the blue of its texture.
    pub metallic: Slot,
    /// Roughness: the green of its texture.
    pub roughness: Slot,
    /// Index of refraction.
    pub ior: f64,
    /// Factor on the specular reflection: the alpha of its texture.
    pub specular: Slot,
    /// Colour of the specular reflection at normal incidence.
    pub specular_color: Slot,
    /// Transmission: the red of its texture.
    pub transmission: Slot,
    /// Weight of the clear coat: the red of its texture.
    pub clearcoat: Slot,
    /// Roughness of the clear coat: the green of its texture.
    pub clearcoat_roughness: Slot,
    /// Radiance.
    pub emission: Slot,
    /// Normal map.
    pub normal: Option<TextureRef>,
    /// Factor on the slopes of the normal map.
    pub normal_strength: f64,
    /// The chance that it is there.
    pub alpha: Alpha,
    /// Whether both sides are shown, and emit.
    pub is_two_sided: bool,
    /// Glass in place of all else but the roughness.
    pub glass: Option<Glass>,
}

impl ModelMaterial {
    /// Grey without a metal's or a mirror's reflection.
    pub(super) fn named(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            color: Slot::number(0.8),
            metallic: Slot::number(0.0),
            roughness: Slot::number(0.5),
            ior: 1.5,
            specular: Slot::number(1.0),
            specular_color: Slot::number(1.0),
            transmission: Slot::number(0.0),
            clearcoat: Slot::number(0.0),
            clearcoat_roughness: Slot::number(0.0),
            emission: Slot::number(0.0),
            normal: None,
            normal_strength: 1.0,
            alpha: Alpha::Opaque,
            is_two_sided: false,
            glass: None,
        }
    }
}

/// A light without extent (`KHR_lights_punctual`).
#[derive(Clone, Debug, PartialEq)]
pub struct ModelLight {
    /// Its name; may be empty.
    pub name: String,
    /// Kind.
    pub kind: ModelLightKind,
    /// Intensity in cd, of directional lights illuminance in lx, for red, green and blue.
    pub intensity: DVec3,
    /// Its place.
    pub position: DVec3,
    /// The way that its light travels.
    pub direction: DVec3,
}

/// Kind of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ModelLightKind {
    /// Light in all directions.
    Point,
    /// A cone.
    Spot {
        /// Whole angle in degrees.
        angle: f64,
        /// Part of the half angle over which it fades.
        blend: f64,
    },
    /// From one direction.
    Directional,
}

/// A perspective camera.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelCamera {
    /// Its name; may be empty.
    pub name: String,
    /// The eye.
    pub position: DVec3,
    /// The way that it looks, a unit vector.
    pub direction: DVec3,
    /// The direction that is up in the picture.
    pub up: DVec3,
    /// Vertical angle in degrees.
    pub fov: f64,
    /// Width over height. `None` if the file leaves it open.
    pub aspect: Option<f64>,
}

/// Notes, each once.
#[derive(Debug, Default)]
pub(super) struct Notes(pub(super) Vec<String>);

impl Notes {
    /// Most notes of a file.
    const MOST: usize = 200;

    /// Adds a note about a place.
    pub(super) fn add(&mut self, place: &str, what: &str) {
        let note = format!("{place}: {what}");
        if !self.0.contains(&note) && self.0.len() < Self::MOST {
            self.0.push(note);
        }
    }
}
