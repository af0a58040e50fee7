//! Principled materials in packets of 16.

use std::f32::consts::FRAC_1_PI;

use super::{COAT_REFLECTANCE, Principled, PrincipledPoint};
use crate::materials::bsdf::{
    BsdfValues, LobeSet, MaterialRow, NarrowLobe, RoughMaterial, RoughRow, ShownLobes, SurfaceDirections,
    UvRow,
};
use crate::materials::fresnel::schlick_weight;
use crate::materials::lobe_albedo::{TERMS, evaluate};
use crate::materials::microfacet::{
    HalfVector, SmithTerms, orient_to_viewers, rotate_single_toward_viewer, sample_reflection,
};
use crate::materials::phong::lobes::direction_about_axis;
use crate::math::Vec3;
use crate::math::frame::Frame;
use crate::math::lanes::{F32x16, Mask, PACKET_SIZE, Simd, Vec3x16, lane, mask_from_bits, select, set_lane};

/// A packet of principled surfaces, for either reflected or transmitted light. The first shared value is the
/// largest component of f of all lobes. The second one is unused.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct PrincipledRow<const THROUGH: bool> {
    /// Unit normals that face the viewer. For transmitted light, they are on the other side.
    normal: Vec3x16,
    /// Unit directions to the viewer. For transmitted light, they are mirrored to the other side.
    to_eye: Vec3x16,
    /// [`PrincipledPoint::base`].
    base: Vec3x16,
    /// The largest component of the diffuse lobe's albedo, not including the lobes above it.
    diffuse: F32x16,
    /// [`PrincipledPoint::facets`].
    facets: Vec3x16,
    /// [`PrincipledPoint::grazing`].
    grazing: F32x16,
    /// [`PrincipledPoint::dielectric`].
    dielectric: (Vec3x16, F32x16),
    /// [`PrincipledPoint::transmission`].
    transmission: Vec3x16,
    /// [`PrincipledPoint::alpha`].
    alpha: F32x16,
    /// Terms of [`PrincipledPoint::albedo`].
    terms: [[F32x16; TERMS]; 2],
    /// [`PrincipledPoint::coat`].
    coat: F32x16,
    /// [`PrincipledPoint::coat_alpha`].
    coat_alpha: F32x16,
    /// Terms of [`PrincipledPoint::coat_albedo`].
    coat_terms: [F32x16; TERMS],
    /// Fraction of light that passes through the specular lobe between the diffuse lobe and the viewer.
    left: Vec3x16,
    /// Fraction of light that the coat transmits toward the viewer.
    through: F32x16,
    /// Probabilities of choosing the specular lobe and the coat's lobe.
    shares: [F32x16; 2],
    /// Probability of choosing transmission.
    through_share: F32x16,
    /// 1 if the diffuse lobe is shown, otherwise 0, followed by the same for the other lobes.
    shown: [F32x16; 2],
    /// f in sr⁻¹ to show instead of the lobes.
    unit: F32x16,
    /// Whether any surface has a clear coat.
    is_coated: bool,
    /// Whether any surface has a diffuse lobe.
    is_diffuse: bool,
    /// Whether any surface transmits light.
    transmits: bool,
}

/// Values that depend on the view direction.
struct ViewTerms {
    /// [`PrincipledRow::left`].
    left: Vec3,
    /// [`PrincipledRow::through`].
    through: f32,
    /// [`PrincipledRow::shares`].
    shares: [f32; 2],
    /// [`PrincipledRow::through_share`].
    through_share: f32,
}

/// Factors on the diffuse lobe and on the other lobes, and the value of f to show instead.
#[inline(always)]
fn shown_parts(shown: ShownLobes) -> [f32; 3] {
    let part = |is_taken: bool| if is_taken { 1.0 } else { 0.0 };
    match shown {
        ShownLobes::Of { diffuse, specular } => [part(diffuse), part(specular), 0.0],
        ShownLobes::Unit => [0.0, 0.0, 1.0],
    }
}

/// Limits a cosine to at least 0.
#[inline(always)]
fn nonnegative(cosine: f32) -> f32 {
    if cosine > 0.0 { cosine } else { 0.0 }
}

impl<const THROUGH: bool> PrincipledRow<THROUGH> {
    /// Albedo of the coat at a cosine ≥ 0, including the coat's weight.
    #[inline(always)]
    fn coat_albedo(&self, i: usize, cosine: f32) -> f32 {
        self.coat[i] * evaluate(cosine, |number| self.coat_terms[number][i])
    }

    /// Albedos of the specular lobe at a cosine ≥ 0, per unit of reflectance at normal incidence and at
    /// grazing angles.
    #[inline(always)]
    fn albedos(&self, i: usize, cosine: f32) -> [f32; 2] {
        // Avoid `map` because it may not be inlined, which would keep the surrounding loops scalar.
        let [normal, grazing] = &self.terms;
        [evaluate(cosine, |number| normal[number][i]), evaluate(cosine, |number| grazing[number][i])]
    }

    /// Fraction of light that passes through the dielectric's specular lobe at a cosine ≥ 0.
    #[inline(always)]
    fn transmittance_of_specular(&self, i: usize, cosine: f32) -> Vec3 {
        let [normal, grazing] = self.albedos(i, cosine);
        let (reflectance, of_grazing) = (lane(&self.dielectric.0, i), self.dielectric.1[i]);
        let left = Vec3::ONE - reflectance * normal - Vec3::splat(of_grazing * grazing);
        // If the facets reflect everything, no light passes. Clamp because rounding may produce negative
        // values.
        Vec3::new(nonnegative(left.x), nonnegative(left.y), nonnegative(left.z))
    }

    #[inline(always)]
    fn smith_terms(&self, i: usize, direction: Vec3, alpha: f32) -> [SmithTerms; 2] {
        let normal = lane(&self.normal, i);
        [lane(&self.to_eye, i), direction].map(|one| SmithTerms::isotropic(normal, one, alpha))
    }

    /// The coat's transmittance in both directions.
    #[inline(always)]
    fn through_coat(&self, i: usize, cosine: f32) -> f32 {
        if self.is_coated { self.through[i] * (1.0 - self.coat_albedo(i, nonnegative(cosine))) } else { 1.0 }
    }

    /// f of the diffuse lobe. 0 for light from behind.
    #[inline(always)]
    fn diffuse_f(&self, i: usize, direction: Vec3) -> Vec3 {
        let cosine = lane(&self.normal, i).dot(direction);
        let left = self.transmittance_of_specular(i, nonnegative(cosine)) * lane(&self.left, i);
        let through = if cosine > 0.0 { self.through_coat(i, cosine) } else { 0.0 };
        lane(&self.base, i) * left * through
    }

    /// f of the specular lobe and of the coat. 0 for light from behind.
    #[inline(always)]
    fn specular_and_coat_f(&self, i: usize, direction: Vec3) -> Vec3 {
        let half = HalfVector::between(lane(&self.normal, i), lane(&self.to_eye, i), direction);
        let weight = schlick_weight(half.cosine());
        let [eye, light] = self.smith_terms(i, direction, self.alpha[i]);
        let facets = lane(&self.facets, i);
        let reflectance = facets + (Vec3::splat(self.grazing[i]) - facets) * weight;
        let white = eye.reflected(&light, half.isotropic(self.alpha[i]));
        let specular = reflectance * (white * self.through_coat(i, light.cosine));
        if self.is_coated {
            let [eye, light] = self.smith_terms(i, direction, self.coat_alpha[i]);
            let white = eye.reflected(&light, half.isotropic(self.coat_alpha[i]));
            let reflectance = COAT_REFLECTANCE + (1.0 - COAT_REFLECTANCE) * weight;
            specular + Vec3::splat(self.coat[i] * reflectance * white)
        } else {
            specular
        }
    }

    /// f of transmitted light.
    #[inline(always)]
    fn transmitted(&self, i: usize, direction: Vec3) -> Vec3 {
        let half = HalfVector::between(lane(&self.normal, i), lane(&self.to_eye, i), direction);
        let weight = schlick_weight(half.cosine());
        let [eye, light] = self.smith_terms(i, direction, self.alpha[i]);
        let (facets, grazing) = (lane(&self.dielectric.0, i), self.dielectric.1[i]);
        let left = Vec3::ONE - (facets + (Vec3::splat(grazing) - facets) * weight);
        let white = eye.reflected(&light, half.isotropic(self.alpha[i]));
        lane(&self.transmission, i) * left * (white * self.through_coat(i, light.cosine))
    }

    /// Pdfs of a direction for the specular lobe and for the coat's lobe.
    #[inline(always)]
    fn densities(&self, i: usize, direction: Vec3) -> [f32; 2] {
        let half = HalfVector::between(lane(&self.normal, i), lane(&self.to_eye, i), direction);
        let of = |alpha: f32| {
            let [eye, light] = self.smith_terms(i, direction, alpha);
            let density = eye.pdf(half.isotropic(alpha));
            if light.is_above_surface() { density } else { 0.0 }
        };
        [of(self.alpha[i]), if self.is_coated { of(self.coat_alpha[i]) } else { 0.0 }]
    }

    /// Computes the values that depend on the view direction.
    #[inline(always)]
    fn view_terms(&self, i: usize) -> ViewTerms {
        let cosine = nonnegative(lane(&self.normal, i).dot(lane(&self.to_eye, i)));
        let coat = self.coat_albedo(i, cosine);
        let left = self.transmittance_of_specular(i, cosine);
        let [normal, grazing] = self.albedos(i, cosine);
        let specular = lane(&self.facets, i).max_element() * normal + self.grazing[i] * grazing;
        let diffuse = self.diffuse[i] * left.max_element();
        let mut all = specular + diffuse;
        let mut through = 0.0;
        if self.transmits {
            let left = lane(&self.transmission, i) * (left + Vec3::splat(normal + grazing - 1.0));
            through = nonnegative(left.max_element());
            all += through;
        }
        let below = (1.0 - coat) / all.max(f32::MIN_POSITIVE);
        // The probability of the coat is at least its fraction of the light. The rest is split among the
        // other lobes.
        let of_coat = if self.coat[i] > 0.0 { 1.0 - below * all } else { 0.0 };
        ViewTerms {
            left,
            through: 1.0 - coat,
            shares: [below * specular, of_coat],
            through_share: below * through,
        }
    }

    #[inline(always)]
    fn update_view_terms(&mut self, i: usize) {
        let seen = self.view_terms(i);
        set_lane(&mut self.left, i, seen.left);
        (self.through[i], self.through_share[i]) = (seen.through, seen.through_share);
        [self.shares[0][i], self.shares[1][i]] = seen.shares;
    }

    /// Updates all surfaces.
    #[inline(always)]
    fn update_all_view_terms(&mut self) {
        // Write to separate arrays, because the loop is not vectorized if it writes to the arrays that it
        // reads.
        let (mut left, mut shares) = ([[0.0; PACKET_SIZE]; 3], [[0.0; PACKET_SIZE]; 2]);
        let (mut through, mut through_share) = ([0.0; PACKET_SIZE], [0.0; PACKET_SIZE]);
        for i in 0..PACKET_SIZE {
            let seen = self.view_terms(i);
            set_lane(&mut left, i, seen.left);
            (through[i], through_share[i]) = (seen.through, seen.through_share);
            [shares[0][i], shares[1][i]] = seen.shares;
        }
        (self.left, self.through, self.through_share, self.shares) = (left, through, through_share, shares);
    }
}

impl<const THROUGH: bool> RoughRow for PrincipledRow<THROUGH> {
    type Point = PrincipledPoint;

    const SENDS_RAYS: bool = true;

    const EMPTY: Self = Self {
        normal: [[0.0; PACKET_SIZE], [0.0; PACKET_SIZE], [1.0; PACKET_SIZE]],
        to_eye: [[0.0; PACKET_SIZE], [0.0; PACKET_SIZE], [1.0; PACKET_SIZE]],
        base: [[0.0; PACKET_SIZE]; 3],
        diffuse: [0.0; PACKET_SIZE],
        facets: [[0.0; PACKET_SIZE]; 3],
        grazing: [1.0; PACKET_SIZE],
        dielectric: ([[0.0; PACKET_SIZE]; 3], [0.0; PACKET_SIZE]),
        transmission: [[0.0; PACKET_SIZE]; 3],
        alpha: [1.0; PACKET_SIZE],
        terms: [[[0.0; PACKET_SIZE]; TERMS]; 2],
        coat: [0.0; PACKET_SIZE],
        coat_alpha: [1.0; PACKET_SIZE],
        coat_terms: [[0.0; PACKET_SIZE]; TERMS],
        left: [[1.0; PACKET_SIZE]; 3],
        through: [1.0; PACKET_SIZE],
        shares: [[1.0; PACKET_SIZE], [0.0; PACKET_SIZE]],
        through_share: [0.0; PACKET_SIZE],
        shown: [[0.0; PACKET_SIZE]; 2],
        unit: [0.0; PACKET_SIZE],
        is_coated: false,
        is_diffuse: false,
        transmits: false,
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
    fn reset(&mut self) {
        (self.is_coated, self.is_diffuse, self.transmits) = (false, false, false);
    }

    #[inline(always)]
    fn put(&mut self, i: usize, bsdf: &PrincipledPoint, shown: ShownLobes, place: &SurfaceDirections) {
        let normal = if THROUGH { -place.normal } else { place.normal };
        let mirrored = place.to_eye - normal * (2.0 * normal.dot(place.to_eye));
        set_lane(&mut self.normal, i, if THROUGH { -normal } else { normal });
        set_lane(&mut self.to_eye, i, if THROUGH { mirrored } else { place.to_eye });
        set_lane(&mut self.base, i, bsdf.base);
        self.diffuse[i] = bsdf.ambient.max_element();
        set_lane(&mut self.transmission, i, bsdf.transmission);
        set_lane(&mut self.facets, i, bsdf.facets);
        set_lane(&mut self.dielectric.0, i, bsdf.dielectric.0);
        (self.dielectric.1[i], self.grazing[i], self.alpha[i]) =
            (bsdf.dielectric.1, bsdf.grazing, bsdf.alpha);
        (self.coat[i], self.coat_alpha[i]) = (bsdf.coat, bsdf.coat_alpha);
        for number in 0..TERMS {
            self.terms[0][number][i] = bsdf.albedo.normal.terms[number];
            self.terms[1][number][i] = bsdf.albedo.grazing.terms[number];
            self.coat_terms[number][i] = bsdf.coat_albedo.terms[number];
        }
        [self.shown[0][i], self.shown[1][i], self.unit[i]] = shown_parts(shown);
        self.is_coated |= bsdf.coat > 0.0;
        self.is_diffuse |= bsdf.base != Vec3::ZERO;
        self.transmits |= bsdf.transmits();
        self.update_view_terms(i);
    }

    #[inline(always)]
    fn copy(&mut self, i: usize, other: &Self, from: usize) {
        for (own, other) in [
            (&mut self.normal, &other.normal),
            (&mut self.to_eye, &other.to_eye),
            (&mut self.base, &other.base),
            (&mut self.facets, &other.facets),
            (&mut self.dielectric.0, &other.dielectric.0),
            (&mut self.transmission, &other.transmission),
            (&mut self.left, &other.left),
        ] {
            set_lane(own, i, lane(other, from));
        }
        for (own, other) in [
            (&mut self.diffuse, &other.diffuse),
            (&mut self.dielectric.1, &other.dielectric.1),
            (&mut self.grazing, &other.grazing),
            (&mut self.alpha, &other.alpha),
            (&mut self.coat, &other.coat),
            (&mut self.coat_alpha, &other.coat_alpha),
            (&mut self.through, &other.through),
            (&mut self.through_share, &other.through_share),
            (&mut self.unit, &other.unit),
        ] {
            own[i] = other[from];
        }
        let own = self.terms.iter_mut().flatten().chain(&mut self.coat_terms);
        let own = own.chain(&mut self.shares).chain(&mut self.shown);
        let others = other.terms.iter().flatten().chain(&other.coat_terms);
        for (own, other) in own.zip(others.chain(&other.shares).chain(&other.shown)) {
            own[i] = other[from];
        }
        self.is_coated |= other.is_coated;
        self.is_diffuse |= other.is_diffuse;
        self.transmits |= other.transmits;
    }

    #[inline(always)]
    fn f(&self, directions: &Vec3x16) -> BsdfValues {
        let (mut f, mut gray) = ([[0.0; PACKET_SIZE]; 3], [0.0; PACKET_SIZE]);
        for i in 0..PACKET_SIZE {
            let direction = lane(directions, i);
            let narrow =
                if THROUGH { self.transmitted(i, direction) } else { self.specular_and_coat_f(i, direction) };
            set_lane(&mut f, i, narrow * self.shown[1][i] + Vec3::splat(self.unit[i]));
            gray[i] = narrow.max_element();
        }
        if self.is_diffuse && !THROUGH {
            for i in 0..PACKET_SIZE {
                let wide = self.diffuse_f(i, lane(directions, i));
                let sum = lane(&f, i) + wide * self.shown[0][i];
                set_lane(&mut f, i, sum);
                gray[i] += wide.max_element();
            }
        }
        BsdfValues { f, shared: [gray, [0.0; PACKET_SIZE]] }
    }

    #[inline(always)]
    fn wide_and_narrow(&self, directions: &Vec3x16, values: &BsdfValues) -> [Vec3x16; 2] {
        if THROUGH {
            return [[[0.0; PACKET_SIZE]; 3], values.f];
        }
        let (mut wide, mut narrow) = ([[0.0; PACKET_SIZE]; 3], [[0.0; PACKET_SIZE]; 3]);
        for i in 0..PACKET_SIZE {
            let direction = lane(directions, i);
            set_lane(&mut wide, i, self.diffuse_f(i, direction) * self.shown[0][i]);
            let value = self.specular_and_coat_f(i, direction) * self.shown[1][i] + Vec3::splat(self.unit[i]);
            set_lane(&mut narrow, i, value);
        }
        [wide, narrow]
    }

    #[inline(always)]
    fn max_component(&self, values: &BsdfValues) -> F32x16 {
        values.shared[0]
    }

    #[inline(always)]
    fn pdf(&self, lobes: LobeSet, normals: &Vec3x16, directions: &Vec3x16, _: &BsdfValues) -> F32x16 {
        let mut densities = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            let direction = lane(directions, i);
            let [specular, coat] = self.densities(i, direction);
            let (of_specular, of_coat) = (self.shares[0][i], self.shares[1][i]);
            let of_through = self.through_share[i];
            let narrow =
                if THROUGH { of_through * specular } else { of_specular * specular + of_coat * coat };
            densities[i] = match lobes {
                LobeSet::All if THROUGH => narrow,
                LobeSet::All => {
                    let cosine = lane(normals, i).dot(direction);
                    narrow + (1.0 - of_specular - of_coat - of_through) * nonnegative(cosine) * FRAC_1_PI
                }
                LobeSet::Narrow => narrow / (of_specular + of_coat + of_through).max(f32::MIN_POSITIVE),
            };
        }
        densities
    }

    #[inline(always)]
    fn sample(&self, lobes: LobeSet, normals: &Vec3x16, choices: &F32x16, u: &[F32x16; 2]) -> Vec3x16 {
        let mut directions = [[0.0; PACKET_SIZE]; 3];
        for i in 0..PACKET_SIZE {
            let u = [u[0][i], u[1][i]];
            let (of_specular, of_coat) = (self.shares[0][i], self.shares[1][i]);
            let of_through = self.through_share[i];
            let choice = match lobes {
                LobeSet::All => choices[i],
                LobeSet::Narrow => choices[i] * (of_specular + of_coat + of_through),
            };
            // The order of lobes is coat, specular, diffuse, transmission.
            let last = match lobes {
                LobeSet::All => 1.0 - of_through,
                LobeSet::Narrow => of_specular + of_coat,
            };
            let is_through = (of_through > 0.0) & (choice >= last);
            let alpha = if (choice < of_coat) & !THROUGH { self.coat_alpha[i] } else { self.alpha[i] };
            let is_wide = match lobes {
                LobeSet::All => choice >= of_coat + of_specular,
                LobeSet::Narrow => false,
            };
            let frame = Frame::from_normal(lane(&self.normal, i));
            let narrow = sample_reflection(&frame, lane(&self.to_eye, i), [alpha; 2], u);
            let wide = direction_about_axis(lane(normals, i), u[0].sqrt(), (1.0 - u[0]).sqrt(), u[1]);
            let is_wide = is_wide & !THROUGH;
            let choose = |wide: f32, narrow: f32| if is_wide { wide } else { narrow };
            let chosen =
                Vec3::new(choose(wide.x, narrow.x), choose(wide.y, narrow.y), choose(wide.z, narrow.z));
            // If the path continues on the other side, this direction is not used.
            let useless = -lane(&self.normal, i);
            let keep = |own: f32, useless: f32| if is_through == THROUGH { own } else { useless };
            let kept =
                Vec3::new(keep(chosen.x, useless.x), keep(chosen.y, useless.y), keep(chosen.z, useless.z));
            set_lane(&mut directions, i, kept);
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
        let (normal, to_eye) = (lane(&self.normal, i), lane(&self.to_eye, i));
        let reflectance = lane(&self.facets, i).max_element();
        let wide = if THROUGH { 0.0 } else { (lane(&self.base, i) * lane(&self.left, i)).max_element() };
        Some(NarrowLobe::of_microfacets(normal, to_eye, self.alpha[i], reflectance, wide))
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
        let narrow =
            if THROUGH { self.transmitted(i, direction) } else { self.specular_and_coat_f(i, direction) };
        let mut f = narrow * self.shown[1][i] + Vec3::splat(self.unit[i]);
        if self.is_diffuse && !THROUGH {
            f += self.diffuse_f(i, direction) * self.shown[0][i];
        }
        f
    }
}

impl MaterialRow for PrincipledRow<false> {
    type Material = Principled;

    #[inline(always)]
    fn fill(
        &mut self,
        material: &Principled,
        _: Option<&UvRow>,
        shown: &[(u32, ShownLobes)],
        _: impl Simd,
    ) -> u32 {
        let point = material.constant().unwrap_or_else(|| material.with_white_textures());
        for &(of, shown) in shown {
            let (of, [diffuse, specular, unit]) = (mask_from_bits(of), shown_parts(shown));
            for axis in 0..3 {
                select(&of, &[point.base[axis]; PACKET_SIZE], &mut self.base[axis]);
                select(&of, &[point.facets[axis]; PACKET_SIZE], &mut self.facets[axis]);
                select(&of, &[point.dielectric.0[axis]; PACKET_SIZE], &mut self.dielectric.0[axis]);
            }
            for number in 0..TERMS {
                select(&of, &[point.albedo.normal.terms[number]; PACKET_SIZE], &mut self.terms[0][number]);
                select(&of, &[point.albedo.grazing.terms[number]; PACKET_SIZE], &mut self.terms[1][number]);
                select(&of, &[point.coat_albedo.terms[number]; PACKET_SIZE], &mut self.coat_terms[number]);
            }
            for (value, own) in [
                (point.ambient.max_element(), &mut self.diffuse),
                (point.dielectric.1, &mut self.dielectric.1),
                (point.grazing, &mut self.grazing),
                (point.alpha, &mut self.alpha),
                (point.coat, &mut self.coat),
                (point.coat_alpha, &mut self.coat_alpha),
                (unit, &mut self.unit),
            ] {
                select(&of, &[value; PACKET_SIZE], own);
            }
            select(&of, &[diffuse; PACKET_SIZE], &mut self.shown[0]);
            select(&of, &[specular; PACKET_SIZE], &mut self.shown[1]);
        }
        self.is_coated |= point.coat > 0.0;
        self.is_diffuse |= point.base != Vec3::ZERO;
        0
    }

    #[inline(always)]
    fn orient(&mut self, of: Option<&Mask>, normals: &mut Vec3x16, directions: &Vec3x16) {
        orient_to_viewers(of, normals, directions, &mut self.normal, &mut self.to_eye);
        self.update_all_view_terms();
    }
}
