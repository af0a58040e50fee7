//! Samples the lobes of a Phong surface. The diffuse lobe is cosine-weighted. The pdf of the glossy lobe is
//! proportional to the cosine of the angle to the reflected view direction, raised to the power α (Lafortune
//! and Willems, *Using the Modified Phong Reflectance Model for Physically Based Rendering*, 1994). Lobes are
//! chosen by albedo, and the overall pdf includes both lobes.

use std::f32::consts::{FRAC_1_PI, PI};

use crate::math::Vec3;
use crate::math::elementary::{pow_f64, sin_cos};
use crate::math::frame::Frame;

/// The lobes of a Phong surface at a single point, for a single view direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhongLobes {
    /// Unit normal on the viewer's side.
    pub normal: Vec3,
    /// The view direction reflected about the normal.
    pub mirrored_eye: Vec3,
    /// The largest component of kd.
    pub diffuse: f32,
    /// The largest component of ks.
    pub specular: f32,
    /// The exponent α.
    pub shininess: f32,
}

impl PhongLobes {
    /// Samples a unit direction. `lobe` selects the lobe and `u` the direction within it. All random numbers
    /// are in [0, 1).
    #[inline(always)]
    pub fn sample(&self, lobe: f32, u: [f32; 2]) -> Vec3 {
        let is_diffuse = lobe < self.diffuse_probability();
        let rest = 1.0 - u[0];
        // For the glossy lobe, the cosine is (1 − u)^(1/(α + 1)). It is computed in `f64` because the sine
        // would otherwise be inaccurate for narrow lobes.
        let cosine = pow_f64(f64::from(rest), 1.0 / (f64::from(self.shininess) + 1.0));
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt() as f32;
        let cosine = if is_diffuse { rest.sqrt() } else { cosine as f32 };
        let sine = if is_diffuse { u[0].sqrt() } else { sine };
        let x = if is_diffuse { self.normal.x } else { self.mirrored_eye.x };
        let y = if is_diffuse { self.normal.y } else { self.mirrored_eye.y };
        let z = if is_diffuse { self.normal.z } else { self.mirrored_eye.z };
        direction_about_axis(Vec3::new(x, y, z), sine, cosine, u[1])
    }

    /// [`PhongLobes::sample`] using only the diffuse lobe.
    #[inline(always)]
    pub fn sample_diffuse(&self, u: [f32; 2]) -> Vec3 {
        direction_about_axis(self.normal, u[0].sqrt(), (1.0 - u[0]).sqrt(), u[1])
    }

    /// Pdf in sr⁻¹ of a sampled direction with the given [`phong_cosine_power`].
    #[inline(always)]
    pub fn pdf(&self, direction: Vec3, gloss: f32) -> f32 {
        let cosine = self.normal.dot(direction);
        let diffuse = if cosine > 0.0 { cosine * FRAC_1_PI } else { 0.0 };
        let glossy = (self.shininess + 1.0) * (0.5 * FRAC_1_PI) * gloss;
        let share = self.diffuse_probability();
        share * diffuse + (1.0 - share) * glossy
    }

    /// f in sr⁻¹ of a gray surface with these albedos, given its [`phong_cosine_power`].
    #[inline(always)]
    pub fn gray_f_of_all_lobes(&self, gloss: f32) -> f32 {
        self.diffuse * FRAC_1_PI + self.specular * ((self.shininess + 2.0) * (0.5 * FRAC_1_PI)) * gloss
    }

    /// Probability of choosing the diffuse lobe. 0 for a black surface, which may still transmit light.
    #[inline(always)]
    fn diffuse_probability(&self) -> f32 {
        self.diffuse / (self.diffuse + self.specular).max(f32::MIN_POSITIVE)
    }
}

/// Computes a unit direction from the angle to an axis, and from a number in [0, 1) for the angle around the
/// axis.
#[inline(always)]
pub fn direction_about_axis(axis: Vec3, sine: f32, cosine: f32, turn: f32) -> Vec3 {
    let (sin_phi, cos_phi) = sin_cos(2.0 * PI * turn);
    let local = Vec3::new(sine * cos_phi, sine * sin_phi, cosine);
    let direction = Frame::from_normal(axis).to_world(local);
    direction * (1.0 / direction.length_squared().sqrt())
}

/// The glossy lobe's value in a direction, relative to its peak. It is the cosine between the direction and
/// the reflected view direction, raised to the power α, or 0 if the cosine is negative. The cosine is
/// computed from the chord because cos θ loses precision in `f32` for small θ.
#[inline(always)]
pub fn phong_cosine_power(mirrored_eye: Vec3, direction: Vec3, shininess: f32) -> f32 {
    let cosine = 1.0 - 0.5 * f64::from((mirrored_eye - direction).length_squared());
    let is_ahead = cosine > 0.0;
    let left = pow_f64(if is_ahead { cosine } else { 1.0 }, f64::from(shininess)) as f32;
    if is_ahead { left } else { 0.0 }
}

#[cfg(test)]
mod tests;
