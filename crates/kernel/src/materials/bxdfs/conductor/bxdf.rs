//! The lobe of a conductor.

use super::{ConductorPoint, FresnelPoint, reflectance};
use crate::materials::bsdf::NarrowLobe;
use crate::materials::bxdf::{Bxdf, BxdfFlags, LobeValue, LobesWithNormal, ShadingGeometry};
use crate::materials::fresnel::schlick_weight;
use crate::materials::microfacet::{
    MicrofacetDistribution, SmithDirectionTerms, UnnormalizedHalfVector, frame_with_tangent,
    sample_reflected_direction,
};
use crate::math::Vec3;
use crate::math::frame::Frame;
use glimt_base::soa;

soa! {
    /// A conductor, either isotropic or brushed along u, with the GGX or the Beckmann distribution.
    pub struct ConductorBxdf<const BRUSHED: bool, const BECKMANN: bool> in ConductorPacket {
        /// α along u and along v.
        alphas: [f32; 2] = [1.0; 2],
        /// [`FresnelPoint::first`].
        first: Vec3 = Vec3::ZERO,
        /// [`FresnelPoint::second`].
        second: Vec3 = Vec3::NEG_ONE,
    }
}

soa! {
    /// View-dependent values of a conductor.
    pub struct ConductorViewTerms in ConductorViewPacket {
        /// Unit normal that faces the viewer.
        normal: Vec3 = Vec3::Z,
        /// Unit direction to the viewer.
        wo: Vec3 = Vec3::Z,
        /// Direction of u, which is arbitrary for isotropic surfaces.
        tangent: Vec3 = Vec3::X,
    }
}

/// Set if the conductor has an index of refraction instead of a color.
const HAS_INDEX: BxdfFlags = BxdfFlags(1 << BxdfFlags::FIRST_OWN);

impl<const BRUSHED: bool, const BECKMANN: bool> ConductorBxdf<BRUSHED, BECKMANN> {
    const DISTRIBUTION: MicrofacetDistribution = MicrofacetDistribution::ggx_or_beckmann(BECKMANN);

    #[inline(always)]
    fn frame(view: &ConductorViewTerms) -> Frame {
        if BRUSHED { frame_with_tangent(view.normal, view.tangent) } else { Frame::from_normal(view.normal) }
    }

    /// Smith terms for the directions to the viewer and to the light.
    #[inline(always)]
    fn view_and_light_smith_terms(&self, view: &ConductorViewTerms, wi: Vec3) -> [SmithDirectionTerms; 2] {
        if BRUSHED {
            let frame = Self::frame(view);
            [
                SmithDirectionTerms::anisotropic(Self::DISTRIBUTION, &frame, view.wo, self.alphas),
                SmithDirectionTerms::anisotropic(Self::DISTRIBUTION, &frame, wi, self.alphas),
            ]
        } else {
            let alpha = self.alphas[0];
            [
                SmithDirectionTerms::isotropic(Self::DISTRIBUTION, view.normal, view.wo, alpha),
                SmithDirectionTerms::isotropic(Self::DISTRIBUTION, view.normal, wi, alpha),
            ]
        }
    }
}

impl<const BRUSHED: bool, const BECKMANN: bool> Bxdf for ConductorBxdf<BRUSHED, BECKMANN> {
    type Point = ConductorPoint;
    type View = ConductorViewTerms;

    const ALWAYS: BxdfFlags = BxdfFlags::NARROW;
    const SPLITS_NARROW: BxdfFlags = HAS_INDEX;

    #[inline(always)]
    fn new(point: &ConductorPoint, tangent: Vec3) -> Self {
        // Without texture coordinates, the surface is isotropic, and its α is the geometric mean of the two α
        // values.
        let [u, v] = point.alphas;
        let mean = (u * v).sqrt();
        let alphas = if tangent == Vec3::ZERO { [mean; 2] } else { [u, v] };
        let FresnelPoint { first, second } = point.fresnel;
        Self { alphas, first, second }
    }

    #[inline(always)]
    fn flags(&self) -> BxdfFlags {
        HAS_INDEX.when(self.second.x >= 0.0)
    }

    #[inline(always)]
    fn compute_view_terms(&self, directions: &ShadingGeometry, _: BxdfFlags) -> ConductorViewTerms {
        let &ShadingGeometry { normal, wo, tangent } = directions;
        ConductorViewTerms { normal, wo, tangent }
    }

    #[inline(always)]
    fn narrow_lobe_value(&self, view: &ConductorViewTerms, wi: Vec3, any: BxdfFlags) -> LobeValue {
        let half = UnnormalizedHalfVector::from_reflection(view.normal, view.wo, wi);
        let distribution = if BRUSHED {
            half.anisotropic_d(Self::DISTRIBUTION, &Self::frame(view), self.alphas)
        } else {
            half.isotropic_d(Self::DISTRIBUTION, self.alphas[0])
        };
        let [eye, light] = self.view_and_light_smith_terms(view, wi);
        let white = eye.torrance_sparrow_without_fresnel(&light, distribution);
        let cosine = half.cosine_to_either_direction();
        let weight = schlick_weight(cosine);
        let f = if any.contains(HAS_INDEX) {
            let (first, second) = (self.first, self.second);
            Vec3::new(
                white * reflectance(first.x, second.x, cosine, weight),
                white * reflectance(first.y, second.y, cosine, weight),
                white * reflectance(first.z, second.z, cosine, weight),
            )
        } else {
            (self.first + (Vec3::ONE - self.first) * weight) * white
        };
        LobeValue { f, max: f.max_element(), shape: white }
    }

    #[inline(always)]
    fn pdf(&self, view: &ConductorViewTerms, _: LobesWithNormal, wi: Vec3, shape: f32, _: BxdfFlags) -> f32 {
        let [eye, light] = self.view_and_light_smith_terms(view, wi);
        eye.pdf_from_reflection_term(&light, shape)
    }

    #[inline(always)]
    fn sample(
        &self,
        view: &ConductorViewTerms,
        _: LobesWithNormal,
        [_, u @ ..]: [f32; 3],
        _: BxdfFlags,
    ) -> Vec3 {
        sample_reflected_direction(Self::DISTRIBUTION, &Self::frame(view), view.wo, self.alphas, u)
    }

    #[inline(always)]
    fn narrow_lobe(&self, view: &ConductorViewTerms) -> Option<NarrowLobe> {
        let alpha = self.alphas[0].max(self.alphas[1]);
        Some(NarrowLobe::from_microfacets(view.normal, view.wo, alpha, 1.0, 0.0))
    }
}
