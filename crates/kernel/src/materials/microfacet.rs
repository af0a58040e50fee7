//! Microfacets: the distribution GGX (Walter et al., *Microfacet Models for Refraction through Rough Surfaces*, 2007) under the
//! height-correlated masking and shadowing of Smith (Heitz, *Understanding the Masking-Shadowing Function in Microfacet-Based
//! BRDFs*, JCGT 3(2), 2014), scattered once.
//!
//! A lobe is f = F·D·G/(4 cosθᵢ cosθₒ) with G = 1/(1 + Λᵢ + Λₒ). The slope s(θ) = √(cos²θ + α² sin²θ) has 1 + 2Λ = s/cosθ, so
//! that G/(4 cosθᵢ cosθₒ) is 1/(2(cosθᵢ sₒ + cosθₒ sᵢ)), and the pdf of a direction mirrored at a visible normal D/(2(cosθₒ + sₒ)):
//! nothing is divided by the cosine of a grazing direction. The tangent of the half vector is that of its part across the normal,
//! which keeps its digits near the peak of a narrow lobe.

use std::f32::consts::{FRAC_1_PI, PI};

use crate::math::Vec3;
use crate::math::elementary::sin_cos;
use crate::math::frame::Frame;
use crate::math::lanes::{Mask, PACKET_SIZE, Vec3x16, lane, select, set_lane};

/// Least α: of narrower lobes, directions in `f32` have no digits.
pub const LEAST_ALPHA: f32 = 1e-3;

/// Least cosine of directions that see a surface.
const LEAST_COSINE: f32 = 1e-6;

/// Least cosine between a normal and the direction to the viewer, see [`facing`].
const LEAST_FACING: f32 = 1e-3;

/// α of a lobe along u and along v: α = roughness², stretched by an anisotropy in [−1, 1].
#[inline]
pub fn alphas(roughness: f32, anisotropy: f32) -> [f32; 2] {
    let alpha = roughness * roughness;
    let aspect = (1.0 - 0.9 * anisotropy.abs()).sqrt();
    let [wide, narrow] = [alpha / aspect, alpha * aspect].map(|alpha| alpha.clamp(LEAST_ALPHA, 4.0));
    if anisotropy < 0.0 { [narrow, wide] } else { [wide, narrow] }
}

/// The unit normal, turned just so far that the viewer is on its side: shading normals may turn away from the viewer at the edges of
/// round meshes.
#[inline(always)]
pub fn facing(normal: Vec3, to_eye: Vec3) -> Vec3 {
    let missing = LEAST_FACING - normal.dot(to_eye);
    let turned = normal + to_eye * missing;
    let turned = turned * (1.0 / turned.length_squared().sqrt());
    let choose = |turned: f32, own: f32| if missing > 0.0 { turned } else { own };
    Vec3::new(choose(turned.x, normal.x), choose(turned.y, normal.y), choose(turned.z, normal.z))
}

/// [`facing`] of one normal, which seldom turns.
#[inline(always)]
pub fn facing_one(normal: Vec3, to_eye: Vec3) -> Vec3 {
    if normal.dot(to_eye) < LEAST_FACING { facing(normal, to_eye) } else { normal }
}

/// Sets the directions to the viewers of a row, given the rays that arrive, turns the normals by [`facing`], and gives them to those
/// surfaces of the row that `of` names, or to all: [`MaterialRow::orient`](super::bsdf::MaterialRow::orient) of microfacets.
#[inline(always)]
pub fn turn_to_viewers(
    of: Option<&Mask>,
    normals: &mut Vec3x16,
    directions: &Vec3x16,
    own_normals: &mut Vec3x16,
    to_eyes: &mut Vec3x16,
) {
    for i in 0..PACKET_SIZE {
        let to_eye = -lane(directions, i);
        set_lane(to_eyes, i, to_eye);
        let turned = facing(lane(normals, i), to_eye);
        set_lane(normals, i, turned);
    }
    match of {
        Some(of) => {
            for axis in 0..3 {
                select(of, &normals[axis], &mut own_normals[axis]);
            }
        }
        None => *own_normals = *normals,
    }
}

/// The unnormalised half vector of two unit directions, by a unit normal.
#[derive(Clone, Copy)]
pub struct Half {
    /// Squared length; of a reflection (2 cosθ)² of the angle θ to either direction.
    pub squared: f32,
    /// Component along the normal.
    pub along: f32,
    /// Part across the normal.
    pub across: Vec3,
}

impl Half {
    /// The half vector of two directions.
    #[inline(always)]
    pub fn of(normal: Vec3, one: Vec3, other: Vec3) -> Self {
        let sum = one + other;
        let along = sum.dot(normal);
        Self { squared: sum.length_squared(), along, across: sum - normal * along }
    }

    /// The half vector of a refraction: the sum of the directions by the indices of refraction around them (Walter et al. 2007,
    /// section 5.3), but for its sign; and that sum.
    #[inline(always)]
    pub fn refracted(normal: Vec3, [one, other]: [Vec3; 2], [of_one, of_other]: [f32; 2]) -> (Self, Vec3) {
        let sum = one * of_one + other * of_other;
        let along = sum.dot(normal);
        (Self { squared: sum.length_squared(), along, across: sum - normal * along }, sum)
    }

    /// Cosine between it and either direction of a reflection.
    #[inline(always)]
    pub fn cosine(&self) -> f32 {
        0.5 * self.squared.sqrt()
    }

    /// D in sr⁻¹, the same in all azimuths.
    #[inline(always)]
    pub fn isotropic(&self, alpha: f32) -> f32 {
        let squared = alpha * alpha;
        self.distribution(self.across.length_squared() / squared, squared)
    }

    /// D in sr⁻¹ by the unit tangents of a frame.
    #[inline(always)]
    pub fn anisotropic(&self, frame: &Frame, [u, v]: [f32; 2]) -> f32 {
        let (x, y) = (self.across.dot(frame.s) / u, self.across.dot(frame.t) / v);
        self.distribution(x * x + y * y, u * v)
    }

    /// D, given the squared part across the normal in units of α, and the product of both α.
    #[inline(always)]
    fn distribution(&self, stretched: f32, product: f32) -> f32 {
        let slope = self.along * self.along + stretched;
        self.squared * self.squared * FRAC_1_PI / (product * slope * slope)
    }
}

/// A direction's cosine with the normal, and its slope s, see the top of this file.
#[derive(Clone, Copy)]
pub struct Leg {
    /// The cosine.
    pub cosine: f32,
    /// The slope.
    pub slope: f32,
}

impl Leg {
    /// A direction's leg, the same in all azimuths.
    #[inline(always)]
    pub fn isotropic(normal: Vec3, direction: Vec3, alpha: f32) -> Self {
        let cosine = normal.dot(direction);
        let squared = cosine * cosine;
        let slope = (squared + alpha * alpha * (1.0 - squared).max(0.0)).sqrt();
        Self { cosine, slope }
    }

    /// A direction's leg by the unit tangents of a frame.
    #[inline(always)]
    pub fn anisotropic(frame: &Frame, direction: Vec3, [u, v]: [f32; 2]) -> Self {
        let cosine = frame.n.dot(direction);
        let (x, y) = (frame.s.dot(direction) * u, frame.t.dot(direction) * v);
        Self { cosine, slope: (cosine * cosine + x * x + y * y).sqrt() }
    }

    /// Whether the direction is in front of the surface.
    #[inline(always)]
    pub fn is_ahead(&self) -> bool {
        self.cosine > LEAST_COSINE
    }

    /// D·G/(4 cosθᵢ cosθₒ) in sr⁻¹ for D; 0 if a direction is behind the surface.
    #[inline(always)]
    pub fn reflected(&self, other: &Self, distribution: f32) -> f32 {
        let value = distribution / (2.0 * (self.cosine * other.slope + other.cosine * self.slope));
        if self.is_ahead() & other.is_ahead() { value } else { 0.0 }
    }

    /// Pdf in sr⁻¹ of a direction that [`mirrored`] returns for this one, for D there.
    #[inline(always)]
    pub fn density(&self, distribution: f32) -> f32 {
        let density = distribution / (2.0 * (self.cosine + self.slope));
        if self.is_ahead() { density } else { 0.0 }
    }
}

impl Leg {
    /// [`Leg::density`], given [`Leg::reflected`] in place of D. 0 for a direction behind the surface, where nothing is reflected.
    #[inline(always)]
    pub fn density_of(&self, other: &Self, reflected: f32) -> f32 {
        let both = self.cosine * other.slope + other.cosine * self.slope;
        let density = reflected * both / (self.cosine + self.slope);
        if self.is_ahead() & other.is_ahead() { density } else { 0.0 }
    }
}

/// The frame of a normal, with its first tangent along a vector.
#[inline(always)]
pub fn frame_along(normal: Vec3, tangent: Vec3) -> Frame {
    let plain = Frame::from_normal(normal);
    let across = tangent - normal * normal.dot(tangent);
    let squared = across.length_squared();
    let s = across * (1.0 / squared.sqrt());
    let is_usable = (squared > 1e-30) & (squared < 1e30);
    let choose = |own: f32, plain: f32| if is_usable { own } else { plain };
    let s = Vec3::new(choose(s.x, plain.s.x), choose(s.y, plain.s.y), choose(s.z, plain.s.z));
    Frame { s, t: normal.cross(s), n: normal }
}

/// Samples a direction: that to the viewer, mirrored at a normal which is visible from there (Heitz, *Sampling the GGX Distribution of
/// Visible Normals*, JCGT 7(4), 2018). It may be behind the surface, where nothing is reflected.
#[inline(always)]
pub fn mirrored(frame: &Frame, to_eye: Vec3, alphas: [f32; 2], u: [f32; 2]) -> Vec3 {
    mirrored_at(facet(frame, to_eye, alphas, u), to_eye)
}

/// A direction, mirrored at a facet of this unit normal.
#[inline(always)]
pub fn mirrored_at(half: Vec3, to_eye: Vec3) -> Vec3 {
    let direction = half * (2.0 * half.dot(to_eye)) - to_eye;
    direction * (1.0 / direction.length_squared().sqrt())
}

/// The direction of light that a facet of this unit normal refracts towards a viewer; `eta` is the index of refraction there, divided by
/// that around the viewer. Any unit direction for total internal reflection.
#[inline(always)]
pub fn refracted_at(half: Vec3, to_eye: Vec3, eta: f32) -> Vec3 {
    let cosine = half.dot(to_eye);
    let squared = (eta - 1.0) * (eta + 1.0) + cosine * cosine;
    let root = if squared > 0.0 { squared } else { 0.0 }.sqrt();
    let direction = half * (cosine - root) - to_eye;
    direction * (1.0 / direction.length_squared().sqrt())
}

/// Samples the unit normal of a facet that is visible from a direction.
#[inline(always)]
pub fn facet(frame: &Frame, to_eye: Vec3, alphas: [f32; 2], u: [f32; 2]) -> Vec3 {
    let local = Vec3::new(frame.s.dot(to_eye), frame.t.dot(to_eye), frame.n.dot(to_eye));
    frame.to_world(visible_normal(local, alphas, u))
}

/// Samples a unit normal, visible from a direction, all in the frame of the surface.
#[inline(always)]
fn visible_normal(eye: Vec3, [along_u, along_v]: [f32; 2], u: [f32; 2]) -> Vec3 {
    // Stretch the view to that of a hemisphere.
    let stretched = Vec3::new(along_u * eye.x, along_v * eye.y, eye.z);
    let view = stretched * (1.0 / stretched.length_squared().sqrt());
    // Make a frame about it.
    let squared = view.x * view.x + view.y * view.y;
    let is_upright = squared < 1e-14;
    let inverse = 1.0 / if is_upright { 1.0 } else { squared.sqrt() };
    let first_x = if is_upright { 1.0 } else { -view.y * inverse };
    let first_y = if is_upright { 0.0 } else { view.x * inverse };
    let first = Vec3::new(first_x, first_y, 0.0);
    let second = view.cross(first);
    // Sample the projected area: a half disk, and another that is foreshortened.
    let radius = u[0].sqrt();
    let (sin, cos) = sin_cos(2.0 * PI * u[1]);
    let x = radius * cos;
    let part = 0.5 * (1.0 + view.z);
    let y = (1.0 - part) * (1.0 - x * x).max(0.0).sqrt() + part * (radius * sin);
    let z = (1.0 - x * x - y * y).max(0.0).sqrt();
    // Project it on the hemisphere, and shrink that back.
    let normal = first * x + second * y + view * z;
    let shrunk = Vec3::new(along_u * normal.x, along_v * normal.y, normal.z.max(1e-6));
    shrunk * (1.0 / shrunk.length_squared().sqrt())
}
