//! The normalized Phong material: f = kd/π + ks·(α+2)/(2π)·max(0, R·V)^α (Lafortune and Willems, *Using the
//! Modified Phong Reflectance Model for Physically Based Rendering*, 1994).

mod bxdf;
pub mod lobes;

use std::f32::consts::{FRAC_1_PI, PI};

use crate::materials::bsdf::{BxdfParameters, SpatiallyVaryingBxdf};
use crate::materials::lookup::ParameterLookup;
use crate::materials::texture::ColorOrTexture;
#[cfg(test)]
use crate::materials::{
    bsdf::LobesToSample,
    bxdf::{Bxdf, LobesWithNormal, ShadingGeometry},
};
use crate::math::Vec3;
pub use bxdf::{PhongBxdf, PhongViewTerms};

/// A material with diffuse and glossy reflection on both sides.
#[derive(Clone, Debug, PartialEq)]
pub struct Phong {
    /// Diffuse reflectance kd.
    pub diffuse: ColorOrTexture,
    /// Specular reflectance ks.
    pub specular: ColorOrTexture,
    /// Exponent α.
    pub shininess: f32,
    /// Ambient reflectance ka. Defaults to kd if `None`.
    pub ambient: Option<ColorOrTexture>,
}

/// [`Phong`] at a point, after texture lookups.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhongPoint {
    /// Diffuse reflectance kd.
    pub diffuse: Vec3,
    /// Specular reflectance ks.
    pub specular: Vec3,
    /// Exponent α.
    pub shininess: f32,
    /// Ambient reflectance ka.
    pub ambient: Vec3,
}

impl SpatiallyVaryingBxdf for Phong {
    type Point = PhongPoint;

    #[inline(always)]
    fn look_up_parameters<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> PhongPoint {
        let diffuse = lookup.color(&self.diffuse);
        PhongPoint {
            diffuse,
            specular: lookup.color(&self.specular),
            shininess: self.shininess,
            ambient: self.ambient.as_ref().map_or(diffuse, |ambient| lookup.ambient_color(ambient)),
        }
    }

    #[inline]
    fn main_color<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> Vec3 {
        lookup.color(&self.diffuse)
    }

    fn look_up_ambient_reflectance<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> Vec3 {
        lookup.ambient_color(self.ambient.as_ref().unwrap_or(&self.diffuse))
    }

    #[inline]
    fn color_to_look_up(&self) -> Option<&ColorOrTexture> {
        Some(&self.diffuse)
    }
}

impl BxdfParameters for PhongPoint {
    #[inline]
    fn is_black(&self) -> bool {
        self.diffuse == Vec3::ZERO && self.specular == Vec3::ZERO
    }

    #[inline]
    fn ambient_reflectance(&self) -> Vec3 {
        self.ambient
    }

    fn tinted(self, color: Vec3) -> Self {
        Self { diffuse: self.diffuse * color, ambient: self.ambient * color, ..self }
    }

    #[inline(always)]
    fn interreflection_reflectances(&self) -> [Vec3; 2] {
        [self.diffuse, self.specular]
    }
}

impl PhongPoint {
    /// The diffuse part of f in sr⁻¹.
    pub fn diffuse_value(&self) -> Vec3 {
        self.diffuse * FRAC_1_PI
    }

    /// The glossy part of f at the lobe's peak in sr⁻¹.
    pub fn specular_peak(&self) -> Vec3 {
        self.specular * ((self.shininess + 2.0) / (2.0 * PI))
    }
}

#[cfg(test)]
impl PhongPoint {
    /// f in sr⁻¹. `normal` is the unit normal on the viewer's side.
    fn f(&self, normal: Vec3, wo: Vec3, wi: Vec3) -> Vec3 {
        let bxdf = PhongBxdf::new(self, Vec3::ZERO);
        let any = PhongBxdf::ALWAYS.union(bxdf.flags());
        let view = bxdf.compute_view_terms(&ShadingGeometry { normal, wo, tangent: Vec3::ZERO }, any);
        bxdf.wide_lobe_value(&view, wi, any).f + bxdf.narrow_lobe_value(&view, wi, any).f
    }

    /// The lobes for a view direction.
    fn lobes(&self, normal: Vec3, wo: Vec3) -> lobes::PhongLobes {
        let bxdf = PhongBxdf::new(self, Vec3::ZERO);
        let directions = ShadingGeometry { normal, wo, tangent: Vec3::ZERO };
        let view = bxdf.compute_view_terms(&directions, PhongBxdf::ALWAYS);
        bxdf.lobes(&view, LobesWithNormal { lobes: LobesToSample::All, normal })
    }
}

#[cfg(test)]
mod tests {
    use super::super::lane_tests::{check_lane_independence, check_shown_lobes};
    use super::super::lobe_tests::NarrowLightPath;
    use super::*;

    fn glossy(shininess: f32) -> PhongPoint {
        PhongPoint { diffuse: Vec3::ZERO, specular: Vec3::ONE, shininess, ambient: Vec3::ZERO }
    }

    #[test]
    fn lobes_are_bit_identical_in_all_views() {
        let (diffuse, specular) = (Vec3::new(0.4, 0.2, 0.1), Vec3::splat(0.5));
        let points = [0.0, 1.0, 40.0, 1e4, 1e6];
        let points = points.map(|shininess| PhongPoint { diffuse, specular, shininess, ambient: Vec3::ZERO });
        check_shown_lobes::<PhongBxdf>(&points, NarrowLightPath::Mirrored);
    }

    #[test]
    fn lanes_are_independent() {
        let points = [0.0, 0.5].map(|specular| {
            let (diffuse, specular) = (Vec3::new(0.4, 0.2, 0.1), Vec3::splat(specular));
            [0.0, 1.0, 40.0, 1e4, 1e6].map(|shininess| PhongPoint {
                diffuse,
                specular,
                shininess,
                ambient: Vec3::ZERO,
            })
        });
        check_lane_independence::<PhongBxdf>(points.as_flattened());
    }

    fn reflected(shininess: f32, to_eye: Vec3, to_light: Vec3) -> f32 {
        glossy(shininess).f(Vec3::Z, to_eye, to_light).x
    }

    fn at_angle(degrees: f32) -> Vec3 {
        let (sin, cos) = degrees.to_radians().sin_cos();
        Vec3::new(sin, 0.0, cos)
    }

    #[test]
    fn glossy_lobe_has_the_exact_value() {
        // The expected value is (n + 2)/2π·cosⁿ 10° for n = 50, seen 10° from the mirror direction.
        let value = reflected(50.0, at_angle(-30.0), at_angle(20.0));
        let expected = 52.0 / (2.0 * std::f64::consts::PI) * 10.0_f64.to_radians().cos().powi(50);
        assert!((f64::from(value) - expected).abs() < 1e-4 * expected, "{value} {expected}");
    }

    /// Albedo, computed by quadrature over the hemisphere of light directions.
    fn albedo(shininess: f32, degrees: f32) -> f64 {
        let (rings, steps) = (400, 800);
        let mut sum = 0.0;
        for ring in 0..rings {
            let cos2 = (ring as f32 + 0.5) / rings as f32;
            let (sin, cos) = ((1.0 - cos2).sqrt(), cos2.sqrt());
            for step in 0..steps {
                let (s, c) = (step as f32 / steps as f32 * 2.0 * PI).sin_cos();
                let light = Vec3::new(sin * c, sin * s, cos);
                sum += f64::from(reflected(shininess, at_angle(degrees), light));
            }
        }
        // With equal steps in cos², ∫f cos dω = π·mean(f).
        sum / f64::from(rings * steps) * std::f64::consts::PI
    }

    #[test]
    fn albedos_match_exact_values() {
        for (shininess, values) in
            [(10.0, [1.0, 0.8661, 0.5047, 0.2281]), (100.0, [1.0, 0.8660, 0.5000, 0.1752])]
        {
            for (degrees, expected) in [0.0, 30.0, 60.0, 80.0].into_iter().zip(values) {
                let value = albedo(shininess, degrees);
                assert!(
                    (value - expected).abs() < 2e-3,
                    "α {shininess} at {degrees}°: {value} instead of {expected}"
                );
            }
        }
    }
}
