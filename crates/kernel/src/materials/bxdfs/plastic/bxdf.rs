//! The lobes of plastic.

use std::f32::consts::{FRAC_1_PI, PI};

use super::{PlasticPoint, base_layer_f};
use crate::materials::bsdf::{LobesToSample, NarrowLobe};
use crate::materials::bxdf::{
    Bxdf, BxdfFlags, LobeValue, LobesWithNormal, ShadingGeometry, choose_vec3_by_bool,
};
use crate::materials::coat::{CoatLayer, clamp_cosine_to_nonnegative};
use crate::materials::phong::lobes::direction_about_axis;
use crate::math::Vec3;
use glimt_base::soa;

soa! {
    /// A diffuse base under a microfacet coat, with the GGX or the Beckmann distribution.
    pub struct PlasticBxdf<const BECKMANN: bool> in PlasticPacket {
        /// [`PlasticPoint::base`].
        base: Vec3 = Vec3::ZERO,
        /// [`PlasticPoint::specular`].
        specular: Vec3 = Vec3::ZERO,
        /// The coat. Its α is 1 if it is smooth.
        coat: CoatLayer<true, BECKMANN> = CoatLayer::default(),
        /// Mean albedo of the coat.
        mean: f32 = 0.0,
        /// [`PlasticPoint::alpha`].
        alpha: f32 = 1.0,
    }
}

soa! {
    /// View-dependent values of plastic.
    pub struct PlasticViewTerms in PlasticViewPacket {
        /// Unit normal that faces the viewer.
        normal: Vec3 = Vec3::Z,
        /// Unit direction to the viewer.
        wo: Vec3 = Vec3::Z,
        /// Fraction of the light that the coat transmits toward the viewer.
        transmittance: f32 = 1.0,
        /// Probability of choosing the coat's lobe.
        coat_probability: f32 = 0.0,
    }
}

/// Set if the coat is smooth.
const HAS_SMOOTH_COAT: BxdfFlags = BxdfFlags(1 << BxdfFlags::FIRST_OWN);

impl<const BECKMANN: bool> PlasticBxdf<BECKMANN> {
    /// Albedo of the coat at a cosine ≥ 0.
    #[inline(always)]
    fn coat_albedo(&self, cosine: f32, any: BxdfFlags) -> f32 {
        let rough = self.coat.albedo(cosine);
        if any.contains(HAS_SMOOTH_COAT) {
            let smooth = self.coat.fresnel(cosine);
            if self.alpha == 0.0 { smooth } else { rough }
        } else {
            rough
        }
    }

    /// The coat's transmittance in both directions, or 0 for light from behind.
    #[inline(always)]
    fn two_way_coat_transmittance(&self, view: &PlasticViewTerms, wi: Vec3, any: BxdfFlags) -> f32 {
        let cosine = view.normal.dot(wi);
        let entering = 1.0 - self.coat_albedo(clamp_cosine_to_nonnegative(cosine), any);
        if cosine > 0.0 { view.transmittance * entering } else { 0.0 }
    }
}

impl<const BECKMANN: bool> Bxdf for PlasticBxdf<BECKMANN> {
    type Point = PlasticPoint;
    type View = PlasticViewTerms;

    const ALWAYS: BxdfFlags = BxdfFlags::WIDE;

    #[inline(always)]
    fn new(point: &PlasticPoint, _: Vec3) -> Self {
        let &PlasticPoint { base, specular, ior, alpha, albedo, .. } = point;
        let width = if alpha > 0.0 { alpha } else { 1.0 };
        let coat = CoatLayer { weight: 1.0, alpha: width, ior, terms: albedo.terms, ..CoatLayer::default() };
        Self { base, specular, coat, mean: albedo.mean, alpha }
    }

    #[inline(always)]
    fn set_looked_up_color(&mut self, point: &PlasticPoint, color: Vec3) {
        self.base = base_layer_f(color.min(Vec3::ONE), point.ior, &point.albedo, point.is_linear);
    }

    #[inline(always)]
    fn flags(&self) -> BxdfFlags {
        BxdfFlags::NARROW.when(self.alpha > 0.0).union(HAS_SMOOTH_COAT.when(self.alpha == 0.0))
    }

    #[inline(always)]
    fn is_black(&self) -> bool {
        (self.base == Vec3::ZERO) & (self.specular == Vec3::ZERO)
    }

    #[inline(always)]
    fn compute_view_terms(&self, directions: &ShadingGeometry, any: BxdfFlags) -> PlasticViewTerms {
        let &ShadingGeometry { normal, wo, .. } = directions;
        let albedo = self.coat_albedo(clamp_cosine_to_nonnegative(normal.dot(wo)), any);
        let diffuse = (1.0 - albedo) * (1.0 - self.mean) * PI * self.base.max_element();
        let coat = albedo * self.specular.max_element();
        let coat_probability = coat / (coat + diffuse).max(f32::MIN_POSITIVE);
        PlasticViewTerms { normal, wo, transmittance: 1.0 - albedo, coat_probability }
    }

    #[inline(always)]
    fn wide_lobe_value(&self, view: &PlasticViewTerms, wi: Vec3, any: BxdfFlags) -> LobeValue {
        let transmittance = self.two_way_coat_transmittance(view, wi, any);
        let max = self.base.max_element() * transmittance;
        LobeValue { f: self.base * transmittance, max, shape: 0.0 }
    }

    #[inline(always)]
    fn narrow_lobe_value(&self, view: &PlasticViewTerms, wi: Vec3, _: BxdfFlags) -> LobeValue {
        let coat = self.coat.lobe_f(view.normal, view.wo, wi);
        LobeValue { f: self.specular * coat, max: self.specular.max_element() * coat, shape: 0.0 }
    }

    #[inline(always)]
    fn pdf(
        &self,
        view: &PlasticViewTerms,
        LobesWithNormal { lobes, normal }: LobesWithNormal,
        wi: Vec3,
        _: f32,
        any: BxdfFlags,
    ) -> f32 {
        let mut coat = 0.0;
        if any.contains(BxdfFlags::NARROW) {
            let pdf = self.coat.pdf(view.normal, view.wo, wi);
            coat = if self.alpha > 0.0 { pdf } else { 0.0 };
        }
        let diffuse = clamp_cosine_to_nonnegative(normal.dot(wi)) * FRAC_1_PI;
        match lobes {
            LobesToSample::All => view.coat_probability * coat + (1.0 - view.coat_probability) * diffuse,
            LobesToSample::Narrow => coat,
        }
    }

    #[inline(always)]
    fn sample(
        &self,
        view: &PlasticViewTerms,
        LobesWithNormal { lobes, normal }: LobesWithNormal,
        [choice, u @ ..]: [f32; 3],
        any: BxdfFlags,
    ) -> Vec3 {
        let diffuse = direction_about_axis(normal, u[0].sqrt(), (1.0 - u[0]).sqrt(), u[1]);
        if !any.contains(BxdfFlags::NARROW) {
            return diffuse;
        }
        let coat = self.coat.sample(view.normal, view.wo, u);
        let is_coat = match lobes {
            LobesToSample::All => choice < view.coat_probability,
            LobesToSample::Narrow => self.alpha > 0.0,
        };
        choose_vec3_by_bool(is_coat, coat, diffuse)
    }

    #[inline(always)]
    fn narrow_lobe_probability(&self, view: &PlasticViewTerms) -> f32 {
        view.coat_probability
    }

    #[inline(always)]
    fn albedo_estimate(&self, view: &PlasticViewTerms) -> f32 {
        let diffuse = view.transmittance * (1.0 - self.mean) * PI * self.base.max_element();
        (1.0 - view.transmittance) * self.specular.max_element() + diffuse
    }

    #[inline(always)]
    fn narrow_lobe(&self, view: &PlasticViewTerms) -> Option<NarrowLobe> {
        let reflectance = self.coat.fresnel(view.normal.dot(view.wo)) * self.specular.max_element();
        let wide = view.transmittance * self.base.max_element() * (1.0 - self.mean);
        Some(NarrowLobe::from_microfacets(view.normal, view.wo, self.coat.alpha, reflectance, wide))
    }
}
