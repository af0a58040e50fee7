//! The lobes of rough glass.

use super::RoughDielectricPoint;
use crate::materials::bsdf::NarrowLobe;
use crate::materials::bxdf::{
    Bxdf, BxdfFlags, LobeValue, LobesWithNormal, ShadingGeometry, choose_vec3_by_bool,
};
use crate::materials::fresnel::{fresnel_dielectric_any_eta, fresnel_transmittance};
use crate::materials::microfacet::{
    MicrofacetDistribution, SmithDirectionTerms, UnnormalizedHalfVector, reflect_at, refract_at,
    sample_visible_normal,
};
use crate::math::Vec3;
use crate::math::frame::Frame;
use glimt_base::soa;

soa! {
    /// Reflection from rough glass, or transmission through it, with the GGX or the Beckmann distribution.
    pub struct DielectricBxdf<const THROUGH: bool, const BECKMANN: bool> in DielectricPacket {
        /// [`RoughDielectricPoint::near`].
        near: f32 = 1.0,
        /// [`RoughDielectricPoint::far`].
        far: f32 = 1.5,
        /// [`RoughDielectricPoint::alpha`].
        alpha: f32 = 1.0,
    }
}

soa! {
    /// View-dependent values of rough glass.
    pub struct DielectricViewTerms in DielectricViewPacket {
        /// Unit normal that faces the viewer.
        normal: Vec3 = Vec3::Z,
        /// Unit direction to the viewer.
        wo: Vec3 = Vec3::Z,
    }
}

/// Minimum cosine between a facet's normal and a direction.
const MIN_COSINE: f32 = 1e-6;

/// A sampled direction on either side of rough glass.
#[derive(Clone, Copy, Debug)]
pub struct DielectricSample {
    /// Unit direction.
    pub wi: Vec3,
    /// Pdf of the direction in sr⁻¹, or 0 for directions from which no light arrives.
    pub pdf: f32,
    /// f·cosθ of the lobe divided by the pdf.
    pub weight: f32,
    /// Whether the direction and the BSDF's light are on opposite sides.
    pub is_beyond: bool,
}

impl<const THROUGH: bool, const BECKMANN: bool> DielectricBxdf<THROUGH, BECKMANN> {
    const DISTRIBUTION: MicrofacetDistribution = MicrofacetDistribution::ggx_or_beckmann(BECKMANN);

    /// Smith terms for the directions to the viewer and to the light. Each direction uses the normal on its
    /// side.
    #[inline(always)]
    fn view_and_light_smith_terms(&self, view: &DielectricViewTerms, wi: Vec3) -> [SmithDirectionTerms; 2] {
        let lit = if THROUGH { -view.normal } else { view.normal };
        [
            SmithDirectionTerms::isotropic(Self::DISTRIBUTION, view.normal, view.wo, self.alpha),
            SmithDirectionTerms::isotropic(Self::DISTRIBUTION, lit, wi, self.alpha),
        ]
    }

    /// Samples the normal of a visible facet.
    #[inline(always)]
    fn sample_facet_normal(&self, view: &DielectricViewTerms, u: [f32; 2]) -> Vec3 {
        let frame = Frame::from_normal(view.normal);
        sample_visible_normal(Self::DISTRIBUTION, &frame, view.wo, [self.alpha; 2], u)
    }

    /// f of the lobe.
    #[inline(always)]
    fn f(&self, view: &DielectricViewTerms, wi: Vec3) -> f32 {
        let [eye, light] = self.view_and_light_smith_terms(view, wi);
        if !THROUGH {
            let half = UnnormalizedHalfVector::from_reflection(view.normal, view.wo, wi);
            let reflectance =
                fresnel_dielectric_any_eta(half.cosine_to_either_direction(), self.far / self.near);
            return reflectance
                * eye.torrance_sparrow_without_fresnel(
                    &light,
                    half.isotropic_d(Self::DISTRIBUTION, self.alpha),
                );
        }
        let indices = [self.near, self.far];
        let (half, sum) = UnnormalizedHalfVector::from_refraction(view.normal, [view.wo, wi], indices);
        // The facet must face the viewer, as the surface does, and light must arrive from behind the facet.
        let scale = if half.along > 0.0 { 1.0 } else { -1.0 } / half.squared.sqrt();
        let cosines = [scale * view.wo.dot(sum), -scale * wi.dot(sum)];
        let is_through = (cosines[0] > MIN_COSINE) & (cosines[1] > MIN_COSINE);
        let by_facet = cosines[0] * cosines[1] * fresnel_transmittance(cosines, indices) / half.squared;
        let value = 4.0
            * (by_facet
                * eye.torrance_sparrow_without_fresnel(
                    &light,
                    half.isotropic_d(Self::DISTRIBUTION, self.alpha),
                ));
        let value = value * (self.far * self.far);
        // If the indices are nearly equal, there is no usable half vector.
        if is_through & (value < f32::MAX) { value } else { 0.0 }
    }

    /// Samples a facet, and randomly chooses reflection or refraction. All formulas use the facet's normal,
    /// which is the half vector in both cases.
    #[inline(always)]
    pub fn sample_reflection_or_transmission(
        &self,
        view: &DielectricViewTerms,
        choice: f32,
        u: [f32; 2],
    ) -> DielectricSample {
        let &DielectricViewTerms { normal, wo } = view;
        let half = self.sample_facet_normal(view, u);
        let indices = [self.near, self.far];
        let eta = indices[1] / indices[0];
        let cosine = half.dot(wo);
        let reflectance = fresnel_dielectric_any_eta(cosine, eta);
        let is_reflected = choice < reflectance;
        let refracted = refract_at(half, wo, eta);
        let wi = choose_vec3_by_bool(is_reflected, reflect_at(half, wo), refracted);
        // Compute the facet's scattering per solid angle.
        let behind = -half.dot(refracted);
        let sum = indices[0] * cosine - indices[1] * behind;
        let through =
            4.0 * (cosine * behind * fresnel_transmittance([cosine, behind], indices) / (sum * sum));
        let by_facet = if is_reflected { reflectance } else { through * (indices[1] * indices[1]) };
        let is_through = (cosine > MIN_COSINE) & (behind > MIN_COSINE);
        // Light on the wrong side of the surface does not contribute.
        let eye = SmithDirectionTerms::isotropic(Self::DISTRIBUTION, normal, wo, self.alpha);
        let side = if is_reflected { 1.0 } else { -1.0 };
        let light = SmithDirectionTerms::isotropic(Self::DISTRIBUTION, normal * side, wi, self.alpha);
        let along = normal.dot(half);
        let half = UnnormalizedHalfVector { squared: 1.0, along, across: half - normal * along };
        let pdf = by_facet * eye.reflection_pdf(half.isotropic_d(Self::DISTRIBUTION, self.alpha));
        let is_seen = light.is_direction_above_surface()
            & eye.is_direction_above_surface()
            & (is_reflected | is_through)
            & (pdf < f32::MAX);
        let weight =
            light.cosine * (eye.cosine + eye.slope) / (eye.cosine * light.slope + light.cosine * eye.slope);
        DielectricSample {
            wi,
            pdf: if is_seen { pdf } else { 0.0 },
            weight: if is_seen { weight } else { 0.0 },
            is_beyond: is_reflected == THROUGH,
        }
    }
}

impl<const THROUGH: bool, const BECKMANN: bool> Bxdf for DielectricBxdf<THROUGH, BECKMANN> {
    type Point = RoughDielectricPoint;
    type View = DielectricViewTerms;

    const IS_TRANSMISSION: bool = THROUGH;
    const ALWAYS: BxdfFlags = BxdfFlags::NARROW;

    #[inline(always)]
    fn new(point: &RoughDielectricPoint, _: Vec3) -> Self {
        let &RoughDielectricPoint { near, far, alpha, .. } = point;
        Self { near, far, alpha }
    }

    #[inline(always)]
    fn flags(&self) -> BxdfFlags {
        BxdfFlags::default()
    }

    #[inline(always)]
    fn compute_view_terms(&self, directions: &ShadingGeometry, _: BxdfFlags) -> DielectricViewTerms {
        let &ShadingGeometry { normal, wo, .. } = directions;
        DielectricViewTerms { normal: if THROUGH { -normal } else { normal }, wo }
    }

    #[inline(always)]
    fn narrow_lobe_value(&self, view: &DielectricViewTerms, wi: Vec3, _: BxdfFlags) -> LobeValue {
        let f = self.f(view, wi);
        LobeValue { f: Vec3::splat(f), max: f, shape: f }
    }

    #[inline(always)]
    fn pdf(&self, view: &DielectricViewTerms, _: LobesWithNormal, wi: Vec3, shape: f32, _: BxdfFlags) -> f32 {
        let [eye, light] = self.view_and_light_smith_terms(view, wi);
        eye.pdf_from_reflection_term(&light, shape)
    }

    #[inline(always)]
    fn sample(
        &self,
        view: &DielectricViewTerms,
        _: LobesWithNormal,
        [choice, u @ ..]: [f32; 3],
        _: BxdfFlags,
    ) -> Vec3 {
        let half = self.sample_facet_normal(view, u);
        let eta = self.far / self.near;
        let is_reflected = choice < fresnel_dielectric_any_eta(half.dot(view.wo), eta);
        let wi = if THROUGH { refract_at(half, view.wo, eta) } else { reflect_at(half, view.wo) };
        // If the other side is chosen, the path continues at that side's vertex, and this direction is not
        // used.
        let unused = if THROUGH { view.normal } else { -view.normal };
        choose_vec3_by_bool(is_reflected == THROUGH, unused, wi)
    }

    #[inline(always)]
    fn narrow_lobe(&self, view: &DielectricViewTerms) -> Option<NarrowLobe> {
        let &DielectricViewTerms { normal, wo } = view;
        let eta = self.far / self.near;
        let reflectance = fresnel_dielectric_any_eta(normal.dot(wo), eta);
        if !THROUGH {
            return Some(NarrowLobe::from_microfacets(normal, wo, self.alpha, reflectance, 0.0));
        }
        // At normal incidence, rotating a facet by an angle rotates the refracted direction by 1 − 1/η times
        // this angle, and a reflected direction by twice this angle.
        let alpha = 0.5 * (1.0 - 1.0 / eta).abs() * self.alpha;
        let axis = refract_at(normal, wo, eta);
        let lobe = NarrowLobe { axis, ..NarrowLobe::from_microfacets(normal, wo, alpha, 1.0, 0.0) };
        (reflectance < 1.0).then_some(lobe)
    }
}
