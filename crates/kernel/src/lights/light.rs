//! The lights side by side: each kind is a variant of [`Light`], and [`Light::family`] tells its trait.

use super::area::{AreaLight, EmissionTexture};
use super::delta::{DeltaLight, PointLight, SpotLight};
use super::infinite::{DirectionalLight, Environment, InfiniteLight};
use super::row::LightRow;
use super::sample::{LightHit, LightSample, Middle, Source};
use super::tree::LightBounds;
use crate::math::Vec3;
use crate::math::lanes::{F32x16, PACKET_SIZE, Vec3x16, lane};

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

/// A light by its family, in which all kinds have the same methods.
#[derive(Clone, Copy)]
pub enum Family<'a> {
    /// A light without extent.
    Delta(&'a dyn DeltaLight),
    /// A light from beyond the scene.
    Infinite(&'a dyn InfiniteLight),
    /// A shape that emits.
    Area(&'a AreaLight),
}

impl Light {
    /// The light by its family.
    pub fn family(&self) -> Family<'_> {
        match self {
            Self::Point(light) => Family::Delta(light),
            Self::Spot(light) => Family::Delta(light),
            Self::Directional(light) => Family::Infinite(light),
            Self::Environment(light) => Family::Infinite(light),
            Self::Area(light) => Family::Area(light),
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

    /// [`Light::sample`] for the points whose bits are set, each by its own numbers; without an emission texture.
    #[inline(always)]
    pub fn sample_row(&self, points: &Vec3x16, normals: &Vec3x16, used: u32, u: &[F32x16; 2]) -> LightRow {
        match self {
            Self::Point(light) => light.sample_row(points),
            Self::Spot(light) => light.sample_row(points),
            Self::Directional(light) => light.sample_row(u),
            Self::Environment(light) => light.sample_row(normals, u),
            Self::Area(light) => light.sample_row(points, normals, used, u),
        }
    }

    /// Inverse pdfs in sr of samples of this light. 0 if nothing arrives, and for a light without extent, which no other
    /// technique finds.
    #[inline(always)]
    pub fn inverse_densities(&self, samples: &LightRow) -> F32x16 {
        let mut inverse = [0.0; PACKET_SIZE];
        match self {
            Self::Point(_) | Self::Spot(_) => {}
            Self::Directional(light) => inverse = [light.inverse_density(); PACKET_SIZE],
            Self::Environment(_) => inverse = samples.of_sky,
            Self::Area(light) => {
                let of_radiance = 1.0 / light.radiance.max_element();
                for i in 0..PACKET_SIZE {
                    inverse[i] = lane(&samples.weights, i).max_element() * of_radiance;
                }
            }
        }
        inverse
    }

    /// Inverse pdf as [`Light::inverse_densities`], from the direction and the weight of a sample.
    #[inline(always)]
    pub(super) fn inverse_density(&self, direction: Vec3, weight: Vec3) -> f32 {
        match self {
            Self::Point(_) | Self::Spot(_) => 0.0,
            Self::Directional(light) => light.inverse_density(),
            Self::Environment(light) => light.inverse_density(direction),
            Self::Area(light) => weight.max_element() / light.radiance.max_element(),
        }
    }
}

impl Light {
    /// [`Light::sample`] without an emission texture.
    #[inline]
    pub fn plain_sample(&self, point: Vec3, normal: Vec3, u: [f32; 2]) -> Option<LightSample> {
        match self.as_area() {
            Some(light) => light.plain_sample(point, normal, u),
            None => self.sample(point, normal, u),
        }
    }

    /// Light-sampling pdf in sr⁻¹ of a hit's direction, for the point `from` of a surface with this normal; 0 if the light is
    /// never sampled there, or no ray can hit it.
    #[inline]
    pub fn pdf(&self, from: Vec3, normal: Vec3, met: &LightHit) -> f32 {
        self.as_area().map_or(0.0, |light| light.pdf(from, normal, met))
    }

    /// Bounds of its position and emission, for a [`LightTree`](super::LightTree). `None` if it emits nothing.
    pub fn bounds(&self) -> Option<LightBounds> {
        let bounds = match self.family() {
            Family::Delta(light) => light.bounds(),
            Family::Infinite(light) => light.bounds(),
            Family::Area(light) => light.bounds,
        };
        Some(bounds).filter(|bounds| bounds.power > 0.0)
    }

    /// Emission texture, by which its radiance is multiplied from point to point. `None` if it has none.
    #[inline(always)]
    pub fn emission_texture(&self) -> Option<&EmissionTexture> {
        self.as_area().and_then(|light| light.texture.as_deref())
    }

    /// Whether it comes from beyond the scene.
    pub fn is_beyond(&self) -> bool {
        matches!(self.family(), Family::Infinite(_))
    }

    /// Whether it is an environment.
    pub fn is_from_all_around(&self) -> bool {
        self.as_environment().is_some()
    }

    /// Whether its light arrives in a single direction.
    pub fn is_single(&self) -> bool {
        match self.family() {
            Family::Delta(_) => true,
            Family::Infinite(light) => light.is_sharp(),
            Family::Area(_) => false,
        }
    }

    /// Middle of the light, and the objects that a ray to there ignores: the light itself. `None` for an environment.
    pub fn middle(&self) -> Option<(Middle, Source)> {
        Some(match self.family() {
            Family::Delta(light) => (Middle::At(light.brightest().position.as_vec3()), Source::Nothing),
            Family::Infinite(light) => (Middle::Towards(light.middle()?), Source::Nothing),
            Family::Area(light) => (Middle::At(light.middle().as_vec3()), light.source()),
        })
    }

    /// The point light. `None` for other kinds.
    #[inline(always)]
    pub(super) fn as_point(&self) -> Option<&PointLight> {
        if let Self::Point(light) = self { Some(light) } else { None }
    }

    /// The directional light. `None` for other kinds.
    pub(super) fn as_directional(&self) -> Option<&DirectionalLight> {
        if let Self::Directional(light) = self { Some(light) } else { None }
    }

    /// The environment. `None` for other kinds.
    pub(super) fn as_environment(&self) -> Option<&Environment> {
        if let Self::Environment(light) = self { Some(light) } else { None }
    }

    /// The shape that emits. `None` for other kinds.
    #[inline(always)]
    pub fn as_area(&self) -> Option<&AreaLight> {
        if let Self::Area(light) = self { Some(light) } else { None }
    }
}
