//! Lights, and the sampling of their light at a point.
//!
//! | files | contents |
//! | --- | --- |
//! | `sample`, `row` | samples of light, one and sixteen side by side; points of lights that rays hit |
//! | [`delta`] | lights without extent, one file each |
//! | [`infinite`] | lights from beyond the scene, one file each |
//! | [`area`] | shapes that emit, one file each, and their emission textures |
//! | [`tree`] | picks of a few lights among many, by bounds of their light |
//! | `light` | [`Light`]: the kinds side by side |
//! | `set`, `each` | [`Lights`]: the lights of a scene; samples of a row of points that picked a light each |
//! | [`emission`] | photons |
//!
//! Each line uses those above it. A light knows neither materials nor what the scene occludes.
//!
//! # To add a light
//!
//! 1. `delta/NAME.rs` or `infinite/NAME.rs`: a struct that implements [`DeltaLight`](delta::DeltaLight) or
//!    [`InfiniteLight`](infinite::InfiniteLight). A shape that emits implements [`ShapeEmitter`](area::ShapeEmitter) in
//!    `area/NAME.rs`: see [`area`].
//! 2. The `mod.rs` of its folder: one line for the module, one for the name.
//! 3. `light.rs`: a variant, and the arms that the compiler lists: its family, how it is sampled, and the pdf of its samples. An
//!    infinite light also has to be known to `set.rs`, which adds up what rays see that leave the scene.
//! 4. Outside of this room: see CONTRIBUTING.
//!
//! Three numbers have to agree; the tests of this folder compare them with integrals and with rays for every kind:
//!
//! - the weight of a sample is the radiance over the pdf of its direction, or the irradiance of a light without extent;
//! - the pdf of a direction is the same whether it was sampled ([`Light::inverse_densities`]) or found by a ray
//!   ([`Light::pdf`]; [`Lights::beyond_by_density`] for light from beyond);
//! - the mean of the photons' flux is the power that the bounds and the samples promise.

pub mod area;
pub mod delta;
mod each;
pub mod emission;
pub mod infinite;
mod light;
mod row;
mod sample;
mod set;
pub mod tree;

pub use area::{
    AreaLight, Chart, EmissionTexture, Emitter, MeshEmitter, Part, Patch, Side, area_light, back_light,
    sheer_light,
};
pub use emission::{Ball, Emitted, Numbers, Outline, PhotonSource, Start};
pub use light::{Family, Light};
pub use row::{LightRow, SourceRow};
pub use sample::{End, LightHit, LightSample, Middle, Source};
pub use set::{Lights, Picks, Receivers, Samples, Selection};
pub use tree::{Cut, LightBounds, LightTree, Lobe, Pick, Receiver, ReceiverRow};

#[cfg(test)]
mod shown_tests;
#[cfg(test)]
mod tests;
