//! Direct light at vertices (next-event estimation): light samples with their shadow rays, and the techniques that compete with
//! them.

pub mod all_lights;
pub mod lobe_rays;
pub mod mis;
pub mod picked;
pub mod queue;
pub mod shadow_rays;
