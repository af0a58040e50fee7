//! The lobes of a Phong surface.

use std::f32::consts::FRAC_1_PI;

use super::PhongPoint;
use super::lobes::{PhongLobes, phong_cosine_power};
use crate::materials::bsdf::{LobesToSample, NarrowLobe};
use crate::materials::bxdf::{Bxdf, BxdfFlags, LobeValue, LobesWithNormal, ShadingGeometry};
use crate::math::Vec3;
use glimt_base::soa;

soa! {
    /// The lobes of a Phong surface.
    pub struct PhongBxdf in PhongPacket {
        /// f of the diffuse lobe in sr⁻¹.
        diffuse: Vec3 = Vec3::ZERO,
        /// Peak value of the glossy lobe's f in sr⁻¹.
        specular: Vec3 = Vec3::ZERO,
        /// Exponent of the glossy lobe.
        shininess: f32 = 0.0,
        /// The largest components of kd and ks.
        albedos: [f32; 2] = [0.0; 2],
    }
}

soa! {
    /// View-dependent values of a Phong surface.
    pub struct PhongViewTerms in PhongViewPacket {
        /// The view direction reflected about the normal. The cosine between this direction and a light
        /// direction equals the cosine between the view direction and the reflected light direction: (2(n·l)n
        /// − l)·v = (2(n·v)n − v)·l.
        reflected: Vec3 = Vec3::ZERO,
    }
}

impl PhongBxdf {
    #[inline(always)]
    pub(super) fn lobes(&self, view: &PhongViewTerms, from: LobesWithNormal) -> PhongLobes {
        let LobesWithNormal { lobes, normal } = from;
        let [diffuse, specular] = match lobes {
            LobesToSample::All => self.albedos,
            LobesToSample::Narrow => [0.0, 1.0],
        };
        PhongLobes { normal, mirrored_eye: view.reflected, diffuse, specular, shininess: self.shininess }
    }
}

impl Bxdf for PhongBxdf {
    type Point = PhongPoint;
    type View = PhongViewTerms;

    const TURNS_NORMALS: bool = false;
    const SENDS_RAYS: bool = false;
    const HAS_CONSTANT_WIDE: bool = true;
    const IS_INLINED: bool = true;
    const ALWAYS: BxdfFlags = BxdfFlags::WIDE;

    #[inline(always)]
    fn new(point: &PhongPoint, _: Vec3) -> Self {
        Self {
            diffuse: point.diffuse_value(),
            specular: point.specular_peak(),
            shininess: point.shininess,
            albedos: [point.diffuse.max_element(), point.specular.max_element()],
        }
    }

    #[inline(always)]
    fn set_looked_up_color(&mut self, _: &PhongPoint, color: Vec3) {
        self.diffuse = color * FRAC_1_PI;
        self.albedos[0] = color.max_element();
    }

    #[inline(always)]
    fn flags(&self) -> BxdfFlags {
        BxdfFlags::NARROW.when(self.albedos[1] > 0.0)
    }

    #[inline(always)]
    fn is_black(&self) -> bool {
        (self.albedos[0] == 0.0) & (self.albedos[1] == 0.0)
    }

    #[inline(always)]
    fn compute_view_terms(&self, directions: &ShadingGeometry, _: BxdfFlags) -> PhongViewTerms {
        let &ShadingGeometry { normal, wo, .. } = directions;
        PhongViewTerms { reflected: normal * (2.0 * normal.dot(wo)) - wo }
    }

    #[inline(always)]
    fn wide_lobe_value(&self, _: &PhongViewTerms, _: Vec3, _: BxdfFlags) -> LobeValue {
        LobeValue { f: self.diffuse, max: self.albedos[0] * FRAC_1_PI, shape: 0.0 }
    }

    #[inline(always)]
    fn narrow_lobe_value(&self, view: &PhongViewTerms, wi: Vec3, _: BxdfFlags) -> LobeValue {
        let gloss = phong_cosine_power(view.reflected, wi, self.shininess);
        let peak = self.albedos[1] * ((self.shininess + 2.0) * (0.5 * FRAC_1_PI));
        LobeValue { f: self.specular * gloss, max: peak * gloss, shape: gloss }
    }

    #[inline(always)]
    fn pdf(&self, view: &PhongViewTerms, lobes: LobesWithNormal, wi: Vec3, shape: f32, _: BxdfFlags) -> f32 {
        self.lobes(view, lobes).pdf(wi, shape)
    }

    #[inline(always)]
    fn sample(
        &self,
        view: &PhongViewTerms,
        lobes: LobesWithNormal,
        [choice, u0, u1]: [f32; 3],
        any: BxdfFlags,
    ) -> Vec3 {
        let lobes = self.lobes(view, lobes);
        if any.contains(BxdfFlags::NARROW) {
            lobes.sample(choice, [u0, u1])
        } else {
            lobes.sample_diffuse([u0, u1])
        }
    }

    #[inline(always)]
    fn narrow_lobe_probability(&self, _: &PhongViewTerms) -> f32 {
        self.albedos[1] / (self.albedos[0] + self.albedos[1]).max(f32::MIN_POSITIVE)
    }

    #[inline(always)]
    fn albedo_estimate(&self, _: &PhongViewTerms) -> f32 {
        self.albedos[0] + self.albedos[1]
    }

    #[inline(always)]
    fn narrow_lobe(&self, view: &PhongViewTerms) -> Option<NarrowLobe> {
        // The normal is not used here.
        let lobes = self.lobes(view, LobesWithNormal { lobes: LobesToSample::All, normal: Vec3::Z });
        let (axis, exponent) = (view.reflected, self.shininess);
        Some(NarrowLobe {
            axis,
            exponent,
            peak: lobes.gray_f_of_all_lobes(1.0) - lobes.gray_f_of_all_lobes(0.0),
            wide: lobes.gray_f_of_all_lobes(0.0),
        })
    }

    #[inline(always)]
    fn narrow_lobe_exponent(&self) -> f32 {
        self.shininess
    }
}
