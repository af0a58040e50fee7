//! Lights and light sampling.
//!
//! | files | contents |
//! | --- | --- |
//! | `sample`, `packet` | light samples for one point and for a packet of 16; points where rays hit lights |
//! | [`delta`] | point-like lights, one file each |
//! | [`infinite`] | lights at infinity, one file each |
//! | [`area`] | emitting surfaces, one file per shape, and their emission textures |
//! | [`tree`] | the light tree, which picks a few of many lights based on bounds on their contributions |
//! | `light` | [`Light`], an enum of all kinds of lights |
//! | `set`, `per_lane` | [`Lights`], all lights of a scene; samples for a packet in which each lane has picked a light |
//! | [`photon_emission`] | photon emission |
//!
//! Each row depends only on the rows above it. Lights do not depend on BSDFs, and do not check for occlusion.
//!
//! # To add a light
//!
//! 1. In `delta/NAME.rs` or `infinite/NAME.rs`, add a struct that implements
//!    [`DeltaPositionLight`](delta::DeltaPositionLight) or [`InfiniteLight`](infinite::InfiniteLight). An
//!    emitting shape implements [`ShapeEmitter`](area::ShapeEmitter) in `area/NAME.rs`, see [`area`].
//! 2. In the folder's `mod.rs`, declare the module and re-export the struct.
//! 3. In `light.rs`, add a variant and the match arms required by the compiler, for its family, sampling, and
//!    pdf. Infinite lights must also be added to `set.rs`, which sums the radiance along rays that leave the
//!    scene.
//! 4. For changes outside this folder, see CONTRIBUTING.
//!
//! The following must hold for every kind of light. The tests in this folder compare the quantities with
//! integrals and with traced rays.
//!
//! - The weight of a sample is the radiance divided by the pdf of its direction. For a delta light, it is the
//!   irradiance.
//! - The pdf of a sampled direction ([`Light::inverse_pdfs_of_samples`]) equals its pdf when a ray hits the
//!   light ([`Light::pdf_of_hit`], or [`Lights::radiance_from_infinity`] for infinite lights).
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
    AreaLight, BlendPartWeight, EmissionModulation, EmissionTerm, Emitter, EmittingPart, MeshEmitter, Side,
    TriangleWithUvs, UvMapping, new_back_area_light, new_front_area_light, new_see_through_side_light,
};
pub use light::{Light, LightFamily};
pub use packet::{GeometryOfLightPacket, LightSamplePacket};
pub use photon_emission::{
    BoundingSphere, EmissiveObjectGeometry, EmittedPhoton, PhotonEmitter, PhotonOrigin, PhotonRandomNumbers,
};
pub use sample::{GeometryOfLight, LightCenter, LightHitPoint, LightSample, ShadowRayEnd};
pub use set::{ExpectedSamplesPerLight, LightSampler, LightSamplingEffort, LightSamplingPurpose, Lights};
pub use tree::{
    AdaptiveLightTreeCut, LightBounds, LightPick, LightTree, Receiver, ReceiverLobe, ReceiverPacket,
};

#[cfg(test)]
mod tests;
#[cfg(test)]
mod variance_tests;
