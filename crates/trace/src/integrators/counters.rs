//! Counters of rays and look-ups.

/// Rays and look-ups of one tile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounters {
    /// Rays from the camera.
    pub camera_rays: u64,
    /// Rays towards lights.
    pub shadow_rays: u64,
    /// Mirrored rays.
    pub reflected_rays: u64,
    /// Refracted rays.
    pub refracted_rays: u64,
    /// Rays scattered by diffuse and glossy surfaces.
    pub scattered_rays: u64,
    /// Texture look-ups.
    pub texture_lookups: u64,
}

impl RayCounters {
    /// All rays.
    pub fn all(&self) -> u64 {
        let Self {
            camera_rays,
            shadow_rays,
            reflected_rays,
            refracted_rays,
            scattered_rays,
            texture_lookups: _,
        } = self;
        camera_rays + shadow_rays + reflected_rays + refracted_rays + scattered_rays
    }
}

impl std::ops::AddAssign for RayCounters {
    fn add_assign(&mut self, other: Self) {
        self.camera_rays += other.camera_rays;
        self.shadow_rays += other.shadow_rays;
        self.reflected_rays += other.reflected_rays;
        self.refracted_rays += other.refracted_rays;
        self.scattered_rays += other.scattered_rays;
        self.texture_lookups += other.texture_lookups;
    }
}
