//! Conductors in packets of 16.

use super::{Conductor, ConductorPoint, FresnelPoint, reflectance};
use crate::materials::bsdf::{
    BsdfValues, LobeSet, MaterialRow, NarrowLobe, RoughMaterial, RoughRow, ShownLobes, SurfaceDirections,
    UvRow,
};
use crate::materials::fresnel::schlick_weight;
use crate::materials::microfacet::{
    HalfVector, SmithTerms, frame_along, orient_to_viewers, rotate_single_toward_viewer, sample_reflection,
};
use crate::math::Vec3;
use crate::math::frame::Frame;
use crate::math::lanes::{F32x16, Mask, PACKET_SIZE, Simd, Vec3x16, lane, mask_from_bits, select, set_lane};

/// A packet of conductors. Either all are isotropic or all are brushed. Results in a lane do not depend on
/// other lanes. The shared values are the largest component of f (in monochrome and color rendering alike),
/// and f for a reflectance of 1.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct ConductorRow<const BRUSHED: bool> {
    /// Unit normals that face the viewer.
    normal: Vec3x16,
    /// Unit directions to the viewer.
    to_eye: Vec3x16,
    /// Directions along u. Arbitrary for isotropic surfaces.
    tangent: Vec3x16,
    /// α along u and along v.
    alphas: [F32x16; 2],
    /// [`FresnelPoint::first`] and [`FresnelPoint::second`].
    fresnel: [Vec3x16; 2],
    /// 1 if the lobe is shown, otherwise 0.
    shown: F32x16,
    /// f in sr⁻¹ to show instead of the lobe.
    unit: F32x16,
    /// Whether any surface has an index of refraction instead of a color.
    has_index: bool,
}

/// Factor on the lobe, and the value of f to show instead.
#[inline(always)]
fn shown_parts(shown: ShownLobes) -> [f32; 2] {
    match shown {
        ShownLobes::Of { specular, .. } => [if specular { 1.0 } else { 0.0 }, 0.0],
        ShownLobes::Unit => [0.0, 1.0],
    }
}

impl<const BRUSHED: bool> ConductorRow<BRUSHED> {
    #[inline(always)]
    fn frame(&self, i: usize) -> Frame {
        let normal = lane(&self.normal, i);
        if BRUSHED { frame_along(normal, lane(&self.tangent, i)) } else { Frame::from_normal(normal) }
    }

    #[inline(always)]
    fn alphas(&self, i: usize) -> [f32; 2] {
        [self.alphas[0][i], self.alphas[1][i]]
    }

    /// Smith terms of the directions to the viewer and to the light.
    #[inline(always)]
    fn smith_terms(&self, i: usize, direction: Vec3) -> [SmithTerms; 2] {
        let to_eye = lane(&self.to_eye, i);
        // Avoid `map` because it may not be inlined, which would keep the surrounding loops scalar.
        if BRUSHED {
            let (frame, alphas) = (self.frame(i), self.alphas(i));
            [
                SmithTerms::anisotropic(&frame, to_eye, alphas),
                SmithTerms::anisotropic(&frame, direction, alphas),
            ]
        } else {
            let (normal, alpha) = (lane(&self.normal, i), self.alphas[0][i]);
            [SmithTerms::isotropic(normal, to_eye, alpha), SmithTerms::isotropic(normal, direction, alpha)]
        }
    }

    /// f for a reflectance of 1, and the cosine between a direction and the half vector.
    #[inline(always)]
    fn lobe(&self, i: usize, direction: Vec3) -> [f32; 2] {
        let half = HalfVector::between(lane(&self.normal, i), lane(&self.to_eye, i), direction);
        let distribution = if BRUSHED {
            half.anisotropic(&self.frame(i), self.alphas(i))
        } else {
            half.isotropic(self.alphas[0][i])
        };
        let [eye, light] = self.smith_terms(i, direction);
        [eye.reflected(&light, distribution), half.cosine()]
    }

    #[inline(always)]
    fn set_fresnel(&mut self, i: usize, fresnel: &FresnelPoint) {
        let FresnelPoint { first, second } = *fresnel;
        set_lane(&mut self.fresnel[0], i, first);
        set_lane(&mut self.fresnel[1], i, second);
        self.has_index |= second.x >= 0.0;
    }
}

impl<const BRUSHED: bool> RoughRow for ConductorRow<BRUSHED> {
    type Point = ConductorPoint;

    const SENDS_RAYS: bool = true;

    const EMPTY: Self = Self {
        normal: [[0.0; PACKET_SIZE], [0.0; PACKET_SIZE], [1.0; PACKET_SIZE]],
        to_eye: [[0.0; PACKET_SIZE], [0.0; PACKET_SIZE], [1.0; PACKET_SIZE]],
        tangent: [[1.0; PACKET_SIZE], [0.0; PACKET_SIZE], [0.0; PACKET_SIZE]],
        alphas: [[1.0; PACKET_SIZE]; 2],
        fresnel: [[[0.0; PACKET_SIZE]; 3], [[-1.0; PACKET_SIZE]; 3]],
        shown: [0.0; PACKET_SIZE],
        unit: [0.0; PACKET_SIZE],
        has_index: false,
    };

    #[inline(always)]
    fn normal_facing_viewer(normal: Vec3, to_eye: Vec3) -> Vec3 {
        rotate_single_toward_viewer(normal, to_eye)
    }

    #[inline(always)]
    fn reset(&mut self) {
        self.has_index = false;
    }

    #[inline(always)]
    fn put(&mut self, i: usize, bsdf: &ConductorPoint, shown: ShownLobes, place: &SurfaceDirections) {
        let &SurfaceDirections { normal, to_eye, tangent } = place;
        set_lane(&mut self.normal, i, normal);
        set_lane(&mut self.to_eye, i, to_eye);
        set_lane(&mut self.tangent, i, tangent);
        self.set_fresnel(i, &bsdf.fresnel);
        // Without texture coordinates, the surface is isotropic. Its α is the geometric mean of the two α
        // values.
        let [u, v] = bsdf.alphas;
        let mean = (u * v).sqrt();
        let [u, v] = if tangent == Vec3::ZERO { [mean; 2] } else { [u, v] };
        (self.alphas[0][i], self.alphas[1][i]) = (u, v);
        [self.shown[i], self.unit[i]] = shown_parts(shown);
    }

    #[inline(always)]
    fn copy(&mut self, i: usize, other: &Self, from: usize) {
        let [first, second] = &mut self.fresnel;
        for (own, other) in [
            (&mut self.normal, &other.normal),
            (&mut self.to_eye, &other.to_eye),
            (&mut self.tangent, &other.tangent),
            (first, &other.fresnel[0]),
            (second, &other.fresnel[1]),
        ] {
            set_lane(own, i, lane(other, from));
        }
        for (own, other) in self.alphas.iter_mut().zip(&other.alphas) {
            own[i] = other[from];
        }
        (self.shown[i], self.unit[i]) = (other.shown[from], other.unit[from]);
        self.has_index |= other.has_index;
    }

    #[inline(always)]
    fn f(&self, directions: &Vec3x16) -> BsdfValues {
        let (mut white, mut cosines) = ([0.0; PACKET_SIZE], [0.0; PACKET_SIZE]);
        for i in 0..PACKET_SIZE {
            [white[i], cosines[i]] = self.lobe(i, lane(directions, i));
        }
        // Multiply by the reflectance of the facets.
        let mut f = [[0.0; PACKET_SIZE]; 3];
        if self.has_index {
            for axis in 0..3 {
                let (first, second) = (&self.fresnel[0][axis], &self.fresnel[1][axis]);
                for i in 0..PACKET_SIZE {
                    let weight = schlick_weight(cosines[i]);
                    f[axis][i] = white[i] * reflectance(first[i], second[i], cosines[i], weight);
                }
            }
        } else {
            for i in 0..PACKET_SIZE {
                let weight = schlick_weight(cosines[i]);
                let first = lane(&self.fresnel[0], i);
                set_lane(&mut f, i, (first + (Vec3::ONE - first) * weight) * white[i]);
            }
        }
        // Keep only the shown lobes.
        let mut largest = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            let all = lane(&f, i);
            largest[i] = all.max_element();
            set_lane(&mut f, i, all * self.shown[i] + Vec3::splat(self.unit[i]));
        }
        BsdfValues { f, shared: [largest, white] }
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
    fn sample(&self, _: LobeSet, _: &Vec3x16, _: &F32x16, u: &[F32x16; 2]) -> Vec3x16 {
        let mut directions = [[0.0; PACKET_SIZE]; 3];
        for i in 0..PACKET_SIZE {
            let u = [u[0][i], u[1][i]];
            let direction = sample_reflection(&self.frame(i), lane(&self.to_eye, i), self.alphas(i), u);
            set_lane(&mut directions, i, direction);
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
        let alpha = self.alphas[0][i].max(self.alphas[1][i]);
        Some(NarrowLobe::of_microfacets(lane(&self.normal, i), lane(&self.to_eye, i), alpha, 1.0, 0.0))
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
        let [white, cosine] = self.lobe(i, direction);
        let fresnel = FresnelPoint { first: lane(&self.fresnel[0], i), second: lane(&self.fresnel[1], i) };
        fresnel.reflectance(cosine) * (white * self.shown[i]) + Vec3::splat(self.unit[i])
    }
}

impl<const BRUSHED: bool> MaterialRow for ConductorRow<BRUSHED> {
    type Material = Conductor;

    #[inline(always)]
    fn fill(
        &mut self,
        material: &Conductor,
        _: Option<&UvRow>,
        shown: &[(u32, ShownLobes)],
        _: impl Simd,
    ) -> u32 {
        let ConductorPoint { fresnel, alphas } =
            material.constant().unwrap_or_else(|| material.with_white_textures());
        for &(of, shown) in shown {
            let (of, [part, unit]) = (mask_from_bits(of), shown_parts(shown));
            for axis in 0..3 {
                select(&of, &[fresnel.first[axis]; PACKET_SIZE], &mut self.fresnel[0][axis]);
                select(&of, &[fresnel.second[axis]; PACKET_SIZE], &mut self.fresnel[1][axis]);
            }
            select(&of, &[alphas[0]; PACKET_SIZE], &mut self.alphas[0]);
            select(&of, &[alphas[1]; PACKET_SIZE], &mut self.alphas[1]);
            select(&of, &[part; PACKET_SIZE], &mut self.shown);
            select(&of, &[unit; PACKET_SIZE], &mut self.unit);
        }
        self.has_index |= fresnel.second.x >= 0.0;
        0
    }

    #[inline(always)]
    fn orient(&mut self, of: Option<&Mask>, normals: &mut Vec3x16, directions: &Vec3x16) {
        orient_to_viewers(of, normals, directions, &mut self.normal, &mut self.to_eye);
    }
}
