//! Next-event estimation: light samples with their shadow rays, and the techniques that compete with them.
//!
//! - `queue`: packets of vertices that await direct lighting, and the light that they reflect.
//! - `all_lights`: samples of every light; `light_tree`: samples of lights picked from a tree; `shadow_rays`: shadow
//!   rays to these, grouped by light.
//! - `lobe_rays`: rays in narrow lobes; `unshadowed`: the same without soft shadows.
//! - `mis`: MIS weights of light samples, lobe rays and paths.

pub mod all_lights;
pub mod light_tree;
pub mod lobe_rays;
pub mod mis;
pub mod queue;
pub mod shadow_rays;
pub mod unshadowed;
