//! Render settings.

use super::{AovSource, FirstHitQuantity, LayerSet, PathAov, ViewMode};
use crate::geometry::Ray;
use crate::math::{DVec2, Vec2, Vec3};
use crate::scene::description::RenderOptions;
use crate::scene::fingerprint::{FingerprintContext, FingerprintHasher, Fingerprinted};
use crate::world::{Camera, FilmPosition, TextureRolesNeededByRender};

/// Settings for rendering a world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderSettings {
    /// The scene's `[render]` settings after this run's overrides.
    pub render: RenderOptions,
    /// Whether the lens has an aperture. False for a pinhole camera.
    pub dof: bool,
    /// The view to render.
    pub view: ViewMode,
    /// Photon mapping settings, or `None` if no photons are gathered.
    pub photons: Option<PhotonSettings>,
    /// Layers to record along with the beauty image.
    pub layers: LayerSet,
}

/// Settings for photon emission and density estimation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotonSettings {
    /// Photons emitted per pass.
    pub count: u32,
    /// First-pass kernel radius, or 0 to derive it from the photon density.
    pub radius: f32,
    /// Maximum number of bounces per photon.
    pub bounces: u32,
}

impl RenderSettings {
    /// Returns the effective settings. Settings that have no effect are reset to their defaults.
    pub fn without_ineffective_settings(&self) -> Self {
        let mut render = self.render.reset_ignored();
        let photons = self.photons.filter(|_| render.integrator.properties().gathers);
        if photons.is_some() {
            render.ambient = Vec3::ZERO;
        }
        Self { render, photons, ..*self }
    }

    /// Whether light from photons is visible in images with these settings. Light from photons has scattered
    /// at least twice: at the mirror or glass that the photon hit, and at the point where the photon is
    /// gathered.
    pub fn gathers_photons(&self) -> bool {
        let shows = match self.view.aov_source() {
            AovSource::FirstHit(number) => number == FirstHitQuantity::Photons,
            AovSource::Light(PathAov::LitFraction) => false,
            AovSource::Light(PathAov::Radiance(parts)) => parts.has_reflected() && self.render.max_depth > 1,
            AovSource::Light(PathAov::TraversalCost) | AovSource::Film(_) | AovSource::Bounds => {
                self.render.max_depth > 1
            }
        };
        shows && self.without_ineffective_settings().photons.is_some()
    }

    /// Textures needed for images with these settings.
    pub fn texture_needs(&self) -> TextureRolesNeededByRender {
        match self.view.aov_source() {
            AovSource::FirstHit(FirstHitQuantity::Normal) => {
                TextureRolesNeededByRender { normals: true, ..TextureRolesNeededByRender::NONE }
            }
            AovSource::FirstHit(FirstHitQuantity::Albedo) => {
                TextureRolesNeededByRender { diffuse: true, ..TextureRolesNeededByRender::NONE }
            }
            // Photons may be scattered by any surface.
            AovSource::FirstHit(FirstHitQuantity::Photons) if self.gathers_photons() => {
                TextureRolesNeededByRender::ALL
            }
            AovSource::FirstHit(
                FirstHitQuantity::Depth
                | FirstHitQuantity::Barycentric
                | FirstHitQuantity::Uv
                | FirstHitQuantity::Photons,
            ) => TextureRolesNeededByRender::NONE,
            // Normals and emission are needed, but not surface colors.
            AovSource::Light(PathAov::LitFraction) => TextureRolesNeededByRender {
                diffuse: false,
                specular: false,
                ambient: false,
                ..TextureRolesNeededByRender::ALL
            },
            AovSource::Light(PathAov::Radiance(parts)) if !parts.has_reflected() => {
                // These components are also visible in mirrors and through glass.
                let ambient =
                    parts.ambient && self.without_ineffective_settings().render.ambient != Vec3::ZERO;
                TextureRolesNeededByRender {
                    ambient,
                    lights: parts.emitted,
                    by_delta: true,
                    ..TextureRolesNeededByRender::NONE
                }
            }
            // Boxes are drawn over the beauty image.
            AovSource::Light(PathAov::Radiance(_) | PathAov::TraversalCost)
            | AovSource::Bounds
            | AovSource::Film(_) => TextureRolesNeededByRender::ALL,
        }
    }

    /// Converts a position in pixels, measured from the image's top left corner, to a film position.
    #[inline(always)]
    pub fn film_position_from_pixel(&self, from_corner: DVec2) -> FilmPosition {
        let RenderOptions { width, height, .. } = self.render;
        let (half_width, half_height) = (0.5 * f64::from(width), 0.5 * f64::from(height));
        let scale = 1.0 / half_height;
        let offset = DVec2::new(from_corner.x - half_width, half_height - from_corner.y) * scale;
        FilmPosition { offset, half_width: half_width * scale }
    }

    /// Returns the ray through the center of the pixel in column `x` and row `y` of the image as shown, and
    /// through the center of the lens. Returns `None` if the camera has no ray there.
    pub fn ray_through_pixel(&self, camera: &Camera, [x, y]: [u32; 2]) -> Option<Ray> {
        let x = if camera.is_mirrored() { self.render.width - 1 - x } else { x };
        let center = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        camera.ray(self.film_position_from_pixel(center), Vec2::ZERO)
    }
}

impl Fingerprinted for RenderSettings {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        let Self { render, dof, view, photons, layers } = self.without_ineffective_settings();
        key.add_with_references(&render, of).add_bool(dof).add_choice_name(view.view_to_sample());
        // All acceleration structures return the same hits, but these two views show the structures
        // themselves.
        match view.aov_source() {
            // The brightness of the lines depends on the exposure.
            AovSource::Bounds => key.add_choice_name(render.accel).add_f32(render.exposure),
            AovSource::Light(PathAov::TraversalCost) => key.add_choice_name(render.accel),
            AovSource::Light(_) | AovSource::FirstHit(_) | AovSource::Film(_) => &mut *key,
        };
        key.add_bool(photons.is_some());
        if let Some(PhotonSettings { count, radius, bounces }) = photons {
            key.add_u64(count.into()).add_f32(radius).add_u64(bounces.into());
        }
        for layer in layers.iter() {
            key.add_usize(layer as usize);
        }
    }
}
