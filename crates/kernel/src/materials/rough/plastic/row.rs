//! Plastic in packets of 16.

use std::f32::consts::{FRAC_1_PI, PI};

use super::{Plastic, PlasticPoint};
use crate::materials::bsdf::{
    BsdfValues, LobeSet, MaterialRow, NarrowLobe, RoughMaterial, RoughRow, ShownLobes, SurfaceDirections,
    UvRow,
};
use crate::materials::fresnel::dielectric_outside;
use crate::materials::lobe_albedo::{TERMS, evaluate, under_coat};
use crate::materials::microfacet::{
    HalfVector, SmithTerms, orient_to_viewers, rotate_single_toward_viewer, sample_reflection,
};
use crate::materials::phong::lobes::direction_about_axis;
use crate::math::Vec3;
use crate::math::frame::Frame;
use crate::math::lanes::{
    F32x16, Mask, PACKET_SIZE, Simd, TRUE, Vec3x16, lane, mask_from_bits, select, set_lane,
};

/// A packet of plastic surfaces. The shared values are the largest component of f of all lobes, and the
/// coat's transmittance in both directions.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct PlasticRow {
    /// Unit normals that face the viewer.
    normal: Vec3x16,
    /// Unit directions to the viewer.
    to_eye: Vec3x16,
    /// [`PlasticPoint::base`].
    base: Vec3x16,
    /// [`PlasticPoint::specular`].
    specular: Vec3x16,
    /// [`PlasticPoint::ior`].
    ior: F32x16,
    /// [`PlasticPoint::alpha`].
    alpha: F32x16,
    /// Terms of the coat's albedo.
    terms: [F32x16; TERMS],
    /// Mean albedo of the coat.
    mean: F32x16,
    /// Fraction of light that the coat transmits toward the viewer.
    left: F32x16,
    /// Probability of choosing the coat's lobe.
    share: F32x16,
    /// 1 if the diffuse lobe is shown, otherwise 0, followed by the same for the coat's lobe.
    shown: [F32x16; 2],
    /// f in sr⁻¹ to show instead of the lobes.
    unit: F32x16,
    /// Whether the coat of any surface is rough.
    is_rough: bool,
    /// Whether the coat of any surface is smooth.
    is_smooth: bool,
}

/// Factors on the diffuse lobe and the coat's lobe, and the value of f to show instead.
#[inline(always)]
fn shown_parts(shown: ShownLobes) -> [f32; 3] {
    let part = |is_taken: bool| if is_taken { 1.0 } else { 0.0 };
    match shown {
        ShownLobes::Of { diffuse, specular } => [part(diffuse), part(specular), 0.0],
        ShownLobes::Unit => [0.0, 0.0, 1.0],
    }
}

impl PlasticRow {
    /// Albedo of the coat at a cosine ≥ 0.
    #[inline(always)]
    fn albedo(&self, i: usize, cosine: f32) -> f32 {
        let rough = evaluate(cosine, |number| self.terms[number][i]);
        if self.is_smooth {
            let smooth = dielectric_outside(cosine, self.ior[i]);
            if self.alpha[i] == 0.0 { smooth } else { rough }
        } else {
            rough
        }
    }

    /// The coat's transmittance in both directions. 0 for light from behind.
    #[inline(always)]
    fn coat_transmittance(&self, i: usize, direction: Vec3) -> f32 {
        let cosine = lane(&self.normal, i).dot(direction);
        let is_ahead = cosine > 0.0;
        let left = 1.0 - self.albedo(i, if is_ahead { cosine } else { 0.0 });
        if is_ahead { self.left[i] * left } else { 0.0 }
    }

    #[inline(always)]
    fn smith_terms(&self, i: usize, direction: Vec3) -> [SmithTerms; 2] {
        let normal = lane(&self.normal, i);
        [lane(&self.to_eye, i), direction].map(|one| SmithTerms::isotropic(normal, one, self.alpha[i]))
    }

    /// D of the coat for a direction, and the reflectance of the coat's facets.
    #[inline(always)]
    fn distribution_and_fresnel(&self, i: usize, direction: Vec3) -> [f32; 2] {
        let half = HalfVector::between(lane(&self.normal, i), lane(&self.to_eye, i), direction);
        let alpha = self.alpha[i];
        let distribution = half.isotropic(if alpha > 0.0 { alpha } else { 1.0 });
        let fresnel = dielectric_outside(half.cosine(), self.ior[i]);
        [if alpha > 0.0 { distribution } else { 0.0 }, fresnel]
    }

    /// f of the coat in sr⁻¹, without the factor `specular`.
    #[inline(always)]
    fn coat_f(&self, i: usize, direction: Vec3) -> f32 {
        let [distribution, fresnel] = self.distribution_and_fresnel(i, direction);
        let [eye, light] = self.smith_terms(i, direction);
        fresnel * eye.reflected(&light, distribution)
    }

    /// Updates all values that depend on the view direction.
    #[inline(always)]
    fn update_view_terms(&mut self, i: usize) {
        let cosine = lane(&self.normal, i).dot(lane(&self.to_eye, i));
        let albedo = self.albedo(i, if cosine > 0.0 { cosine } else { 0.0 });
        self.left[i] = 1.0 - albedo;
        let diffuse = (1.0 - albedo) * (1.0 - self.mean[i]) * PI * lane(&self.base, i).max_element();
        let specular = albedo * lane(&self.specular, i).max_element();
        self.share[i] = specular / (specular + diffuse).max(f32::MIN_POSITIVE);
    }

    /// Sets the values that do not depend on directions or on the shown lobes.
    #[inline(always)]
    fn set(&mut self, i: usize, bsdf: &PlasticPoint) {
        set_lane(&mut self.base, i, bsdf.base);
        set_lane(&mut self.specular, i, bsdf.specular);
        (self.ior[i], self.alpha[i], self.mean[i]) = (bsdf.ior, bsdf.alpha, bsdf.albedo.mean);
        for (own, term) in self.terms.iter_mut().zip(bsdf.albedo.terms) {
            own[i] = term;
        }
        self.is_rough |= bsdf.alpha > 0.0;
        self.is_smooth |= bsdf.alpha == 0.0;
    }
}

impl RoughRow for PlasticRow {
    type Point = PlasticPoint;

    const SENDS_RAYS: bool = true;

    const EMPTY: Self = Self {
        normal: [[0.0; PACKET_SIZE], [0.0; PACKET_SIZE], [1.0; PACKET_SIZE]],
        to_eye: [[0.0; PACKET_SIZE], [0.0; PACKET_SIZE], [1.0; PACKET_SIZE]],
        base: [[0.0; PACKET_SIZE]; 3],
        specular: [[0.0; PACKET_SIZE]; 3],
        ior: [1.5; PACKET_SIZE],
        alpha: [1.0; PACKET_SIZE],
        terms: [[0.0; PACKET_SIZE]; TERMS],
        mean: [0.0; PACKET_SIZE],
        left: [1.0; PACKET_SIZE],
        share: [0.0; PACKET_SIZE],
        shown: [[0.0; PACKET_SIZE]; 2],
        unit: [0.0; PACKET_SIZE],
        is_rough: false,
        is_smooth: false,
    };

    #[inline(always)]
    fn normal_facing_viewer(normal: Vec3, to_eye: Vec3) -> Vec3 {
        rotate_single_toward_viewer(normal, to_eye)
    }

    #[inline(always)]
    fn reset(&mut self) {
        (self.is_rough, self.is_smooth) = (false, false);
    }

    #[inline(always)]
    fn put(&mut self, i: usize, bsdf: &PlasticPoint, shown: ShownLobes, place: &SurfaceDirections) {
        set_lane(&mut self.normal, i, place.normal);
        set_lane(&mut self.to_eye, i, place.to_eye);
        self.set(i, bsdf);
        [self.shown[0][i], self.shown[1][i], self.unit[i]] = shown_parts(shown);
        self.update_view_terms(i);
    }

    #[inline(always)]
    fn copy(&mut self, i: usize, other: &Self, from: usize) {
        for (own, other) in [
            (&mut self.normal, &other.normal),
            (&mut self.to_eye, &other.to_eye),
            (&mut self.base, &other.base),
            (&mut self.specular, &other.specular),
        ] {
            set_lane(own, i, lane(other, from));
        }
        for (own, other) in [
            (&mut self.ior, &other.ior),
            (&mut self.alpha, &other.alpha),
            (&mut self.mean, &other.mean),
            (&mut self.left, &other.left),
            (&mut self.share, &other.share),
            (&mut self.unit, &other.unit),
        ] {
            own[i] = other[from];
        }
        for (own, other) in
            self.terms.iter_mut().chain(&mut self.shown).zip(other.terms.iter().chain(&other.shown))
        {
            own[i] = other[from];
        }
        self.is_rough |= other.is_rough;
        self.is_smooth |= other.is_smooth;
    }

    #[inline(always)]
    fn f(&self, directions: &Vec3x16) -> BsdfValues {
        let (mut coat, mut through) = ([0.0; PACKET_SIZE], [0.0; PACKET_SIZE]);
        for i in 0..PACKET_SIZE {
            through[i] = self.coat_transmittance(i, lane(directions, i));
        }
        if self.is_rough {
            for i in 0..PACKET_SIZE {
                coat[i] = self.coat_f(i, lane(directions, i));
            }
        }
        let (mut f, mut gray) = ([[0.0; PACKET_SIZE]; 3], [0.0; PACKET_SIZE]);
        for i in 0..PACKET_SIZE {
            let (base, specular) = (lane(&self.base, i), lane(&self.specular, i));
            let value = base * (through[i] * self.shown[0][i]) + specular * (coat[i] * self.shown[1][i]);
            set_lane(&mut f, i, value + Vec3::splat(self.unit[i]));
            gray[i] = base.max_element() * through[i] + specular.max_element() * coat[i];
        }
        BsdfValues { f, shared: [gray, through] }
    }

    #[inline(always)]
    fn wide_and_narrow(&self, _: &Vec3x16, values: &BsdfValues) -> [Vec3x16; 2] {
        let (mut wide, mut narrow) = ([[0.0; PACKET_SIZE]; 3], [[0.0; PACKET_SIZE]; 3]);
        for axis in 0..3 {
            for i in 0..PACKET_SIZE {
                let base = self.base[axis][i] * values.shared[1][i];
                wide[axis][i] = base * self.shown[0][i];
                // Always subtract the diffuse lobe from the sum of both lobes, even if only one is shown.
                // This makes the coat bit-identical in all views.
                let hidden = base * (1.0 - self.shown[0][i] - self.unit[i]);
                let rest = values.f[axis][i] + hidden - (wide[axis][i] + hidden);
                narrow[axis][i] = if rest > 0.0 { rest } else { 0.0 };
            }
        }
        [wide, narrow]
    }

    #[inline(always)]
    fn max_component(&self, values: &BsdfValues) -> F32x16 {
        values.shared[0]
    }

    #[inline(always)]
    fn pdf(&self, lobes: LobeSet, normals: &Vec3x16, directions: &Vec3x16, _: &BsdfValues) -> F32x16 {
        let (mut narrow, mut densities) = ([0.0; PACKET_SIZE], [0.0; PACKET_SIZE]);
        if self.is_rough {
            for i in 0..PACKET_SIZE {
                let direction = lane(directions, i);
                let [distribution, _] = self.distribution_and_fresnel(i, direction);
                let [eye, light] = self.smith_terms(i, direction);
                let density = eye.pdf(distribution);
                narrow[i] = if light.is_above_surface() { density } else { 0.0 };
            }
        }
        match lobes {
            LobeSet::All => {
                for i in 0..PACKET_SIZE {
                    let cosine = lane(normals, i).dot(lane(directions, i));
                    let wide = if cosine > 0.0 { cosine * FRAC_1_PI } else { 0.0 };
                    densities[i] = self.share[i] * narrow[i] + (1.0 - self.share[i]) * wide;
                }
                densities
            }
            LobeSet::Narrow => narrow,
        }
    }

    #[inline(always)]
    fn sample(&self, lobes: LobeSet, normals: &Vec3x16, choices: &F32x16, u: &[F32x16; 2]) -> Vec3x16 {
        let mut directions = [[0.0; PACKET_SIZE]; 3];
        for i in 0..PACKET_SIZE {
            let u = [u[0][i], u[1][i]];
            let wide = direction_about_axis(lane(normals, i), u[0].sqrt(), (1.0 - u[0]).sqrt(), u[1]);
            set_lane(&mut directions, i, wide);
        }
        if self.is_rough {
            for i in 0..PACKET_SIZE {
                let (u, alpha) = ([u[0][i], u[1][i]], self.alpha[i]);
                let frame = Frame::from_normal(lane(&self.normal, i));
                let narrow = sample_reflection(&frame, lane(&self.to_eye, i), [alpha; 2], u);
                let is_narrow = match lobes {
                    LobeSet::All => choices[i] < self.share[i],
                    LobeSet::Narrow => alpha > 0.0,
                };
                let wide = lane(&directions, i);
                let choose = |narrow: f32, wide: f32| if is_narrow { narrow } else { wide };
                let chosen =
                    Vec3::new(choose(narrow.x, wide.x), choose(narrow.y, wide.y), choose(narrow.z, wide.z));
                set_lane(&mut directions, i, chosen);
            }
        }
        directions
    }

    #[inline(always)]
    fn has_narrow_lobes(&self) -> bool {
        self.is_rough
    }

    #[inline(always)]
    fn has_narrow_lobe(&self, i: usize) -> bool {
        self.alpha[i] > 0.0
    }

    #[inline(always)]
    fn narrow_lobe(&self, i: usize) -> Option<NarrowLobe> {
        let (normal, to_eye) = (lane(&self.normal, i), lane(&self.to_eye, i));
        let cosine = normal.dot(to_eye);
        let reflectance = dielectric_outside(cosine, self.ior[i]) * lane(&self.specular, i).max_element();
        let wide = self.left[i] * lane(&self.base, i).max_element() * (1.0 - self.mean[i]);
        let lobe = || NarrowLobe::of_microfacets(normal, to_eye, self.alpha[i], reflectance, wide);
        self.has_narrow_lobe(i).then(lobe)
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
        let wide = lane(&self.base, i) * (self.coat_transmittance(i, direction) * self.shown[0][i]);
        let mut narrow = Vec3::ZERO;
        if self.is_rough {
            narrow = lane(&self.specular, i) * (self.coat_f(i, direction) * self.shown[1][i]);
        }
        wide + narrow + Vec3::splat(self.unit[i])
    }
}

impl MaterialRow for PlasticRow {
    type Material = Plastic;

    #[inline(always)]
    fn fill(
        &mut self,
        material: &Plastic,
        uv: Option<&UvRow>,
        shown: &[(u32, ShownLobes)],
        simd: impl Simd,
    ) -> u32 {
        let point = material.constant().unwrap_or_else(|| material.with_white_textures());
        let mut bases =
            [[point.base.x; PACKET_SIZE], [point.base.y; PACKET_SIZE], [point.base.z; PACKET_SIZE]];
        if let (Some(texture), Some(uv)) = (material.row_texture(), uv) {
            let diffuse = texture.lookup_packet(uv);
            let squared = point.ior * point.ior;
            let returned = 1.0 - (1.0 - point.albedo.mean) / squared;
            for i in 0..PACKET_SIZE {
                let diffuse = lane(&diffuse, i).min(Vec3::ONE);
                set_lane(&mut bases, i, under_coat(diffuse, returned) * (FRAC_1_PI / squared));
            }
        }
        for &(of, shown) in shown {
            let (of, [diffuse, specular, unit]) = (mask_from_bits(of), shown_parts(shown));
            for axis in 0..3 {
                select(&of, &bases[axis], &mut self.base[axis]);
                select(&of, &[point.specular[axis]; PACKET_SIZE], &mut self.specular[axis]);
            }
            for (own, term) in self.terms.iter_mut().zip(point.albedo.terms) {
                select(&of, &[term; PACKET_SIZE], own);
            }
            for (value, own) in [
                (point.ior, &mut self.ior),
                (point.alpha, &mut self.alpha),
                (point.albedo.mean, &mut self.mean),
                (unit, &mut self.unit),
            ] {
                select(&of, &[value; PACKET_SIZE], own);
            }
            select(&of, &[diffuse; PACKET_SIZE], &mut self.shown[0]);
            select(&of, &[specular; PACKET_SIZE], &mut self.shown[1]);
        }
        self.is_rough |= point.alpha > 0.0;
        self.is_smooth |= point.alpha == 0.0;
        let mut black = [0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            let is_black = (lane(&bases, i) == Vec3::ZERO) & (point.specular == Vec3::ZERO);
            black[i] = if is_black { TRUE } else { 0 };
        }
        simd.movemask(&black)
    }

    #[inline(always)]
    fn orient(&mut self, of: Option<&Mask>, normals: &mut Vec3x16, directions: &Vec3x16) {
        orient_to_viewers(of, normals, directions, &mut self.normal, &mut self.to_eye);
        for i in 0..PACKET_SIZE {
            self.update_view_terms(i);
        }
    }
}
