//! `[[light]]`.

use super::super::fingerprint::{Fingerprint, Fingerprinted, Referents};
pub use crate::lights::point::Falloff;
use crate::math::{DVec3, Vec3};

/// A light without extent.
#[derive(Clone, Debug, PartialEq)]
pub struct PointLight {
    /// Where.
    pub position: DVec3,
    /// W·sr⁻¹; with [`Falloff::None`] irradiance at normal incidence.
    pub intensity: Vec3,
    /// How it weakens with distance.
    pub falloff: Falloff,
}

impl Fingerprinted for PointLight {
    fn add_to(&self, key: &mut Fingerprint, _: &Referents<'_>) {
        let Self { position, intensity, falloff } = *self;
        key.dvec3(position).vec3(intensity).choice(falloff);
    }
}
