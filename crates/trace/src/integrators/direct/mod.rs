//! Direct light at vertices (next-event estimation): light samples with their shadow rays, and the techniques that compete with
//! them.
//!
//! - `queue`: rows of vertices that wait for light, and what comes to them.
//! - `all_lights`: samples of every light; `picked`: of lights picked by a tree; `shadow_rays`: the rays to these, grouped by light.
//! - `lobe_rays`: rays in narrow lobes; `unshadowed`: the same without soft shadows.
//! - `mis`: weights of these, of paths, and of light samples against each other.

pub mod all_lights;
pub mod lobe_rays;
pub mod mis;
pub mod picked;
pub mod queue;
pub mod shadow_rays;
pub mod unshadowed;
