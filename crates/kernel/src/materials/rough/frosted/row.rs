//! Rough glass in packets of 16.

use super::GlassPoint;
use crate::materials::bsdf::{
    BsdfValues, LobeSet, NarrowLobe, RoughRow, ShownLobes, SideSamples, SurfaceDirections,
};
use crate::materials::fresnel::{dielectric_either, transmittance};
use crate::materials::microfacet::{
    HalfVector, SmithTerms, reflect_at, refract_at, rotate_single_toward_viewer, sample_visible_normal,
};
use crate::math::Vec3;
use crate::math::frame::Frame;
use crate::math::lanes::{F32x16, PACKET_SIZE, Simd, SimdKernel, TRUE, Vec3x16, lane, set_lane};

/// The reflection or the transmission of a packet of rough glass surfaces. Both shared values are f of the
/// lobe, even if it is not shown.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct GlassRow<const THROUGH: bool> {
    /// Unit normals that face the viewer.
    normal: Vec3x16,
    /// Unit directions to the viewer.
    to_eye: Vec3x16,
    /// [`GlassPoint::near`].
    near: F32x16,
    /// [`GlassPoint::far`].
    far: F32x16,
    /// [`GlassPoint::alpha`].
    alpha: F32x16,
    /// 1 if the lobe is shown, otherwise 0.
    shown: F32x16,
    /// f in sr⁻¹ to show instead of the lobe.
    unit: F32x16,
}

/// Factor on the lobe, and the value of f to show instead.
#[inline(always)]
fn shown_parts(shown: ShownLobes) -> [f32; 2] {
    match shown {
        ShownLobes::Of { specular, .. } => [if specular { 1.0 } else { 0.0 }, 0.0],
        ShownLobes::Unit => [0.0, 1.0],
    }
}

impl<const THROUGH: bool> GlassRow<THROUGH> {
    /// Smith terms of the directions to the viewer and to the light, each with the normal on its side.
    #[inline(always)]
    fn smith_terms(&self, i: usize, direction: Vec3) -> [SmithTerms; 2] {
        let normal = lane(&self.normal, i);
        let lit = if THROUGH { -normal } else { normal };
        let eye = SmithTerms::isotropic(normal, lane(&self.to_eye, i), self.alpha[i]);
        [eye, SmithTerms::isotropic(lit, direction, self.alpha[i])]
    }

    /// f of the reflected or transmitted lobe in sr⁻¹.
    #[inline(always)]
    fn lobe(&self, i: usize, direction: Vec3) -> f32 {
        let [eye, light] = self.smith_terms(i, direction);
        let (normal, to_eye) = (lane(&self.normal, i), lane(&self.to_eye, i));
        if !THROUGH {
            let half = HalfVector::between(normal, to_eye, direction);
            let reflectance = dielectric_either(half.cosine(), self.far[i] / self.near[i]);
            return reflectance * eye.reflected(&light, half.isotropic(self.alpha[i]));
        }
        let indices = [self.near[i], self.far[i]];
        let (half, sum) = HalfVector::refracted(normal, [to_eye, direction], indices);
        // The facet must face the viewer if the surface does, and light must come from behind both.
        let scale = if half.along > 0.0 { 1.0 } else { -1.0 } / half.squared.sqrt();
        let cosines = [scale * to_eye.dot(sum), -scale * direction.dot(sum)];
        let is_through = (cosines[0] > MIN_COSINE) & (cosines[1] > MIN_COSINE);
        let by_facet = cosines[0] * cosines[1] * transmittance(cosines, indices) / half.squared;
        let value = 4.0 * (by_facet * eye.reflected(&light, half.isotropic(self.alpha[i])));
        let value = value * (self.far[i] * self.far[i]);
        // The half vector is unusable if the indices are nearly equal.
        if is_through & (value < f32::MAX) { value } else { 0.0 }
    }
}

impl<const THROUGH: bool> GlassRow<THROUGH> {
    /// [`BsdfRow::sample_sides`](super::super::BsdfRow::sample_sides).
    #[inline(always)]
    pub(in super::super) fn call_sides(
        &self,
        choices: &F32x16,
        u: &[F32x16; 2],
        simd: impl Simd,
    ) -> SideSamples {
        simd.call(SideSamplingKernel { row: self, choices, u })
    }

    /// Samples a facet of each surface, and randomly chooses reflection or refraction. All formulas use the
    /// facet's normal, which is the half vector in both cases.
    #[inline(always)]
    pub(super) fn sample_sides(&self, choices: &F32x16, u: &[F32x16; 2]) -> SideSamples {
        let (mut directions, mut beyond) = ([[0.0; PACKET_SIZE]; 3], [0; PACKET_SIZE]);
        let (mut densities, mut shares) = ([0.0; PACKET_SIZE], [0.0; PACKET_SIZE]);
        for i in 0..PACKET_SIZE {
            let (normal, to_eye, alpha) = (lane(&self.normal, i), lane(&self.to_eye, i), self.alpha[i]);
            let half =
                sample_visible_normal(&Frame::from_normal(normal), to_eye, [alpha; 2], [u[0][i], u[1][i]]);
            let indices = [self.near[i], self.far[i]];
            let eta = indices[1] / indices[0];
            let cosine = half.dot(to_eye);
            let reflectance = dielectric_either(cosine, eta);
            let is_mirrored = choices[i] < reflectance;
            let choose = |mirrored: f32, refracted: f32| if is_mirrored { mirrored } else { refracted };
            let (mirrored, refracted) = (reflect_at(half, to_eye), refract_at(half, to_eye, eta));
            let direction = Vec3::new(
                choose(mirrored.x, refracted.x),
                choose(mirrored.y, refracted.y),
                choose(mirrored.z, refracted.z),
            );
            set_lane(&mut directions, i, direction);
            beyond[i] = if is_mirrored == THROUGH { TRUE } else { 0 };
            // Compute the facet's scattering per solid angle.
            let behind = -half.dot(refracted);
            let sum = indices[0] * cosine - indices[1] * behind;
            let through = 4.0 * (cosine * behind * transmittance([cosine, behind], indices) / (sum * sum));
            let by_facet = choose(reflectance, through * (indices[1] * indices[1]));
            let is_through = (cosine > MIN_COSINE) & (behind > MIN_COSINE);
            // Light on the wrong side of the surface does not contribute.
            let eye = SmithTerms::isotropic(normal, to_eye, alpha);
            let side = choose(1.0, -1.0);
            let light = SmithTerms::isotropic(normal * side, direction, alpha);
            let along = normal.dot(half);
            let half = HalfVector { squared: 1.0, along, across: half - normal * along };
            let density = by_facet * eye.pdf(half.isotropic(alpha));
            let is_seen = light.is_above_surface()
                & eye.is_above_surface()
                & (is_mirrored | is_through)
                & (density < f32::MAX);
            densities[i] = if is_seen { density } else { 0.0 };
            let share = light.cosine * (eye.cosine + eye.slope)
                / (eye.cosine * light.slope + light.cosine * eye.slope);
            shares[i] = if is_seen { share } else { 0.0 };
        }
        SideSamples { directions, densities, shares, shown: self.shown, beyond }
    }
}

/// Kernel of [`GlassRow::sample_sides`].
struct SideSamplingKernel<'a, const THROUGH: bool> {
    row: &'a GlassRow<THROUGH>,
    choices: &'a F32x16,
    u: &'a [F32x16; 2],
}

impl<const THROUGH: bool> SimdKernel for SideSamplingKernel<'_, THROUGH> {
    type Output = SideSamples;

    #[inline(always)]
    fn run(self, _: impl Simd) -> SideSamples {
        self.row.sample_sides(self.choices, self.u)
    }
}

/// Minimum cosine between a facet's normal and a direction.
const MIN_COSINE: f32 = 1e-6;

impl<const THROUGH: bool> RoughRow for GlassRow<THROUGH> {
    type Point = GlassPoint;

    const SENDS_RAYS: bool = true;

    const EMPTY: Self = Self {
        normal: [[0.0; PACKET_SIZE], [0.0; PACKET_SIZE], [1.0; PACKET_SIZE]],
        to_eye: [[0.0; PACKET_SIZE], [0.0; PACKET_SIZE], [1.0; PACKET_SIZE]],
        near: [1.0; PACKET_SIZE],
        far: [1.5; PACKET_SIZE],
        alpha: [1.0; PACKET_SIZE],
        shown: [0.0; PACKET_SIZE],
        unit: [0.0; PACKET_SIZE],
    };

    #[inline(always)]
    fn normal_facing_viewer(normal: Vec3, to_eye: Vec3) -> Vec3 {
        if THROUGH {
            -rotate_single_toward_viewer(-normal, to_eye)
        } else {
            rotate_single_toward_viewer(normal, to_eye)
        }
    }

    #[inline(always)]
    fn reset(&mut self) {}

    #[inline(always)]
    fn put(&mut self, i: usize, bsdf: &GlassPoint, shown: ShownLobes, place: &SurfaceDirections) {
        let normal = if THROUGH { -place.normal } else { place.normal };
        set_lane(&mut self.normal, i, normal);
        set_lane(&mut self.to_eye, i, place.to_eye);
        (self.near[i], self.far[i], self.alpha[i]) = (bsdf.near, bsdf.far, bsdf.alpha);
        [self.shown[i], self.unit[i]] = shown_parts(shown);
    }

    #[inline(always)]
    fn copy(&mut self, i: usize, other: &Self, from: usize) {
        for (own, other) in [(&mut self.normal, &other.normal), (&mut self.to_eye, &other.to_eye)] {
            set_lane(own, i, lane(other, from));
        }
        for (own, other) in [
            (&mut self.near, &other.near),
            (&mut self.far, &other.far),
            (&mut self.alpha, &other.alpha),
            (&mut self.shown, &other.shown),
            (&mut self.unit, &other.unit),
        ] {
            own[i] = other[from];
        }
    }

    #[inline(always)]
    fn f(&self, directions: &Vec3x16) -> BsdfValues {
        let (mut lobe, mut shown) = ([0.0; PACKET_SIZE], [0.0; PACKET_SIZE]);
        for i in 0..PACKET_SIZE {
            lobe[i] = self.lobe(i, lane(directions, i));
        }
        for i in 0..PACKET_SIZE {
            shown[i] = lobe[i] * self.shown[i] + self.unit[i];
        }
        BsdfValues { f: [shown; 3], shared: [lobe; 2] }
    }

    #[inline(always)]
    fn wide_and_narrow(&self, _: &Vec3x16, values: &BsdfValues) -> [Vec3x16; 2] {
        [[[0.0; PACKET_SIZE]; 3], values.f]
    }

    #[inline(always)]
    fn max_component(&self, values: &BsdfValues) -> F32x16 {
        values.shared[0]
    }

    #[inline(always)]
    fn pdf(&self, _: LobeSet, _: &Vec3x16, directions: &Vec3x16, values: &BsdfValues) -> F32x16 {
        let mut densities = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            let [eye, light] = self.smith_terms(i, lane(directions, i));
            densities[i] = eye.pdf_from_reflected(&light, values.shared[1][i]);
        }
        densities
    }

    #[inline(always)]
    fn sample(&self, _: LobeSet, _: &Vec3x16, choices: &F32x16, u: &[F32x16; 2]) -> Vec3x16 {
        let mut directions = [[0.0; PACKET_SIZE]; 3];
        for i in 0..PACKET_SIZE {
            let (normal, to_eye, alpha) = (lane(&self.normal, i), lane(&self.to_eye, i), self.alpha[i]);
            let half =
                sample_visible_normal(&Frame::from_normal(normal), to_eye, [alpha; 2], [u[0][i], u[1][i]]);
            // If the other side is chosen, the path continues at that side's vertex, and this direction is
            // not used.
            let eta = self.far[i] / self.near[i];
            let is_mirrored = choices[i] < dielectric_either(half.dot(to_eye), eta);
            let direction = if THROUGH { refract_at(half, to_eye, eta) } else { reflect_at(half, to_eye) };
            let useless = if THROUGH { normal } else { -normal };
            let choose = |own: f32, useless: f32| if is_mirrored == THROUGH { useless } else { own };
            let chosen = Vec3::new(
                choose(direction.x, useless.x),
                choose(direction.y, useless.y),
                choose(direction.z, useless.z),
            );
            set_lane(&mut directions, i, chosen);
        }
        directions
    }

    #[inline(always)]
    fn has_narrow_lobes(&self) -> bool {
        true
    }

    #[inline(always)]
    fn has_narrow_lobe(&self, _: usize) -> bool {
        true
    }

    #[inline(always)]
    fn narrow_lobe(&self, i: usize) -> Option<NarrowLobe> {
        let (normal, to_eye, alpha) = (lane(&self.normal, i), lane(&self.to_eye, i), self.alpha[i]);
        let (eta, cosine) = (self.far[i] / self.near[i], normal.dot(to_eye));
        let reflectance = dielectric_either(cosine, eta);
        if !THROUGH {
            return Some(NarrowLobe::of_microfacets(normal, to_eye, alpha, reflectance, 0.0));
        }
        // Rotating a facet at normal incidence rotates the refracted direction by 1 − 1/η times the facet's
        // angle, whereas a reflected direction rotates by twice this angle.
        let turn = 0.5 * (1.0 - 1.0 / eta).abs() * alpha;
        let axis = refract_at(normal, to_eye, eta);
        let lobe = NarrowLobe { axis, ..NarrowLobe::of_microfacets(normal, to_eye, turn, 1.0, 0.0) };
        (reflectance < 1.0).then_some(lobe)
    }

    #[inline(always)]
    fn narrower_than(&self, _: u32, _: f32) -> u32 {
        0
    }

    #[inline(always)]
    fn constant_f(&self, _: usize) -> Option<Vec3> {
        None
    }

    #[inline(always)]
    fn f_at(&self, i: usize, direction: Vec3) -> Vec3 {
        Vec3::splat(self.lobe(i, direction) * self.shown[i] + self.unit[i])
    }
}
