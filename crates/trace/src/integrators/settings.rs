//! Settings of a render.

use super::{FirstHit, Measure, Shown, View};
use crate::math::{DVec2, Vec3};
use crate::scene::description::Render;
use crate::scene::fingerprint::{Fingerprint, Fingerprinted, Referents};
use crate::world::Lookups;

/// Settings for rendering a world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderSettings {
    /// The scene's settings, with the changes of this run.
    pub render: Render,
    /// Whether the lens has its aperture; false for a pinhole.
    pub dof: bool,
    /// View to show.
    pub view: View,
    /// Settings of photon maps. `None` if no photons are gathered.
    pub photons: Option<PhotonSettings>,
}

/// Settings of photon emission and gathering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotonSettings {
    /// Photons emitted in a pass.
    pub count: u32,
    /// Radius of the first pass's kernels; 0 to choose it by the density of photons.
    pub radius: f32,
    /// Most scatterings of a photon.
    pub bounces: u32,
}

impl RenderSettings {
    /// The effective settings: ignored ones have their defaults.
    pub fn effective(&self) -> Self {
        let mut render = self.render.effective();
        let photons = self.photons.filter(|_| render.integrator.method().gathers);
        if photons.is_some() {
            render.ambient = Vec3::ZERO;
        }
        Self { render, photons, ..*self }
    }

    /// Whether pictures with these settings show any light of photons. A photon's light was scattered at least twice: by the
    /// mirror or glass that it met, and at the point where it is gathered.
    pub fn gathers(&self) -> bool {
        let shows = match self.view.shown() {
            Shown::FirstHit(number) => number == FirstHit::Photons,
            Shown::Light(Measure::ArrivingShare) => false,
            Shown::Light(Measure::Radiance(parts)) => parts.are_reflected() && self.render.max_depth > 1,
            Shown::Light(Measure::Work) | Shown::Film(_) | Shown::Bounds => self.render.max_depth > 1,
        };
        shows && self.effective().photons.is_some()
    }

    /// The textures that pictures with these settings look up.
    pub fn lookups(&self) -> Lookups {
        match self.view.shown() {
            Shown::FirstHit(FirstHit::Normal) => Lookups { normals: true, ..Lookups::NONE },
            Shown::FirstHit(FirstHit::Albedo) => Lookups { diffuse: true, ..Lookups::NONE },
            // Photons arrive by all kinds of surfaces.
            Shown::FirstHit(FirstHit::Photons) if self.gathers() => Lookups::ALL,
            Shown::FirstHit(FirstHit::Depth | FirstHit::Barycentric | FirstHit::Uv | FirstHit::Photons) => {
                Lookups::NONE
            }
            // The colours of surfaces do not count; their normals and the emission of lights do.
            Shown::Light(Measure::ArrivingShare) => {
                Lookups { diffuse: false, specular: false, ambient: false, ..Lookups::ALL }
            }
            Shown::Light(Measure::Radiance(parts)) if !parts.are_reflected() => {
                // Such parts are visible by mirrors and through glass too.
                let ambient = parts.ambient && self.effective().render.ambient != Vec3::ZERO;
                Lookups { ambient, lights: parts.emitted, by_delta: true, ..Lookups::NONE }
            }
            // Boxes are drawn over the picture.
            Shown::Light(Measure::Radiance(_) | Measure::Work) | Shown::Bounds | Shown::Film(_) => {
                Lookups::ALL
            }
        }
    }

    /// A place in the picture, in pixels from its top left corner, in the camera's units: from its middle to the right
    /// and up, in halves of its height.
    #[inline(always)]
    pub fn from_middle(&self, from_corner: DVec2) -> DVec2 {
        let Render { width, height, .. } = self.render;
        let (half_width, half_height) = (0.5 * f64::from(width), 0.5 * f64::from(height));
        DVec2::new(from_corner.x - half_width, half_height - from_corner.y) * (1.0 / half_height)
    }
}

impl Fingerprinted for RenderSettings {
    fn add_to(&self, key: &mut Fingerprint, of: &Referents<'_>) {
        let Self { render, dof, view, photons } = self.effective();
        key.add(&render, of).flag(dof).choice(view.sampled());
        // All trees give the same hits; these two show the trees themselves.
        match view.shown() {
            // Lines over a picture depend on the exposure.
            Shown::Bounds => key.choice(render.accel).f32(render.exposure),
            Shown::Light(Measure::Work) => key.choice(render.accel),
            Shown::Light(_) | Shown::FirstHit(_) | Shown::Film(_) => &mut *key,
        };
        key.flag(photons.is_some());
        if let Some(PhotonSettings { count, radius, bounces }) = photons {
            key.u64(count.into()).f32(radius).u64(bounces.into());
        }
    }
}
