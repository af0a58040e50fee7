//! The lobes of a principled material.

use std::f32::consts::FRAC_1_PI;

use super::PrincipledPoint;
use crate::materials::bsdf::{LobesToSample, NarrowLobe};
use crate::materials::bxdf::{
    Bxdf, BxdfFlags, LobeValue, LobesWithNormal, ShadingGeometry, choose_vec3_by_bool,
};
use crate::materials::coat::clamp_cosine_to_nonnegative;
use crate::materials::fresnel::schlick_weight;
use crate::materials::lobe_albedo::{TERMS, evaluate_albedo_fit};
use crate::materials::microfacet::{
    MicrofacetDistribution, SmithDirectionTerms, UnnormalizedHalfVector, sample_reflected_direction,
};
use crate::materials::phong::lobes::direction_about_axis;
use crate::math::Vec3;
use crate::math::frame::Frame;
use glimt_base::soa;

soa! {
    /// A principled BSDF, for either reflected or transmitted light.
    pub struct PrincipledBxdf<const THROUGH: bool> in PrincipledPacket {
        /// f of the diffuse lobe on this side: [`PrincipledPoint::base`] or
        /// [`PrincipledPoint::transmitted_base`].
        base: Vec3 = Vec3::ZERO,
        /// [`PrincipledPoint::diffuse_albedos`].
        diffuse_albedos: [f32; 2] = [0.0; 2],
        /// [`PrincipledPoint::facets`].
        facets: Vec3 = Vec3::ZERO,
        /// [`PrincipledPoint::grazing`].
        grazing: f32 = 1.0,
        /// Reflectance of the dielectric at normal incidence.
        dielectric: Vec3 = Vec3::ZERO,
        /// Reflectance of the dielectric at grazing angles.
        dielectric_grazing: f32 = 0.0,
        /// [`PrincipledPoint::transmission`].
        transmission: Vec3 = Vec3::ZERO,
        /// [`PrincipledPoint::alpha`].
        alpha: f32 = 1.0,
        /// Terms of [`PrincipledPoint::albedo`] at normal incidence.
        terms: [f32; TERMS] = [0.0; TERMS],
        /// Terms of [`PrincipledPoint::albedo`] at grazing angles.
        grazing_terms: [f32; TERMS] = [0.0; TERMS],
    }
}

soa! {
    /// View-dependent values of a principled material.
    pub struct PrincipledViewTerms in PrincipledViewPacket {
        /// Unit normal on the viewer's side, or on the opposite side for transmitted light.
        normal: Vec3 = Vec3::Z,
        /// Unit direction to the viewer, mirrored to the opposite side for transmitted light.
        wo: Vec3 = Vec3::Z,
        /// Fraction of the light from the diffuse base that the specular layer transmits to the viewer.
        transmittance: Vec3 = Vec3::ONE,
        /// Probability of choosing the specular lobe.
        specular_probability: f32 = 1.0,
        /// Probability of choosing specular transmission.
        transmission_probability: f32 = 0.0,
        /// Probability of choosing diffuse transmission.
        diffuse_transmission_probability: f32 = 0.0,
    }
}

/// The distribution of all facets.
const GGX: MicrofacetDistribution = MicrofacetDistribution::Ggx;

/// Set if the material transmits light.
const TRANSMITS: BxdfFlags = BxdfFlags(1 << BxdfFlags::FIRST_OWN);

impl<const THROUGH: bool> PrincipledBxdf<THROUGH> {
    /// Albedos of the specular lobe at a cosine ≥ 0, per unit of reflectance at normal incidence and at
    /// grazing angles.
    #[inline(always)]
    fn f0_and_f90_albedos(&self, cosine: f32) -> [f32; 2] {
        [
            evaluate_albedo_fit(cosine, |number| self.terms[number]),
            evaluate_albedo_fit(cosine, |number| self.grazing_terms[number]),
        ]
    }

    /// Fraction of the light that passes through the dielectric's specular lobe at a cosine ≥ 0.
    #[inline(always)]
    fn one_minus_specular_albedo(&self, cosine: f32) -> Vec3 {
        let [normal, grazing] = self.f0_and_f90_albedos(cosine);
        let rest = Vec3::ONE - self.dielectric * normal - Vec3::splat(self.dielectric_grazing * grazing);
        // If the facets reflect everything, no light passes. Clamp to 0 because rounding could make the
        // result negative.
        Vec3::new(
            clamp_cosine_to_nonnegative(rest.x),
            clamp_cosine_to_nonnegative(rest.y),
            clamp_cosine_to_nonnegative(rest.z),
        )
    }

    /// Smith terms for the directions to the viewer and to the light.
    #[inline(always)]
    fn view_and_light_smith_terms(&self, view: &PrincipledViewTerms, wi: Vec3) -> [SmithDirectionTerms; 2] {
        [
            SmithDirectionTerms::isotropic(GGX, view.normal, view.wo, self.alpha),
            SmithDirectionTerms::isotropic(GGX, view.normal, wi, self.alpha),
        ]
    }
}

impl<const THROUGH: bool> Bxdf for PrincipledBxdf<THROUGH> {
    type Point = PrincipledPoint;
    type View = PrincipledViewTerms;

    const IS_TRANSMISSION: bool = THROUGH;
    const ALWAYS: BxdfFlags = BxdfFlags::NARROW;

    #[inline(always)]
    fn new(point: &PrincipledPoint, _: Vec3) -> Self {
        let &PrincipledPoint { facets, grazing, transmission, alpha, .. } = point;
        Self {
            base: if THROUGH { point.transmitted_base } else { point.base },
            diffuse_albedos: point.diffuse_albedos,
            facets,
            grazing,
            dielectric: point.dielectric.0,
            dielectric_grazing: point.dielectric.1,
            transmission,
            alpha,
            terms: point.albedo.normal.terms,
            grazing_terms: point.albedo.grazing.terms,
        }
    }

    #[inline(always)]
    fn flags(&self) -> BxdfFlags {
        BxdfFlags::WIDE.when(self.base != Vec3::ZERO).union(TRANSMITS.when(self.transmission != Vec3::ZERO))
    }

    #[inline(always)]
    fn compute_view_terms(&self, directions: &ShadingGeometry, any: BxdfFlags) -> PrincipledViewTerms {
        let &ShadingGeometry { normal, wo, .. } = directions;
        let mirrored = wo - normal * (2.0 * normal.dot(wo));
        let wo = if THROUGH { mirrored } else { wo };
        let cosine = clamp_cosine_to_nonnegative(normal.dot(wo));
        let transmittance = self.one_minus_specular_albedo(cosine);
        let [at_normal, at_grazing] = self.f0_and_f90_albedos(cosine);
        let specular = self.facets.max_element() * at_normal + self.grazing * at_grazing;
        let [diffuse, through] = self.diffuse_albedos;
        let (diffuse, through) =
            (diffuse * transmittance.max_element(), through * transmittance.max_element());
        let mut all = specular + diffuse + through;
        let mut transmission = 0.0;
        if any.contains(TRANSMITS) {
            let rest = transmittance + Vec3::splat(at_normal + at_grazing - 1.0);
            transmission = clamp_cosine_to_nonnegative((self.transmission * rest).max_element());
            all += transmission;
        }
        let by_albedo = 1.0 / all.max(f32::MIN_POSITIVE);
        PrincipledViewTerms {
            normal,
            wo,
            transmittance,
            specular_probability: by_albedo * specular,
            transmission_probability: by_albedo * transmission,
            diffuse_transmission_probability: by_albedo * through,
        }
    }

    #[inline(always)]
    fn wide_lobe_value(&self, view: &PrincipledViewTerms, wi: Vec3, _: BxdfFlags) -> LobeValue {
        let cosine = view.normal.dot(wi);
        let transmittance =
            self.one_minus_specular_albedo(clamp_cosine_to_nonnegative(cosine)) * view.transmittance;
        let f = self.base * transmittance * if cosine > 0.0 { 1.0 } else { 0.0 };
        LobeValue { f, max: f.max_element(), shape: 0.0 }
    }

    #[inline(always)]
    fn narrow_lobe_value(&self, view: &PrincipledViewTerms, wi: Vec3, _: BxdfFlags) -> LobeValue {
        let half = UnnormalizedHalfVector::from_reflection(view.normal, view.wo, wi);
        let weight = schlick_weight(half.cosine_to_either_direction());
        let [eye, light] = self.view_and_light_smith_terms(view, wi);
        let white = eye.torrance_sparrow_without_fresnel(&light, half.isotropic_d(GGX, self.alpha));
        let f = if THROUGH {
            let (facets, grazing) = (self.dielectric, self.dielectric_grazing);
            let rest = Vec3::ONE - (facets + (Vec3::splat(grazing) - facets) * weight);
            self.transmission * rest * white
        } else {
            (self.facets + (Vec3::splat(self.grazing) - self.facets) * weight) * white
        };
        LobeValue { f, max: f.max_element(), shape: 0.0 }
    }

    #[inline(always)]
    fn pdf(
        &self,
        view: &PrincipledViewTerms,
        LobesWithNormal { lobes, normal }: LobesWithNormal,
        wi: Vec3,
        _: f32,
        _: BxdfFlags,
    ) -> f32 {
        let PrincipledViewTerms { specular_probability, transmission_probability, .. } = *view;
        let half = UnnormalizedHalfVector::from_reflection(view.normal, view.wo, wi);
        let [eye, light] = self.view_and_light_smith_terms(view, wi);
        let pdf = eye.reflection_pdf(half.isotropic_d(GGX, self.alpha));
        let specular = if light.is_direction_above_surface() { pdf } else { 0.0 };
        let narrow =
            if THROUGH { transmission_probability * specular } else { specular_probability * specular };
        match lobes {
            LobesToSample::All => {
                let through = view.diffuse_transmission_probability;
                let reflected = 1.0 - specular_probability - transmission_probability - through;
                let diffuse_probability = if THROUGH { through } else { reflected };
                narrow + diffuse_probability * clamp_cosine_to_nonnegative(normal.dot(wi)) * FRAC_1_PI
            }
            LobesToSample::Narrow => {
                narrow / (specular_probability + transmission_probability).max(f32::MIN_POSITIVE)
            }
        }
    }

    #[inline(always)]
    fn sample(
        &self,
        view: &PrincipledViewTerms,
        LobesWithNormal { lobes, normal }: LobesWithNormal,
        [choice, u @ ..]: [f32; 3],
        _: BxdfFlags,
    ) -> Vec3 {
        let PrincipledViewTerms { specular_probability, transmission_probability, .. } = *view;
        let choice = match lobes {
            LobesToSample::All => choice,
            LobesToSample::Narrow => choice * (specular_probability + transmission_probability),
        };
        // The lobes are in this order: specular, diffuse, diffuse transmission, specular transmission.
        let (last, diffuse_through) = match lobes {
            LobesToSample::All => (1.0 - transmission_probability, view.diffuse_transmission_probability),
            LobesToSample::Narrow => (specular_probability, 0.0),
        };
        let is_through =
            (transmission_probability + diffuse_through > 0.0) & (choice >= last - diffuse_through);
        let is_wide = match lobes {
            LobesToSample::All if THROUGH => choice < last,
            LobesToSample::All => choice >= specular_probability,
            LobesToSample::Narrow => false,
        };
        let narrow =
            sample_reflected_direction(GGX, &Frame::from_normal(view.normal), view.wo, [self.alpha; 2], u);
        let wide = direction_about_axis(normal, u[0].sqrt(), (1.0 - u[0]).sqrt(), u[1]);
        // If the path continues on the other side, this direction is not used.
        choose_vec3_by_bool(is_through == THROUGH, choose_vec3_by_bool(is_wide, wide, narrow), -view.normal)
    }

    #[inline(always)]
    fn narrow_lobe_probability(&self, view: &PrincipledViewTerms) -> f32 {
        view.specular_probability + view.transmission_probability
    }

    #[inline(always)]
    fn albedo_estimate(&self, _: &PrincipledViewTerms) -> f32 {
        let [diffuse, through] = self.diffuse_albedos;
        let reflects = (diffuse + through > 0.0) | (self.grazing > 0.0) | (self.facets != Vec3::ZERO);
        if reflects | (self.transmission != Vec3::ZERO) { 1.0 } else { 0.0 }
    }

    #[inline(always)]
    fn narrow_lobe(&self, view: &PrincipledViewTerms) -> Option<NarrowLobe> {
        let reflectance = self.facets.max_element();
        let wide = (self.base * view.transmittance).max_element();
        Some(NarrowLobe::from_microfacets(view.normal, view.wo, self.alpha, reflectance, wide))
    }
}
