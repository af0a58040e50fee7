//! Ray cones, which track the width of the beam around a ray to choose the mip level of texture lookups
//! (Akenine-Möller, Crassin, Boksansky, Belcour, Panteleev, Wright, *Improved Shader and Texture Level of
//! Detail Using Ray Cones*, JCGT 2021). Without mip levels, all cones have zero width and spread.

/// A beam around a ray. A negative width means that the beam is past its focus.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RayCone {
    /// Width at the ray's origin.
    pub width: f32,
    /// Width increase per unit distance.
    pub spread: f32,
}

/// Fraction of a lobe's radius covered by one path's cone, as if a hundred paths shared the lobe.
const SHARE: f32 = 0.1;

/// A specular bounce. Its effect on a beam's spread depends on the beam's width.
#[derive(Clone, Copy, Debug)]
pub enum SpecularEvent {
    /// Reflection.
    Reflected,
    /// Refraction into a medium with this relative index of refraction.
    Refracted(f32),
}

impl RayCone {
    /// Returns the beam at a distance along the ray.
    #[inline(always)]
    pub fn propagated_by(self, distance: f32) -> Self {
        Self { width: self.width + self.spread * distance, ..self }
    }

    /// Returns the beam after a specular bounce, in the paraxial approximation. The surface's mean curvature
    /// is positive if it bulges toward the camera. `cosine` is the cosine of the angle of incidence.
    pub fn after_specular(self, event: SpecularEvent, curvature: f32, cosine: f32) -> Self {
        let turn = curvature * self.width / cosine.abs().max(MIN_COSINE);
        let spread = match event {
            SpecularEvent::Reflected => self.spread + 2.0 * turn,
            SpecularEvent::Refracted(eta) => (self.spread + turn) / eta - turn,
        };
        Self { spread, ..self }
    }

    /// Returns the beam after scattering in a direction with this pdf in sr⁻¹.
    pub fn scattered(self, pdf: f32) -> Self {
        // Radius in radians of a cone with solid angle 1/pdf.
        let radius = (1.0 / (std::f32::consts::PI * pdf)).sqrt();
        Self { spread: self.spread.abs().max(2.0 * SHARE * radius.min(1.0)), ..self }
    }
}

/// Lower bound on the cosine, which limits the effect of curvature at grazing angles.
const MIN_COSINE: f32 = 0.1;

#[cfg(test)]
mod tests {
    use super::*;

    const PARALLEL: RayCone = RayCone { width: 0.02, spread: 0.0 };

    #[test]
    fn curved_surfaces_focus_beams() {
        // A concave mirror of radius 3 focuses at distance 3/2; a convex mirror of radius 2 has a virtual
        // focus at distance 1.
        let concave = PARALLEL.after_specular(SpecularEvent::Reflected, -1.0 / 3.0, 1.0);
        assert!(concave.propagated_by(1.5).width.abs() < 1e-8);
        let convex = PARALLEL.after_specular(SpecularEvent::Reflected, 0.5, 1.0);
        assert!(
            convex.propagated_by(-1.0).width.abs() < 1e-8
                && (convex.propagated_by(1.0).width - 0.04).abs() < 1e-8
        );
        // A surface of radius 2 on glass with an index of 1.5 focuses at nR/(n − 1).
        let glass = PARALLEL.after_specular(SpecularEvent::Refracted(1.5), 0.5, 1.0);
        assert!(glass.propagated_by(6.0).width.abs() < 1e-7);
    }

    #[test]
    fn flat_surfaces_refract_beams_by_snells_law() {
        let spreading = RayCone { width: 0.1, spread: 0.3 };
        assert_eq!(spreading.after_specular(SpecularEvent::Reflected, 0.0, 0.3), spreading);
        assert!(
            (spreading.after_specular(SpecularEvent::Refracted(1.5), 0.0, 1.0).spread - 0.2).abs() < 1e-7
        );
    }

    #[test]
    fn wider_lobes_spread_beams_more() {
        let (wide, narrow) = (PARALLEL.scattered(0.3), PARALLEL.scattered(1000.0));
        assert!(wide.spread > 10.0 * narrow.spread && narrow.spread > 0.0 && wide.spread <= 0.2);
        assert_eq!(RayCone { spread: -0.5, ..PARALLEL }.scattered(1000.0).spread, 0.5);
    }
}
