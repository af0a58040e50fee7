//! `[render]`.

use super::super::fingerprint::{Fingerprint, Fingerprinted, Referents};
use crate::choice;
pub use crate::film::tone::Tonemap;
use crate::math::Vec3;
pub use crate::sampling::filter::PixelFilter;

/// Most scatterings along one path that a scene may ask for: between perfect mirrors a path ends nowhere else.
pub const MOST_SCATTERINGS: u32 = 10_000;

/// Settings of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Render {
    /// Pixels across, 1 … 65536.
    pub width: u32,
    /// Pixels down, 1 … 65536.
    pub height: u32,
    /// Most samples per pixel, ≥ 1.
    pub samples: u32,
    /// Noise at which a tile gets no more samples, relative to its brightness; 0: none ends it.
    pub error: f32,
    /// Shadow rays towards each light from each shaded point, ≥ 1.
    pub shadow_samples: u32,
    /// Scatterings along one path: 0 = emitted light only, 1 = direct light.
    pub max_depth: u32,
    /// The method.
    pub integrator: Integrator,
    /// Shadows.
    pub shadows: Shadows,
    /// Most radiance that a path brings by one vertex after its first diffuse or glossy reflection; 0: no such limit.
    pub clamp: f32,
    /// Ambient radiance of the Phong model.
    pub ambient: Vec3,
    /// Radiance seen by a ray that leaves the scene.
    pub background: Vec3,
    /// Reconstruction filter.
    pub filter: PixelFilter,
    /// Stops.
    pub exposure: f32,
    /// Tone curve of 8-bit and 16-bit files.
    pub tonemap: Tonemap,
    /// Acceleration structure.
    pub accel: Accel,
    /// Seed of every random number.
    pub seed: u32,
}

choice! {
    /// Rendering methods.
    pub enum Integrator {
        /// Direct light by Phong, mirror, glass, ambient.
        Whitted = "whitted",
        /// All light, by paths from the eye, without bias.
        Path = "path",
    }
}

choice! {
    /// How shadows are made.
    pub enum Shadows {
        /// Nothing stops light.
        Off = "off",
        /// One ray to the middle of a light.
        Hard = "hard",
        /// The visible part of the light, sampled.
        Soft = "soft",
    }
}

choice! {
    /// Acceleration structures.
    pub enum Accel {
        /// Bounding volume hierarchy.
        Bvh = "bvh",
        /// The same, with large triangles of meshes in several of its leaves: longer to build, faster to trace where
        /// triangles are long and lie askew.
        BvhHigh = "bvh-high",
        /// kd-tree over the triangles of meshes.
        KdTree = "kdtree",
    }
}

impl Render {
    /// With the defaults in place of what its integrator ignores.
    pub fn heeded(self) -> Self {
        match self.integrator {
            Integrator::Whitted => Self { clamp: 0.0, ..self },
            Integrator::Path => Self { shadows: Shadows::Soft, ambient: Vec3::ZERO, ..self },
        }
    }
}

/// What the samples of a picture depend on.
impl Fingerprinted for Render {
    fn add_to(&self, key: &mut Fingerprint, _: &Referents<'_>) {
        let Self {
            width,
            height,
            // The film knows how many it has.
            samples: _,
            error,
            shadow_samples,
            max_depth,
            integrator,
            shadows,
            clamp,
            ambient,
            background,
            filter,
            // For files and screens only.
            exposure: _,
            tonemap: _,
            // All trees give the same hits; views that show the trees add it.
            accel: _,
            seed,
        } = self.heeded();
        key.f32(error);
        key.u64(width.into()).u64(height.into()).u64(shadow_samples.into()).u64(max_depth.into());
        key.choice(integrator)
            .choice(shadows)
            .f32(clamp)
            .vec3(ambient)
            .vec3(background)
            .choice(filter)
            .u64(seed.into());
    }
}
