//! Ray cones: the width of the beam around a ray (Akenine-Möller, Crassin, Boksansky, Belcour, Panteleev, Wright, *Improved Shader
//! and Texture Level of Detail Using Ray Cones*, JCGT 2021). They only choose the mip level of texture look-ups; without mip levels
//! they stay 0.

/// A beam around a ray. A width below 0 means that the beam is beyond its focus.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cone {
    /// Width at the ray's start.
    pub width: f32,
    /// Growth of the width with the distance.
    pub spread: f32,
}

/// Part of a lobe's radius that the cone of one path takes: as if a hundred paths shared the lobe.
const SHARE: f32 = 0.1;

/// Effect of a surface on a beam that leaves it, which changes with the width there.
#[derive(Clone, Copy, Debug)]
pub enum Bend {
    /// Reflection by a mirror.
    Reflected,
    /// Refraction into another medium, whose index of refraction is so many times as high.
    Refracted(f32),
}

impl Cone {
    /// The beam at a place on the ray.
    #[inline(always)]
    pub fn after(self, distance: f32) -> Self {
        Self { width: self.width + self.spread * distance, ..self }
    }

    /// The beam after a surface of this mean curvature, > 0 if the surface bulges towards the camera; by the paraxial equations.
    /// `cosine` is that of the angle to its normal.
    pub fn bent(self, bend: Bend, curvature: f32, cosine: f32) -> Self {
        let turn = curvature * self.width / cosine.abs().max(LEAST_COSINE);
        let spread = match bend {
            Bend::Reflected => self.spread + 2.0 * turn,
            Bend::Refracted(eta) => (self.spread + turn) / eta - turn,
        };
        Self { spread, ..self }
    }

    /// The beam after scattering in a direction of this pdf in sr⁻¹.
    pub fn scattered(self, density: f32) -> Self {
        // The solid angle 1/density is that of a cone of this radius in radians.
        let radius = (1.0 / (std::f32::consts::PI * density)).sqrt();
        Self { spread: self.spread.abs().max(2.0 * SHARE * radius.min(1.0)), ..self }
    }
}

/// Least cosine: beams that graze a surface bend no more than at this angle.
const LEAST_COSINE: f32 = 0.1;

#[cfg(test)]
mod tests {
    use super::*;

    const PARALLEL: Cone = Cone { width: 0.02, spread: 0.0 };

    #[test]
    fn mirrors_and_glass_bring_beams_to_their_foci() {
        // A concave mirror of radius 3 has its focus at 3/2; a convex one, of radius 2, as far behind it.
        let concave = PARALLEL.bent(Bend::Reflected, -1.0 / 3.0, 1.0);
        assert!(concave.after(1.5).width.abs() < 1e-8);
        let convex = PARALLEL.bent(Bend::Reflected, 0.5, 1.0);
        assert!(convex.after(-1.0).width.abs() < 1e-8 && (convex.after(1.0).width - 0.04).abs() < 1e-8);
        // One surface of radius 2 into glass of 1.5: nR/(n − 1).
        let glass = PARALLEL.bent(Bend::Refracted(1.5), 0.5, 1.0);
        assert!(glass.after(6.0).width.abs() < 1e-7);
    }

    #[test]
    fn flat_surfaces_leave_beams_as_they_are_but_for_snell() {
        let spreading = Cone { width: 0.1, spread: 0.3 };
        assert_eq!(spreading.bent(Bend::Reflected, 0.0, 0.3), spreading);
        assert!((spreading.bent(Bend::Refracted(1.5), 0.0, 1.0).spread - 0.2).abs() < 1e-7);
    }

    #[test]
    fn lobes_spread_beams_by_their_widths() {
        let (wide, narrow) = (PARALLEL.scattered(0.3), PARALLEL.scattered(1000.0));
        assert!(wide.spread > 10.0 * narrow.spread && narrow.spread > 0.0 && wide.spread <= 0.2);
        assert_eq!(Cone { spread: -0.5, ..PARALLEL }.scattered(1000.0).spread, 0.5);
    }
}
