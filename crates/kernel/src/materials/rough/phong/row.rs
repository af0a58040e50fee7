//! Phong surfaces in packets of 16.

use super::lobes::{Lobes, gloss};
use super::{Phong, PhongBsdf};
use crate::materials::bsdf::{
    BsdfValues, LobeSet, MaterialRow, NarrowLobe, RoughRow, ShownLobes, SurfaceDirections, UvRow,
};
use crate::math::Vec3;
use crate::math::lanes::{
    F32x16, Mask, PACKET_SIZE, Simd, TRUE, Vec3x16, lane, mask_from_bits, select, set_lane,
};

/// A packet of Phong surfaces. The shared values are [`gloss`].
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct PhongRow {
    /// The view direction reflected at the normal.
    mirrored_eye: Vec3x16,
    /// The diffuse part of f in sr⁻¹, or 0 if it is not shown.
    diffuse: Vec3x16,
    /// The glossy part of f at its peak in sr⁻¹, or 0 if it is not shown.
    specular: Vec3x16,
    /// Exponent of the glossy lobe.
    shininess: F32x16,
    /// The largest components of kd and ks, whether or not the lobes are shown.
    albedos: [F32x16; 2],
    /// Whether any surface has a glossy lobe.
    is_glossy: bool,
}

impl PhongRow {
    /// The lobes of a surface.
    #[inline(always)]
    fn lobes(&self, i: usize, normals: &Vec3x16) -> Lobes {
        Lobes {
            normal: lane(normals, i),
            mirrored_eye: lane(&self.mirrored_eye, i),
            diffuse: self.albedos[0][i],
            specular: self.albedos[1][i],
            shininess: self.shininess[i],
        }
    }

    /// Only the glossy lobe of a surface.
    #[inline(always)]
    fn glossy_lobe(&self, i: usize, normals: &Vec3x16) -> Lobes {
        Lobes { diffuse: 0.0, specular: 1.0, ..self.lobes(i, normals) }
    }

    /// Sets the lobes of the lanes in the mask `of`.
    #[inline(always)]
    fn set(&mut self, of: u32, shown: ShownLobes, diffuse: &Vec3x16, specular: Vec3, shininess: f32) {
        let white = PhongBsdf { diffuse: Vec3::ONE, specular, shininess, ambient: Vec3::ZERO };
        let [of_white, glossy] = shown_parts(&white, shown);
        let (mut shown_diffuse, mut greatest) = ([[of_white.x; PACKET_SIZE]; 3], [0.0; PACKET_SIZE]);
        if shown != ShownLobes::Unit {
            for i in 0..PACKET_SIZE {
                set_lane(&mut shown_diffuse, i, lane(diffuse, i) * of_white);
            }
        }
        for i in 0..PACKET_SIZE {
            greatest[i] = lane(diffuse, i).max_element();
        }
        let of = mask_from_bits(of);
        for axis in 0..3 {
            select(&of, &shown_diffuse[axis], &mut self.diffuse[axis]);
            select(&of, &[glossy[axis]; PACKET_SIZE], &mut self.specular[axis]);
        }
        select(&of, &[shininess; PACKET_SIZE], &mut self.shininess);
        select(&of, &greatest, &mut self.albedos[0]);
        select(&of, &[specular.max_element(); PACKET_SIZE], &mut self.albedos[1]);
        self.is_glossy |= specular != Vec3::ZERO;
    }
}

/// The diffuse part of f and the peak of the glossy part, both in sr⁻¹. Parts that are not shown are 0.
#[inline(always)]
fn shown_parts(bsdf: &PhongBsdf, shown: ShownLobes) -> [Vec3; 2] {
    let part = |is_taken: bool, value: Vec3| if is_taken { value } else { Vec3::ZERO };
    match shown {
        ShownLobes::Of { diffuse, specular } => {
            [part(diffuse, bsdf.diffuse_value()), part(specular, bsdf.specular_peak())]
        }
        ShownLobes::Unit => [Vec3::ONE, Vec3::ZERO],
    }
}

/// Mask of black colors.
#[inline(always)]
fn black_mask(colors: &Vec3x16, simd: impl Simd) -> u32 {
    let mut black = [0; PACKET_SIZE];
    for i in 0..PACKET_SIZE {
        let Vec3 { x, y, z } = lane(colors, i);
        black[i] = if (x == 0.0) & (y == 0.0) & (z == 0.0) { TRUE } else { 0 };
    }
    simd.movemask(&black)
}

impl RoughRow for PhongRow {
    type Point = PhongBsdf;

    const SENDS_RAYS: bool = false;

    const IS_COPIED: bool = true;

    const EMPTY: Self = Self {
        mirrored_eye: [[0.0; PACKET_SIZE]; 3],
        diffuse: [[0.0; PACKET_SIZE]; 3],
        specular: [[0.0; PACKET_SIZE]; 3],
        shininess: [0.0; PACKET_SIZE],
        albedos: [[0.0; PACKET_SIZE]; 2],
        is_glossy: false,
    };

    #[inline(always)]
    fn reset(&mut self) {
        self.is_glossy = false;
    }

    #[inline(always)]
    fn put(&mut self, i: usize, bsdf: &PhongBsdf, shown: ShownLobes, place: &SurfaceDirections) {
        set_lane(&mut self.mirrored_eye, i, mirrored(place.normal, place.to_eye));
        let [diffuse, specular] = shown_parts(bsdf, shown);
        set_lane(&mut self.diffuse, i, diffuse);
        set_lane(&mut self.specular, i, specular);
        self.shininess[i] = bsdf.shininess;
        self.albedos[0][i] = bsdf.diffuse.max_element();
        self.albedos[1][i] = bsdf.specular.max_element();
        self.is_glossy |= bsdf.specular != Vec3::ZERO;
    }

    #[inline(always)]
    fn copy(&mut self, i: usize, other: &Self, from: usize) {
        set_lane(&mut self.mirrored_eye, i, lane(&other.mirrored_eye, from));
        set_lane(&mut self.diffuse, i, lane(&other.diffuse, from));
        set_lane(&mut self.specular, i, lane(&other.specular, from));
        self.shininess[i] = other.shininess[from];
        for (own, other) in self.albedos.iter_mut().zip(&other.albedos) {
            own[i] = other[from];
        }
        self.is_glossy |= other.is_glossy;
    }

    #[inline(always)]
    fn f(&self, directions: &Vec3x16) -> BsdfValues {
        let (mut f, mut glosses) = (self.diffuse, [0.0; PACKET_SIZE]);
        if self.is_glossy {
            for i in 0..PACKET_SIZE {
                let left = gloss(lane(&self.mirrored_eye, i), lane(directions, i), self.shininess[i]);
                set_lane(&mut f, i, lane(&self.diffuse, i) + lane(&self.specular, i) * left);
                glosses[i] = left;
            }
        }
        BsdfValues { f, shared: [glosses, [0.0; PACKET_SIZE]] }
    }

    #[inline(always)]
    fn wide_and_narrow(&self, _: &Vec3x16, values: &BsdfValues) -> [Vec3x16; 2] {
        let mut glossy = self.specular;
        for axis in 0..3 {
            for i in 0..PACKET_SIZE {
                glossy[axis][i] = self.specular[axis][i] * values.shared[0][i];
            }
        }
        [self.diffuse, glossy]
    }

    #[inline(always)]
    fn max_component(&self, values: &BsdfValues) -> F32x16 {
        let mut gray = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            // The normal is not used here.
            gray[i] = self.lobes(i, &self.mirrored_eye).value(values.shared[0][i]);
        }
        gray
    }

    #[inline(always)]
    fn pdf(&self, lobes: LobeSet, normals: &Vec3x16, directions: &Vec3x16, values: &BsdfValues) -> F32x16 {
        let mut densities = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            let own = match lobes {
                LobeSet::All => self.lobes(i, normals),
                LobeSet::Narrow => self.glossy_lobe(i, normals),
            };
            densities[i] = own.density(lane(directions, i), values.shared[0][i]);
        }
        densities
    }

    #[inline(always)]
    fn sample(&self, lobes: LobeSet, normals: &Vec3x16, choices: &F32x16, u: &[F32x16; 2]) -> Vec3x16 {
        let mut directions = [[0.0; PACKET_SIZE]; 3];
        match lobes {
            LobeSet::All if self.is_glossy => {
                for i in 0..PACKET_SIZE {
                    let direction = self.lobes(i, normals).sample(choices[i], [u[0][i], u[1][i]]);
                    set_lane(&mut directions, i, direction);
                }
            }
            LobeSet::All => {
                for i in 0..PACKET_SIZE {
                    let direction = self.lobes(i, normals).sample_diffuse([u[0][i], u[1][i]]);
                    set_lane(&mut directions, i, direction);
                }
            }
            LobeSet::Narrow => {
                for i in 0..PACKET_SIZE {
                    let direction = self.glossy_lobe(i, normals).sample(1.0, [u[0][i], u[1][i]]);
                    set_lane(&mut directions, i, direction);
                }
            }
        }
        directions
    }

    #[inline(always)]
    fn has_narrow_lobes(&self) -> bool {
        self.is_glossy
    }

    #[inline(always)]
    fn has_narrow_lobe(&self, i: usize) -> bool {
        self.albedos[1][i] > 0.0
    }

    #[inline(always)]
    fn narrow_lobe(&self, i: usize) -> Option<NarrowLobe> {
        let lobes = self.lobes(i, &self.mirrored_eye);
        if !(lobes.specular > 0.0) {
            return None;
        }
        let (axis, exponent) = (lobes.mirrored_eye, lobes.shininess);
        Some(NarrowLobe { axis, exponent, peak: lobes.value(1.0) - lobes.value(0.0), wide: lobes.value(0.0) })
    }

    #[inline(always)]
    fn narrower_than(&self, of: u32, exponent: f32) -> u32 {
        let mut narrow = 0;
        for i in 0..PACKET_SIZE {
            narrow |= u32::from(self.has_narrow_lobe(i) & (self.shininess[i] >= exponent)) << i;
        }
        narrow & of
    }

    #[inline(always)]
    fn constant_f(&self, i: usize) -> Option<Vec3> {
        (lane(&self.specular, i) == Vec3::ZERO).then(|| lane(&self.diffuse, i))
    }

    #[inline(always)]
    fn f_at(&self, i: usize, direction: Vec3) -> Vec3 {
        let (mut f, specular) = (lane(&self.diffuse, i), lane(&self.specular, i));
        if specular != Vec3::ZERO {
            f += specular * gloss(lane(&self.mirrored_eye, i), direction, self.shininess[i]);
        }
        f
    }
}

impl MaterialRow for PhongRow {
    type Material = Phong;

    #[inline(always)]
    fn fill(
        &mut self,
        material: &Phong,
        uv: Option<&UvRow>,
        shown: &[(u32, ShownLobes)],
        simd: impl Simd,
    ) -> u32 {
        let diffuse = match (material.diffuse.texture(), uv) {
            (Some(texture), Some(uv)) => texture.lookup_packet(uv),
            (Some(_) | None, _) => {
                let Vec3 { x, y, z } = material.diffuse.constant().unwrap_or(Vec3::ONE);
                [[x; PACKET_SIZE], [y; PACKET_SIZE], [z; PACKET_SIZE]]
            }
        };
        let specular = material.specular.constant().unwrap_or(Vec3::ONE);
        for &(of, shown) in shown {
            self.set(of, shown, &diffuse, specular, material.shininess);
        }
        if specular == Vec3::ZERO { black_mask(&diffuse, simd) } else { 0 }
    }

    #[inline(always)]
    fn orient(&mut self, of: Option<&Mask>, normals: &mut Vec3x16, directions: &Vec3x16) {
        let mut all = [[0.0; PACKET_SIZE]; 3];
        for i in 0..PACKET_SIZE {
            set_lane(&mut all, i, mirrored(lane(normals, i), -lane(directions, i)));
        }
        match of {
            Some(of) => {
                for axis in 0..3 {
                    select(of, &all[axis], &mut self.mirrored_eye[axis]);
                }
            }
            None => self.mirrored_eye = all,
        }
    }
}

/// The view direction reflected at the normal. Its cosine with a light direction equals the cosine between
/// the reflected light direction and the view direction.
#[inline(always)]
fn mirrored(normal: Vec3, to_eye: Vec3) -> Vec3 {
    // (2(n·l)n − l)·v = (2(n·v)n − v)·l.
    normal * (2.0 * normal.dot(to_eye)) - to_eye
}
