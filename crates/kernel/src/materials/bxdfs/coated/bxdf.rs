//! The lobes of a material under a clear coat.

use super::CoatedPoint;
use crate::materials::bsdf::{BxdfParameters, LobesToSample, NarrowLobe};
use crate::materials::bxdf::{
    Bxdf, BxdfFlags, LobeValue, LobesWithNormal, ShadingGeometry, choose_vec3_by_bool,
};
use crate::materials::coat::{SchlickCoatLayer, clamp_cosine_to_nonnegative, interreflection_gain};
use crate::math::Vec3;
use crate::math::lanes::Mask;
use crate::math::soa::Soa;
use glimt_base::soa;

/// A layer over a base: a coat over the lobes of a material, or the view terms of both.
#[derive(Clone, Copy, Debug, Default)]
pub struct LayerOver<L, B> {
    layer: L,
    base: B,
}

/// A packet of [`LayerOver`].
#[derive(Clone, Debug)]
pub struct LayerOverPacket<L: Soa, B: Soa> {
    layer: L::Packet,
    base: B::Packet,
}

impl<L: Soa, B: Soa> Soa for LayerOver<L, B> {
    type Packet = LayerOverPacket<L, B>;

    #[inline(always)]
    fn splat(self) -> Self::Packet {
        LayerOverPacket { layer: self.layer.splat(), base: self.base.splat() }
    }

    #[inline(always)]
    fn get(packet: &Self::Packet, i: usize) -> Self {
        Self { layer: L::get(&packet.layer, i), base: B::get(&packet.base, i) }
    }

    #[inline(always)]
    fn set(self, packet: &mut Self::Packet, i: usize) {
        self.layer.set(&mut packet.layer, i);
        self.base.set(&mut packet.base, i);
    }

    #[inline(always)]
    fn select(mask: &Mask, new: &Self::Packet, target: &mut Self::Packet) {
        L::select(mask, &new.layer, &mut target.layer);
        B::select(mask, &new.base, &mut target.base);
    }
}

/// A BSDF under a clear coat.
pub type CoatedBxdf<B> = LayerOver<ClearCoat, B>;

soa! {
    /// A clear coat, and the interreflection with its base.
    pub struct ClearCoat in ClearCoatPacket {
        /// The coat.
        coat: SchlickCoatLayer = SchlickCoatLayer::default(),
        /// Factor for the wide lobes of the base.
        wide_gain: Vec3 = Vec3::ONE,
        /// Reflectance of the narrow lobes of the base.
        narrow_reflectance: Vec3 = Vec3::ZERO,
    }
}

soa! {
    /// View-dependent values of a clear coat.
    pub struct CoatViewTerms in CoatViewPacket {
        /// Unit normal on the lit side.
        normal: Vec3 = Vec3::Z,
        /// Unit direction to the viewer, mirrored to the lit side for transmitted light.
        wo: Vec3 = Vec3::Z,
        /// Fraction of light that the coat transmits toward the viewer, excluding absorption.
        transmittance: f32 = 1.0,
        /// Length of the path through the layer toward the viewer.
        path_length: f32 = 1.0,
        /// Probability of choosing the coat's lobe.
        coat_probability: f32 = 0.0,
        /// Probability of choosing a narrow lobe if the base is chosen.
        base_narrow_lobe_probability: f32 = 1.0,
    }
}

/// Set if a coat absorbs light.
const ABSORBS: BxdfFlags = BxdfFlags(1 << 31);

/// Probabilities for the choice between the coat and the base.
struct CoatOrBaseProbabilities {
    /// Probability of choosing the coat.
    coat: f32,
    /// Probability of choosing the base.
    base: f32,
}

impl CoatOrBaseProbabilities {
    /// The probabilities if `lobes` are sampled.
    #[inline(always)]
    fn new(view: &CoatViewTerms, lobes: LobesToSample) -> Self {
        let base = 1.0 - view.coat_probability;
        match lobes {
            LobesToSample::All => Self { coat: view.coat_probability, base },
            LobesToSample::Narrow => {
                let narrow = base * view.base_narrow_lobe_probability;
                let all = (view.coat_probability + narrow).max(f32::MIN_POSITIVE);
                Self { coat: view.coat_probability / all, base: narrow / all }
            }
        }
    }
}

impl<B: Bxdf> CoatedBxdf<B> {
    /// Cosine between the normal and the light, and the coat's albedo for this direction.
    #[inline(always)]
    fn light_cosine_and_albedo(&self, view: &CoatViewTerms, wi: Vec3) -> (f32, f32) {
        let cosine = view.normal.dot(wi);
        (cosine, self.layer.coat.albedo(clamp_cosine_to_nonnegative(cosine)))
    }

    /// Transmittance of the coat, in and out together, or 0 for light from behind.
    #[inline(always)]
    fn two_way_transmittance(&self, view: &CoatViewTerms, wi: Vec3, any: BxdfFlags) -> Vec3 {
        let (cosine, albedo) = self.light_cosine_and_albedo(view, wi);
        let both = if cosine > 0.0 { view.transmittance * (1.0 - albedo) } else { 0.0 };
        if any.contains(ABSORBS) {
            let length = view.path_length + self.layer.coat.path_length(clamp_cosine_to_nonnegative(cosine));
            self.layer.coat.absorption_transmittance(length) * both
        } else {
            Vec3::splat(both)
        }
    }
}

impl<B: Bxdf> Bxdf for CoatedBxdf<B> {
    type Point = CoatedPoint<B::Point>;
    type View = LayerOver<CoatViewTerms, B::View>;

    const IS_TRANSMISSION: bool = B::IS_TRANSMISSION;
    const CHOOSES_SIDE: bool = B::CHOOSES_SIDE;
    const ALWAYS: BxdfFlags = BxdfFlags::NARROW.union(B::ALWAYS);
    const SPLITS_NARROW: BxdfFlags = B::SPLITS_NARROW;

    #[inline(always)]
    fn new(point: &Self::Point, tangent: Vec3) -> Self {
        let [wide, narrow_reflectance] = point.base.interreflection_reflectances();
        let wide_gain = interreflection_gain(wide, point.coat.weight * point.coat.albedo.mean);
        let coat = SchlickCoatLayer::from(&point.coat);
        let layer = ClearCoat { coat, wide_gain, narrow_reflectance };
        Self { layer, base: B::new(&point.base, tangent) }
    }

    #[inline(always)]
    fn flags(&self) -> BxdfFlags {
        ABSORBS.when(self.layer.coat.extinction != Vec3::ZERO).union(self.base.flags())
    }

    #[inline(always)]
    fn is_black(&self) -> bool {
        (self.layer.coat.weight == 0.0) & self.base.is_black()
    }

    #[inline(always)]
    fn compute_view_terms(&self, directions: &ShadingGeometry, any: BxdfFlags) -> Self::View {
        let &ShadingGeometry { normal, wo, .. } = directions;
        let mirrored = wo - normal * (2.0 * normal.dot(wo));
        let wo = if B::IS_TRANSMISSION { mirrored } else { wo };
        let cosine = clamp_cosine_to_nonnegative(normal.dot(wo));
        let base = self.base.compute_view_terms(directions, any);
        let albedo = self.layer.coat.albedo(cosine);
        let below = (1.0 - albedo) * self.base.albedo_estimate(&base);
        let layer = CoatViewTerms {
            normal,
            wo,
            transmittance: 1.0 - albedo,
            path_length: self.layer.coat.path_length(cosine),
            coat_probability: albedo / (albedo + below).max(f32::MIN_POSITIVE),
            base_narrow_lobe_probability: self.base.narrow_lobe_probability(&base),
        };
        LayerOver { layer, base }
    }

    #[inline(always)]
    fn wide_lobe_value(&self, view: &Self::View, wi: Vec3, any: BxdfFlags) -> LobeValue {
        let base = self.base.wide_lobe_value(&view.base, wi, any);
        let f = base.f * self.layer.wide_gain * self.two_way_transmittance(&view.layer, wi, any);
        LobeValue { f, max: f.max_element(), shape: base.shape }
    }

    #[inline(always)]
    fn narrow_lobe_value(&self, view: &Self::View, wi: Vec3, any: BxdfFlags) -> LobeValue {
        let base = self.base.narrow_lobe_value(&view.base, wi, any);
        let (_, albedo) = self.light_cosine_and_albedo(&view.layer, wi);
        let returned = albedo.min(1.0 - view.layer.transmittance);
        let gain = interreflection_gain(self.layer.narrow_reflectance, returned);
        let mut f = base.f * gain * self.two_way_transmittance(&view.layer, wi, any);
        if !B::IS_TRANSMISSION {
            f += Vec3::splat(self.layer.coat.lobe_f(view.layer.normal, view.layer.wo, wi));
        }
        LobeValue { f, max: f.max_element(), shape: base.shape }
    }

    #[inline(always)]
    fn pdf(&self, view: &Self::View, from: LobesWithNormal, wi: Vec3, shape: f32, any: BxdfFlags) -> f32 {
        let CoatViewTerms { normal, wo, .. } = view.layer;
        let choice = CoatOrBaseProbabilities::new(&view.layer, from.lobes);
        let base = choice.base * self.base.pdf(&view.base, from, wi, shape, any);
        // The pdf of a black base is undefined.
        let base = if choice.base > 0.0 { base } else { 0.0 };
        if B::IS_TRANSMISSION { base } else { base + choice.coat * self.layer.coat.pdf(normal, wo, wi) }
    }

    #[inline(always)]
    fn sample(
        &self,
        view: &Self::View,
        from: LobesWithNormal,
        [choice, u @ ..]: [f32; 3],
        any: BxdfFlags,
    ) -> Vec3 {
        let CoatViewTerms { normal, wo, .. } = view.layer;
        let CoatOrBaseProbabilities { coat, base } = CoatOrBaseProbabilities::new(&view.layer, from.lobes);
        // Remap the random number to choose among the base's lobes.
        let rest = (choice - coat) / base.max(f32::MIN_POSITIVE);
        let rest = clamp_cosine_to_nonnegative(rest).min(1.0 - f32::EPSILON);
        let below = self.base.sample(&view.base, from, [rest, u[0], u[1]], any);
        // This direction is unused if the path continues on the other side.
        let coated = if B::IS_TRANSMISSION { -normal } else { self.layer.coat.sample(normal, wo, u) };
        choose_vec3_by_bool(choice < coat, coated, below)
    }

    #[inline(always)]
    fn narrow_lobe(&self, view: &Self::View) -> Option<NarrowLobe> {
        let CoatViewTerms { normal, wo, transmittance, .. } = view.layer;
        if self.base.flags().union(B::ALWAYS).contains(BxdfFlags::NARROW) {
            return self.base.narrow_lobe(&view.base);
        }
        let reflectance =
            self.layer.coat.weight * self.layer.coat.fresnel(clamp_cosine_to_nonnegative(normal.dot(wo)));
        let wide = self.base.wide_lobe_value(&view.base, normal, BxdfFlags::WIDE).max * transmittance;
        Some(NarrowLobe::from_microfacets(normal, wo, self.layer.coat.alpha, reflectance, wide))
    }
}
