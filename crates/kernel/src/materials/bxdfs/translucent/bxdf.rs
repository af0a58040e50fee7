//! The lobes of a translucent Phong surface.

use std::f32::consts::{FRAC_1_PI, PI};

use super::TranslucentPoint;
use crate::materials::bsdf::{LobesToSample, NarrowLobe};
use crate::materials::bxdf::{
    Bxdf, BxdfFlags, LobeValue, LobesWithNormal, ShadingGeometry, choose_vec3_by_bool,
};
use crate::materials::phong::lobes::direction_about_axis;
use crate::materials::phong::{PhongBxdf, PhongViewTerms};
use crate::math::Vec3;
use glimt_base::soa;

soa! {
    /// Reflection from a translucent surface, or transmission through it.
    pub struct TranslucentBxdf<const THROUGH: bool> in TranslucentPacket {
        /// The reflecting lobes.
        reflection: PhongBxdf = PhongBxdf::default(),
        /// f of transmitted light in sr⁻¹.
        transmission: Vec3 = Vec3::ZERO,
        /// Probability that a path continues on the other side.
        transmission_probability: f32 = 0.0,
    }
}

impl<const THROUGH: bool> Bxdf for TranslucentBxdf<THROUGH> {
    type Point = TranslucentPoint;
    type View = PhongViewTerms;

    const TURNS_NORMALS: bool = false;
    const IS_TRANSMISSION: bool = THROUGH;
    const CHOOSES_SIDE: bool = true;
    const SENDS_RAYS: bool = false;
    const HAS_CONSTANT_WIDE: bool = true;
    const ALWAYS: BxdfFlags = BxdfFlags::WIDE;

    #[inline(always)]
    fn new(point: &TranslucentPoint, tangent: Vec3) -> Self {
        Self {
            reflection: PhongBxdf::new(&point.reflection, tangent),
            transmission: point.transmission_f(),
            transmission_probability: point.transmission_probability(),
        }
    }

    #[inline(always)]
    fn flags(&self) -> BxdfFlags {
        if THROUGH { BxdfFlags::default() } else { self.reflection.flags() }
    }

    #[inline(always)]
    fn is_black(&self) -> bool {
        self.reflection.is_black() & (self.transmission == Vec3::ZERO)
    }

    #[inline(always)]
    fn compute_view_terms(&self, directions: &ShadingGeometry, any: BxdfFlags) -> PhongViewTerms {
        self.reflection.compute_view_terms(directions, any)
    }

    #[inline(always)]
    fn wide_lobe_value(&self, view: &PhongViewTerms, wi: Vec3, any: BxdfFlags) -> LobeValue {
        if THROUGH {
            LobeValue { f: self.transmission, max: self.transmission.max_element(), shape: 0.0 }
        } else {
            self.reflection.wide_lobe_value(view, wi, any)
        }
    }

    #[inline(always)]
    fn narrow_lobe_value(&self, view: &PhongViewTerms, wi: Vec3, any: BxdfFlags) -> LobeValue {
        if THROUGH { LobeValue::ZERO } else { self.reflection.narrow_lobe_value(view, wi, any) }
    }

    #[inline(always)]
    fn pdf(&self, view: &PhongViewTerms, from: LobesWithNormal, wi: Vec3, shape: f32, any: BxdfFlags) -> f32 {
        if THROUGH {
            let cosine = from.normal.dot(wi);
            return self.transmission_probability * if cosine > 0.0 { cosine * FRAC_1_PI } else { 0.0 };
        }
        let reflected = self.reflection.pdf(view, from, wi, shape, any);
        match from.lobes {
            LobesToSample::All => (1.0 - self.transmission_probability) * reflected,
            LobesToSample::Narrow => reflected,
        }
    }

    #[inline(always)]
    fn sample(
        &self,
        view: &PhongViewTerms,
        from: LobesWithNormal,
        [choice, u @ ..]: [f32; 3],
        any: BxdfFlags,
    ) -> Vec3 {
        let reflected_share = match from.lobes {
            LobesToSample::All => 1.0 - self.transmission_probability,
            LobesToSample::Narrow => 1.0,
        };
        let wi = if THROUGH {
            direction_about_axis(from.normal, u[0].sqrt(), (1.0 - u[0]).sqrt(), u[1])
        } else {
            self.reflection.sample(view, from, [choice / reflected_share, u[0], u[1]], any)
        };
        // This direction is unused if the path continues on the other side.
        choose_vec3_by_bool((choice >= reflected_share) == THROUGH, wi, -from.normal)
    }

    #[inline(always)]
    fn narrow_lobe_probability(&self, view: &PhongViewTerms) -> f32 {
        (1.0 - self.transmission_probability) * self.reflection.narrow_lobe_probability(view)
    }

    #[inline(always)]
    fn albedo_estimate(&self, view: &PhongViewTerms) -> f32 {
        self.reflection.albedo_estimate(view) + self.transmission.max_element() * PI
    }

    #[inline(always)]
    fn narrow_lobe(&self, view: &PhongViewTerms) -> Option<NarrowLobe> {
        self.reflection.narrow_lobe(view)
    }

    #[inline(always)]
    fn narrow_lobe_exponent(&self) -> f32 {
        self.reflection.narrow_lobe_exponent()
    }
}
