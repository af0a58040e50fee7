//! Lights, and the sampling of their light at a point.

mod arrival;
pub mod cuboid;
pub mod directional;
pub mod disk;
mod each;
pub mod emission;
pub mod emitter;
pub mod environment;
mod linear;
mod meridians;
pub mod mesh;
pub mod pattern;
pub mod picture;
pub mod point;
pub mod rectangle;
pub mod round;
mod row;
mod set;
pub mod sky;
pub mod sphere;
pub mod spot;
pub mod torus;
pub mod tree;
pub mod triangle;

pub use directional::DirectionalLight;
pub use emission::{Ball, Emitted, Numbers, Outline, PhotonSource, Start};
pub use emitter::{AreaLight, Part, area_light};
pub use environment::Environment;
pub use pattern::{Chart, Patch, Pattern};
pub use point::PointLight;
pub use row::{LightRow, SourceRow};
pub use set::{Lights, Picks, Receivers, Samples, Selection};
pub use sky::SkyMap;
pub use spot::SpotLight;
pub use tree::{Cut, LightBounds, LightTree, Lobe, Pick, Receiver, ReceiverRow};

use crate::math::Vec3;

/// A light of any kind.
// Most lights of a scene are shapes; they lie side by side.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug, PartialEq)]
pub enum Light {
    /// A light without extent.
    Point(PointLight),
    /// A light without extent that emits into a cone.
    Spot(SpotLight),
    /// A light from beyond the scene, in one direction or a small disc.
    Directional(DirectionalLight),
    /// An environment, from all around.
    Environment(Environment),
    /// A shape that emits.
    Area(AreaLight),
}

/// A sample of the light that arrives at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// End of the shadow ray.
    pub end: End,
    /// Unit direction to the light.
    pub direction: Vec3,
    /// Radiance over the pdf of the direction in sr⁻¹: times f and the cosine, it is the contribution. For lights
    /// without extent, irradiance at normal incidence.
    pub weight: Vec3,
    /// Objects that the shadow ray ignores: the light itself.
    pub source: Source,
}

/// End of a shadow ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    /// A point, in world coordinates.
    At(Vec3),
    /// A place beyond everything in the scene.
    Beyond,
}

/// Position of the middle of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Middle {
    /// A point, in world coordinates.
    At(Vec3),
    /// A place beyond everything, in this unit direction.
    Towards(Vec3),
}

/// The part of the scene that a light is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Nothing that can be hit.
    Nothing,
    /// A convex object: no ray to its near side hits it before.
    Object(u32),
    /// One primitive of an object.
    Primitive(u32, u32),
}

/// A point of a light that a ray from elsewhere hits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Met {
    /// Unit direction of the ray.
    pub direction: Vec3,
    /// Distance to the point.
    pub distance: f32,
    /// Unit normal of the light's front there.
    pub normal: Vec3,
    /// Number of the primitive that was hit.
    pub primitive: u32,
}

impl Met {
    /// Pdf in sr⁻¹ of directions to points that are uniform over an area; 0 from behind.
    fn pdf_by_area(&self, area: f64) -> f32 {
        let cosine = -self.normal.dot(self.direction);
        if cosine > 0.0 { self.distance * self.distance / (area as f32 * cosine) } else { 0.0 }
    }
}

impl Light {
    /// Light-sampling pdf in sr⁻¹ of a hit's direction, for the point `from` of a surface with this normal; 0 if the light is
    /// never sampled there, or no ray can hit it.
    #[inline]
    pub fn pdf(&self, from: Vec3, normal: Vec3, met: &Met) -> f32 {
        match self {
            Self::Point(_) | Self::Spot(_) | Self::Directional(_) | Self::Environment(_) => 0.0,
            Self::Area(light) => light.pdf(from, normal, met),
        }
    }

    /// Samples its light at a point of a surface with this normal, by numbers in [0, 1). `None` if the chosen point sends
    /// nothing there.
    pub fn sample(&self, point: Vec3, normal: Vec3, u: [f32; 2]) -> Option<LightSample> {
        match self {
            Self::Point(light) => light.sample(point),
            Self::Spot(light) => light.sample(point),
            Self::Directional(light) => light.sample(u),
            Self::Environment(light) => light.sample(normal, u),
            Self::Area(light) => light.sample(point, normal, u),
        }
    }

    /// [`Light::sample`] without an emission texture.
    #[inline]
    pub fn plain_sample(&self, point: Vec3, normal: Vec3, u: [f32; 2]) -> Option<LightSample> {
        match self {
            Self::Point(_) | Self::Spot(_) | Self::Directional(_) | Self::Environment(_) => {
                self.sample(point, normal, u)
            }
            Self::Area(light) => light.plain_sample(point, normal, u),
        }
    }

    /// Bounds of its position and emission, for a [`LightTree`]. `None` if it emits nothing.
    pub fn bounds(&self) -> Option<LightBounds> {
        match self {
            Self::Point(light) => Some(light.bounds()),
            Self::Spot(light) => Some(light.bounds()),
            Self::Directional(light) => Some(light.bounds()),
            Self::Environment(light) => Some(light.bounds()),
            Self::Area(light) => Some(light.bounds),
        }
        .filter(|bounds| bounds.power > 0.0)
    }

    /// Emission texture, by which its radiance is multiplied from point to point. `None` if it has none.
    #[inline(always)]
    pub fn pattern(&self) -> Option<&Pattern> {
        match self {
            Self::Point(_) | Self::Spot(_) | Self::Directional(_) | Self::Environment(_) => None,
            Self::Area(light) => light.pattern.as_deref(),
        }
    }

    /// Whether it comes from beyond the scene.
    pub fn is_beyond(&self) -> bool {
        match self {
            Self::Directional(_) | Self::Environment(_) => true,
            Self::Point(_) | Self::Spot(_) | Self::Area(_) => false,
        }
    }

    /// Whether it is an environment.
    pub fn is_from_all_around(&self) -> bool {
        match self {
            Self::Environment(_) => true,
            Self::Point(_) | Self::Spot(_) | Self::Directional(_) | Self::Area(_) => false,
        }
    }

    /// Whether its light arrives in a single direction.
    pub fn is_single(&self) -> bool {
        match self {
            Self::Point(_) | Self::Spot(_) => true,
            Self::Directional(light) => light.is_sharp(),
            Self::Environment(_) | Self::Area(_) => false,
        }
    }

    /// Middle of the light, and the objects that a ray to there ignores: the light itself. `None` for an environment.
    pub fn middle(&self) -> Option<(Middle, Source)> {
        Some(match self {
            Self::Point(PointLight { position, .. })
            | Self::Spot(SpotLight { point: PointLight { position, .. }, .. }) => {
                (Middle::At(position.as_vec3()), Source::Nothing)
            }
            Self::Directional(light) => (Middle::Towards(light.to_light), Source::Nothing),
            Self::Environment(_) => return None,
            Self::Area(light) => (Middle::At(light.middle().as_vec3()), Source::Object(light.object)),
        })
    }
}

#[cfg(test)]
mod shown_tests;
#[cfg(test)]
mod tests;
