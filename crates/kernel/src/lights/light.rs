//! The [`Light`] enum. [`Light::family`] returns a light as its family's trait object.

use super::area::{AreaLight, EmissionModulation};
use super::delta::{DeltaPositionLight, PointLight, SpotLight};
use super::infinite::{DirectionalLight, Environment, InfiniteLight};
use super::packet::LightSamplePacket;
use super::sample::{GeometryOfLight, LightCenter, LightHitPoint, LightSample};
use super::tree::LightBounds;
use crate::math::Vec3;
use crate::math::lanes::{F32x16, PACKET_SIZE, Vec3x16, lane};

/// A light of any kind. Area lights, the most common kind, are not boxed because they should be contiguous in
/// memory.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug, PartialEq)]
pub enum Light {
    /// A point light.
    Point(PointLight),
    /// A spotlight.
    Spot(SpotLight),
    /// A directional light, or a sun with a small angular diameter.
    Directional(DirectionalLight),
    /// An environment light.
    Environment(Environment),
    /// An emitting surface.
    Area(AreaLight),
}

/// A light of one of the three families. All lights in a family have the same methods.
#[derive(Clone, Copy)]
pub enum LightFamily<'a> {
    /// A light without extent.
    Delta(&'a dyn DeltaPositionLight),
    /// A light at infinity.
    Infinite(&'a dyn InfiniteLight),
    /// An emitting surface.
    Area(&'a AreaLight),
}

impl Light {
    /// The light's family.
    pub fn family(&self) -> LightFamily<'_> {
        match self {
            Self::Point(light) => LightFamily::Delta(light),
            Self::Spot(light) => LightFamily::Delta(light),
            Self::Directional(light) => LightFamily::Infinite(light),
            Self::Environment(light) => LightFamily::Infinite(light),
            Self::Area(light) => LightFamily::Area(light),
        }
    }

    /// Samples the light for a surface point with the given normal. `u` is in [0, 1)². Returns `None` if the
    /// sampled point does not illuminate the surface.
    pub fn sample(&self, point: Vec3, normal: Vec3, u: [f32; 2]) -> Option<LightSample> {
        match self {
            Self::Point(light) => light.sample(point),
            Self::Spot(light) => light.sample(point),
            Self::Directional(light) => light.sample(u),
            Self::Environment(light) => light.sample(normal, u),
            Self::Area(light) => light.sample(point, normal, u),
        }
    }

    /// [`Light::sample`] for the points in the mask `used`, without emission modulation.
    #[inline(always)]
    pub fn sample_unmodulated_packet(
        &self,
        points: &Vec3x16,
        normals: &Vec3x16,
        used: u32,
        u: &[F32x16; 2],
    ) -> LightSamplePacket {
        match self {
            Self::Point(light) => light.sample_packet(points),
            Self::Spot(light) => light.sample_packet(points),
            Self::Directional(light) => light.sample_packet(u),
            Self::Environment(light) => light.sample_packet(normals, u),
            Self::Area(light) => light.sample_unmodulated_packet(points, normals, used, u),
        }
    }

    /// Inverse light-sampling pdfs in sr. They are 0 for black samples and for delta lights, which no other
    /// technique can sample.
    #[inline(always)]
    pub fn inverse_pdfs_of_samples(&self, samples: &LightSamplePacket) -> F32x16 {
        let mut inverse = [0.0; PACKET_SIZE];
        match self {
            Self::Point(_) | Self::Spot(_) => {}
            Self::Directional(light) => inverse = [light.inverse_pdf(); PACKET_SIZE],
            Self::Environment(_) => inverse = samples.environment_inverse_pdfs,
            Self::Area(light) => {
                let of_radiance = 1.0 / light.radiance.max_element();
                for i in 0..PACKET_SIZE {
                    inverse[i] = lane(&samples.weights, i).max_element() * of_radiance;
                }
            }
        }
        inverse
    }

    /// [`Light::inverse_pdfs_of_samples`] for a single sample, computed from its direction and weight.
    #[inline(always)]
    pub(super) fn inverse_pdf_of_sample(&self, direction: Vec3, weight: Vec3) -> f32 {
        match self {
            Self::Point(_) | Self::Spot(_) => 0.0,
            Self::Directional(light) => light.inverse_pdf(),
            Self::Environment(light) => light.inverse_pdf(direction),
            Self::Area(light) => weight.max_element() / light.radiance.max_element(),
        }
    }
}

impl Light {
    /// [`Light::sample`] without emission modulation.
    #[inline]
    pub fn sample_unmodulated(&self, point: Vec3, normal: Vec3, u: [f32; 2]) -> Option<LightSample> {
        match self.as_area() {
            Some(light) => light.sample_unmodulated(point, normal, u),
            None => self.sample(point, normal, u),
        }
    }

    /// Light-sampling pdf of a hit's direction in sr⁻¹, for the surface point `from` with the given normal.
    /// It is 0 if light sampling never generates the direction, or if rays cannot hit the light.
    #[inline]
    pub fn pdf_of_hit(&self, from: Vec3, normal: Vec3, hit: &LightHitPoint) -> f32 {
        self.as_area().map_or(0.0, |light| light.pdf(from, normal, hit))
    }

    /// Bounds on the light's position and emission for a [`LightTree`](super::LightTree), or `None` if the
    /// light emits nothing.
    pub fn bounds_if_emissive(&self) -> Option<LightBounds> {
        let bounds = match self.family() {
            LightFamily::Delta(light) => light.bounds(),
            LightFamily::Infinite(light) => light.direction_and_irradiance_bounds(),
            LightFamily::Area(light) => light.bounds,
        };
        Some(bounds).filter(|bounds| bounds.power > 0.0)
    }

    /// The factor that modulates the radiance of an area light, or `None` if the radiance is constant.
    #[inline(always)]
    pub fn emission_modulation(&self) -> Option<&EmissionModulation> {
        self.as_area().and_then(|light| light.modulation.as_deref())
    }

    /// Whether the light is at infinity.
    pub fn is_infinite(&self) -> bool {
        matches!(self.family(), LightFamily::Infinite(_))
    }

    /// Whether the light is an environment light.
    pub fn is_environment(&self) -> bool {
        self.as_environment().is_some()
    }

    /// Whether light arrives from a single direction.
    pub fn has_no_angular_extent(&self) -> bool {
        match self.family() {
            LightFamily::Delta(_) => true,
            LightFamily::Infinite(light) => light.has_no_angular_extent(),
            LightFamily::Area(_) => false,
        }
    }

    /// The light's center and the light's own geometry, which rays toward the center must ignore. Returns
    /// `None` for an environment.
    pub fn center_and_geometry(&self) -> Option<(LightCenter, GeometryOfLight)> {
        Some(match self.family() {
            LightFamily::Delta(light) => (
                LightCenter::At(light.isotropic_at_peak_intensity().position.as_vec3()),
                GeometryOfLight::Nothing,
            ),
            LightFamily::Infinite(light) => {
                (LightCenter::Towards(light.direction_to_center()?), GeometryOfLight::Nothing)
            }
            LightFamily::Area(light) => {
                (LightCenter::At(light.area_centroid().as_vec3()), light.geometry_of_light())
            }
        })
    }

    /// The point light, or `None` for other kinds.
    #[inline(always)]
    pub(super) fn as_point(&self) -> Option<&PointLight> {
        if let Self::Point(light) = self { Some(light) } else { None }
    }

    /// The directional light, or `None` for other kinds.
    pub(super) fn as_directional(&self) -> Option<&DirectionalLight> {
        if let Self::Directional(light) = self { Some(light) } else { None }
    }

    /// The environment light, or `None` for other kinds.
    pub(super) fn as_environment(&self) -> Option<&Environment> {
        if let Self::Environment(light) = self { Some(light) } else { None }
    }

    /// The area light, or `None` for other kinds.
    #[inline(always)]
    pub fn as_area(&self) -> Option<&AreaLight> {
        if let Self::Area(light) = self { Some(light) } else { None }
    }
}
