//! Next-event estimation: light samples with their shadow rays, and the techniques that compete with light
//! samples.
//!
//! - `queue`: packets of vertices that await direct lighting, and the light they reflect. `shadow_lift`:
//!   their shadow-ray origins on smooth meshes.
//! - `all_lights`: sampling of every light. `light_tree`: sampling of lights picked from a tree.
//!   `shadow_rays`: shadow rays to the picked lights, grouped by light. `light_sums`: the sums of their light.
//! - `lobe_rays`: rays in narrow lobes. `unshadowed`: lobe rays without soft shadows.
//! - `mis`: MIS weights for light samples, lobe rays and paths.

pub mod all_lights;
pub mod light_sums;
pub mod light_tree;
pub mod lobe_rays;
pub mod mis;
pub mod queue;
mod shadow_lift;
pub mod shadow_rays;
pub mod unshadowed;
