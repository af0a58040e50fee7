//! Lights and light sampling.
//!
//! | files | contents |
//! | --- | --- |
//! | `sample`, `row` | light samples, for one point and for a packet of 16; points on lights hit by rays |
//! | [`delta`] | point-like lights, one file each |
//! | [`infinite`] | lights at infinity, one file each |
//! | [`area`] | emitting surfaces, one file per shape, and their emission textures |
//! | [`tree`] | the light tree: picks a few of many lights, by bounds on their contributions |
//! | `light` | [`Light`]: any kind of light |
//! | `set`, `per_lane` | [`Lights`]: all lights of a scene; samples for a packet in which every lane picked a light |
//! | [`photon_emission`] | photon emission |
//!
//! Each row depends only on those above it. A light knows neither materials nor occlusion.
//!
//! # To add a light
//!
//! 1. `delta/NAME.rs` or `infinite/NAME.rs`: a struct that implements [`DeltaLight`](delta::DeltaLight) or
//!    [`InfiniteLight`](infinite::InfiniteLight). An emitting shape implements [`ShapeEmitter`](area::ShapeEmitter) in
//!    `area/NAME.rs`; see [`area`].
//! 2. The folder's `mod.rs`: one line for the module, one for the name.
//! 3. `light.rs`: a variant, and the match arms that the compiler asks for: its family, its sampling, and its pdf. An infinite
//!    light must also be added to `set.rs`, which sums the radiance of rays that leave the scene.
//! 4. Outside this folder: see CONTRIBUTING.
//!
//! Three quantities must agree. The tests in this folder compare them with integrals and with rays, for every kind of light:
//!
//! - The weight of a sample is the radiance divided by the pdf of its direction; for a delta light, the irradiance.
//! - The pdf of a direction is the same whether it was sampled ([`Light::inverse_pdfs`]) or found by a ray
//!   ([`Light::pdf`], or [`Lights::radiance_from_infinity`] for infinite lights).
//! - The mean photon flux equals the power implied by the bounds and the samples.

pub mod area;
pub mod delta;
pub mod infinite;
mod light;
mod packet;
mod per_lane;
pub mod photon_emission;
mod sample;
mod set;
pub mod tree;

pub use area::{
    AreaLight, EmissionTexture, Emitter, LightPart, MeshEmitter, Side, UvChart, UvTriangle, area_light,
    back_light, see_through_light,
};
pub use light::{Light, LightFamily};
pub use packet::{LightObjectPacket, LightSamplePacket};
pub use photon_emission::{
    BoundingSphere, EmittedPhoton, EmitterGeometry, PhotonNumbers, PhotonOrigin, PhotonSource,
};
pub use sample::{LightCenter, LightHit, LightObject, LightSample, ShadowRayEnd};
pub use set::{ExpectedSamples, LightSampler, LightSamplingEffort, Lights, SamplingMode};
pub use tree::{LightBounds, LightPick, LightTree, LightTreeCut, Receiver, ReceiverLobe, ReceiverPacket};

#[cfg(test)]
mod tests;
#[cfg(test)]
mod variance_tests;
