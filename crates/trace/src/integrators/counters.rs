//! Ray and texture lookup counters.

/// Ray and texture lookup counts for one tile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounters {
    /// Camera rays.
    pub camera_rays: u64,
    /// Shadow rays.
    pub shadow_rays: u64,
    /// Specular reflection rays.
    pub reflected_rays: u64,
    /// Specular refraction rays.
    pub refracted_rays: u64,
    /// Rays scattered at diffuse and glossy surfaces.
    pub scattered_rays: u64,
    /// Texture lookups.
    pub texture_lookups: u64,
}

impl RayCounters {
    /// Total number of rays.
    pub fn total_rays(&self) -> u64 {
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
