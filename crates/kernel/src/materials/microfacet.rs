//! Single-scattering microfacet models: the GGX and Beckmann distributions (Walter et al., *Microfacet Models
//! for Refraction through Rough Surfaces*, 2007) with height-correlated Smith masking and shadowing (Heitz,
//! *Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs*, JCGT 3(2), 2014).
//!
//! A lobe is f = F·D·G/(4 cosθᵢ cosθₒ) with G = 1/(1 + Λᵢ + Λₒ). Let s(θ) = cosθ (1 + 2Λ), which is √(cos²θ +
//! α² sin²θ) for GGX. Then G/(4 cosθᵢ cosθₒ) = 1/(2(cosθᵢ sₒ + cosθₒ sᵢ)), and the pdf of a direction
//! reflected at a visible normal is D/(2(cosθₒ + sₒ)). This avoids dividing by the cosine of a grazing
//! direction. The tangent of the half vector's angle is computed from the component perpendicular to the
//! normal, which is accurate even near the peak of a narrow lobe.

mod beckmann;

use std::f32::consts::{FRAC_1_PI, LOG2_E, PI};

use crate::choice;
use crate::math::Vec3;
use crate::math::elementary::{exp2, sin_cos};
use crate::math::frame::Frame;

choice! {
    /// Distributions of microfacet normals.
    pub enum MicrofacetDistribution {
        /// GGX, whose highlights have long tails.
        Ggx = "ggx",
        /// Beckmann, with normally distributed slopes.
        Beckmann = "beckmann",
    }
}

impl MicrofacetDistribution {
    /// Returns Beckmann if `is_beckmann` is true, or GGX if it is false.
    pub const fn ggx_or_beckmann(is_beckmann: bool) -> Self {
        if is_beckmann { Self::Beckmann } else { Self::Ggx }
    }
}

/// Minimum α. Narrower lobes cannot be resolved by `f32` directions.
pub const MIN_ALPHA: f32 = 1e-3;

/// Minimum cosine of directions above the surface.
const MIN_COSINE: f32 = 1e-6;

/// Minimum cosine between a normal and the direction to the viewer. See
/// [`tilt_to_face_viewer_branchless`].
const MIN_FACING_COSINE: f32 = 1e-3;

/// Computes a lobe's α along u and along v. An anisotropy in [−1, 1] stretches the base value, roughness².
#[inline]
pub fn alphas_from_roughness(roughness: f32, anisotropy: f32) -> [f32; 2] {
    let alpha = roughness * roughness;
    let aspect = (1.0 - 0.9 * anisotropy.abs()).sqrt();
    let [wide, narrow] = [alpha / aspect, alpha * aspect].map(|alpha| alpha.clamp(MIN_ALPHA, 4.0));
    if anisotropy < 0.0 { [narrow, wide] } else { [wide, narrow] }
}

/// Rotates the unit normal just enough to face the viewer. Shading normals may face away from the viewer near
/// silhouettes of smooth meshes.
#[inline(always)]
pub fn tilt_to_face_viewer_branchless(normal: Vec3, to_eye: Vec3) -> Vec3 {
    let missing = MIN_FACING_COSINE - normal.dot(to_eye);
    let turned = normal + to_eye * missing;
    let turned = turned * (1.0 / turned.length_squared().sqrt());
    let choose = |turned: f32, own: f32| if missing > 0.0 { turned } else { own };
    Vec3::new(choose(turned.x, normal.x), choose(turned.y, normal.y), choose(turned.z, normal.z))
}

/// [`tilt_to_face_viewer_branchless`] with a branch that is fast for normals that do not need
/// rotation.
#[inline(always)]
pub fn tilt_to_face_viewer(normal: Vec3, to_eye: Vec3) -> Vec3 {
    if normal.dot(to_eye) < MIN_FACING_COSINE {
        tilt_to_face_viewer_branchless(normal, to_eye)
    } else {
        normal
    }
}

/// The unnormalized half vector of two unit directions.
#[derive(Clone, Copy)]
pub struct UnnormalizedHalfVector {
    /// Squared length. For a reflection, this is (2 cosθ)², where θ is the angle between the half vector and
    /// either direction.
    pub squared: f32,
    /// Component along the normal.
    pub along: f32,
    /// Component perpendicular to the normal.
    pub across: Vec3,
}

impl UnnormalizedHalfVector {
    /// The half vector of a reflection.
    #[inline(always)]
    pub fn from_reflection(normal: Vec3, one: Vec3, other: Vec3) -> Self {
        let sum = one + other;
        let along = sum.dot(normal);
        Self { squared: sum.length_squared(), along, across: sum - normal * along }
    }

    /// The half vector of a refraction, up to its sign: the sum of the two directions, each weighted by the
    /// index of refraction on its side (Walter et al. 2007, section 5.3). Also returns this sum.
    #[inline(always)]
    pub fn from_refraction(
        normal: Vec3,
        [one, other]: [Vec3; 2],
        [of_one, of_other]: [f32; 2],
    ) -> (Self, Vec3) {
        let sum = one * of_one + other * of_other;
        let along = sum.dot(normal);
        (Self { squared: sum.length_squared(), along, across: sum - normal * along }, sum)
    }

    /// Cosine between the half vector and either direction of a reflection.
    #[inline(always)]
    pub fn cosine_to_either_direction(&self) -> f32 {
        0.5 * self.squared.sqrt()
    }

    /// Isotropic D in sr⁻¹.
    #[inline(always)]
    pub fn isotropic_d(&self, distribution: MicrofacetDistribution, alpha: f32) -> f32 {
        let squared = alpha * alpha;
        self.d_from_stretched(distribution, self.across.length_squared() / squared, squared)
    }

    /// Anisotropic D in sr⁻¹, with a separate α along each tangent of a frame.
    #[inline(always)]
    pub fn anisotropic_d(
        &self,
        distribution: MicrofacetDistribution,
        frame: &Frame,
        [u, v]: [f32; 2],
    ) -> f32 {
        let (x, y) = (self.across.dot(frame.s) / u, self.across.dot(frame.t) / v);
        self.d_from_stretched(distribution, x * x + y * y, u * v)
    }

    /// Computes D from the squared perpendicular component divided by α², and the product of the two α
    /// values.
    #[inline(always)]
    fn d_from_stretched(&self, distribution: MicrofacetDistribution, stretched: f32, product: f32) -> f32 {
        match distribution {
            MicrofacetDistribution::Ggx => self.ggx_ndf_from_stretched(stretched, product),
            MicrofacetDistribution::Beckmann => self.beckmann_ndf_from_stretched(stretched, product),
        }
    }

    #[inline(always)]
    fn ggx_ndf_from_stretched(&self, stretched: f32, product: f32) -> f32 {
        let slope = self.along * self.along + stretched;
        self.squared * self.squared * FRAC_1_PI / (product * slope * slope)
    }

    /// exp(−tan²θ/α²)/(π α² cos⁴θ).
    #[inline(always)]
    fn beckmann_ndf_from_stretched(&self, stretched: f32, product: f32) -> f32 {
        // Beyond this slope, D is negligible and its terms may overflow.
        const MAX_SQUARED_SLOPE: f32 = 80.0;
        let along = self.along * self.along;
        let slope = stretched / along;
        let cosine = self.squared / along;
        let value = cosine * cosine * exp2(slope * -LOG2_E) * FRAC_1_PI / product;
        if slope < MAX_SQUARED_SLOPE { value } else { 0.0 }
    }
}

/// The cosine between a direction and the normal, and s(θ) as defined at the top of this file.
#[derive(Clone, Copy)]
pub struct SmithDirectionTerms {
    /// cosθ.
    pub cosine: f32,
    /// s(θ).
    pub slope: f32,
}

impl SmithDirectionTerms {
    /// Computes the isotropic terms for a direction.
    #[inline(always)]
    pub fn isotropic(
        distribution: MicrofacetDistribution,
        normal: Vec3,
        direction: Vec3,
        alpha: f32,
    ) -> Self {
        let cosine = normal.dot(direction);
        let squared = cosine * cosine;
        let stretched = alpha * alpha * (1.0 - squared).max(0.0);
        let slope = match distribution {
            MicrofacetDistribution::Ggx => (squared + stretched).sqrt(),
            MicrofacetDistribution::Beckmann => {
                beckmann::cosine_times_one_plus_two_lambda(cosine, stretched.sqrt())
            }
        };
        Self { cosine, slope }
    }

    /// Computes the anisotropic terms for a direction, with a separate α along each tangent of a frame.
    #[inline(always)]
    pub fn anisotropic(
        distribution: MicrofacetDistribution,
        frame: &Frame,
        direction: Vec3,
        [u, v]: [f32; 2],
    ) -> Self {
        let cosine = frame.n.dot(direction);
        let (x, y) = (frame.s.dot(direction) * u, frame.t.dot(direction) * v);
        let slope = match distribution {
            MicrofacetDistribution::Ggx => (cosine * cosine + x * x + y * y).sqrt(),
            MicrofacetDistribution::Beckmann => {
                beckmann::cosine_times_one_plus_two_lambda(cosine, (x * x + y * y).sqrt())
            }
        };
        Self { cosine, slope }
    }

    /// Whether the direction is above the surface.
    #[inline(always)]
    pub fn is_direction_above_surface(&self) -> bool {
        self.cosine > MIN_COSINE
    }

    /// Computes D·G/(4 cosθᵢ cosθₒ) in sr⁻¹ from D. Returns 0 if either direction is below the surface.
    #[inline(always)]
    pub fn torrance_sparrow_without_fresnel(&self, other: &Self, distribution: f32) -> f32 {
        let value = distribution / (2.0 * (self.cosine * other.slope + other.cosine * self.slope));
        if self.is_direction_above_surface() & other.is_direction_above_surface() { value } else { 0.0 }
    }

    /// Computes, from D, the pdf in sr⁻¹ of a direction that [`sample_reflected_direction`] samples for this
    /// view direction.
    #[inline(always)]
    pub fn reflection_pdf(&self, distribution: f32) -> f32 {
        let pdf = distribution / (2.0 * (self.cosine + self.slope));
        if self.is_direction_above_surface() { pdf } else { 0.0 }
    }
}

impl SmithDirectionTerms {
    /// [`SmithDirectionTerms::reflection_pdf`], computed from the result of
    /// [`SmithDirectionTerms::torrance_sparrow_without_fresnel`] instead of D. Returns 0 for directions below
    /// the surface.
    #[inline(always)]
    pub fn pdf_from_reflection_term(&self, other: &Self, reflected: f32) -> f32 {
        let both = self.cosine * other.slope + other.cosine * self.slope;
        let pdf = reflected * both / (self.cosine + self.slope);
        if self.is_direction_above_surface() & other.is_direction_above_surface() { pdf } else { 0.0 }
    }
}

/// A frame around a normal. Its first axis is `tangent`, projected onto the surface and normalized, or
/// arbitrary if that is impossible.
#[inline(always)]
pub fn frame_with_tangent(normal: Vec3, tangent: Vec3) -> Frame {
    let plain = Frame::from_normal(normal);
    let across = tangent - normal * normal.dot(tangent);
    let squared = across.length_squared();
    let s = across * (1.0 / squared.sqrt());
    let is_usable = (squared > 1e-30) & (squared < 1e30);
    let choose = |own: f32, plain: f32| if is_usable { own } else { plain };
    let s = Vec3::new(choose(s.x, plain.s.x), choose(s.y, plain.s.y), choose(s.z, plain.s.z));
    Frame { s, t: normal.cross(s), n: normal }
}

/// Samples a direction by reflecting the view direction at a visible normal. The result may be below the
/// surface, where f is 0.
#[inline(always)]
pub fn sample_reflected_direction(
    distribution: MicrofacetDistribution,
    frame: &Frame,
    to_eye: Vec3,
    alphas: [f32; 2],
    u: [f32; 2],
) -> Vec3 {
    reflect_at(sample_visible_normal(distribution, frame, to_eye, alphas, u), to_eye)
}

/// Reflects the view direction at a facet with the given unit normal.
#[inline(always)]
pub fn reflect_at(half: Vec3, to_eye: Vec3) -> Vec3 {
    let direction = half * (2.0 * half.dot(to_eye)) - to_eye;
    direction * (1.0 / direction.length_squared().sqrt())
}

/// The direction from which a facet with the given unit normal refracts light toward the viewer. `eta` is the
/// index of refraction on the light's side divided by the index on the viewer's side. Returns an arbitrary
/// unit vector for total internal reflection.
#[inline(always)]
pub fn refract_at(half: Vec3, to_eye: Vec3, eta: f32) -> Vec3 {
    let cosine = half.dot(to_eye);
    let squared = (eta - 1.0) * (eta + 1.0) + cosine * cosine;
    let root = if squared > 0.0 { squared } else { 0.0 }.sqrt();
    let direction = half * (cosine - root) - to_eye;
    direction * (1.0 / direction.length_squared().sqrt())
}

/// Samples the unit normal of a visible facet.
#[inline(always)]
pub fn sample_visible_normal(
    distribution: MicrofacetDistribution,
    frame: &Frame,
    to_eye: Vec3,
    alphas: [f32; 2],
    u: [f32; 2],
) -> Vec3 {
    let [along_u, along_v] = alphas;
    // Stretch the view direction to a surface with α = 1.
    let local = Vec3::new(frame.s.dot(to_eye), frame.t.dot(to_eye), frame.n.dot(to_eye));
    let stretched = Vec3::new(along_u * local.x, along_v * local.y, local.z);
    let view = stretched * (1.0 / stretched.length_squared().sqrt());
    let normal = match distribution {
        MicrofacetDistribution::Ggx => sample_ggx_visible_normal(view, u),
        MicrofacetDistribution::Beckmann => beckmann::sample_visible_normal(view, u),
    };
    // Unstretch the normal.
    let shrunk = Vec3::new(along_u * normal.x, along_v * normal.y, normal.z);
    frame.to_world(shrunk * (1.0 / shrunk.length_squared().sqrt()))
}

/// Samples a visible normal of a GGX surface with α = 1 in its local frame (Heitz, *Sampling the GGX
/// Distribution of Visible Normals*, JCGT 7(4), 2018). The result is not normalized.
#[inline(always)]
fn sample_ggx_visible_normal(view: Vec3, u: [f32; 2]) -> Vec3 {
    // Build an orthonormal basis around the view direction.
    let squared = view.x * view.x + view.y * view.y;
    let is_upright = squared < 1e-14;
    let inverse = 1.0 / if is_upright { 1.0 } else { squared.sqrt() };
    let first_x = if is_upright { 1.0 } else { -view.y * inverse };
    let first_y = if is_upright { 0.0 } else { view.x * inverse };
    let first = Vec3::new(first_x, first_y, 0.0);
    let second = view.cross(first);
    // Sample the projected area: a half disk and a foreshortened half disk.
    let radius = u[0].sqrt();
    let (sin, cos) = sin_cos(2.0 * PI * u[1]);
    let x = radius * cos;
    let part = 0.5 * (1.0 + view.z);
    let y = (1.0 - part) * (1.0 - x * x).max(0.0).sqrt() + part * (radius * sin);
    let z = (1.0 - x * x - y * y).max(0.0).sqrt();
    // Project onto the hemisphere.
    let normal = first * x + second * y + view * z;
    Vec3::new(normal.x, normal.y, normal.z.max(1e-6))
}
