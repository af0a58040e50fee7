//! Directional albedos of microfacet lobes: E(μ) = ∫ f(μ, ω) cosθ dω, as functions of the cosine μ of the
//! view direction.
//!
//! They are computed by quadrature over visible normals (Heitz, *Sampling the GGX Distribution of Visible
//! Normals*, JCGT 7(4), 2018) and stored as polynomials in t = (1 + c)μ/(μ + c), which gives more weight to
//! grazing angles. For μ ≥ 0.05, the polynomials are never below the albedo, and exceed it by at most 8e-4.
//! Interpolation in roughness tables adds an error of at most 2e-3. Therefore, the base under a lobe never
//! receives too much light.

mod beckmann;

use std::f64::consts::TAU;

use super::microfacet::MicrofacetDistribution;
use crate::math::{DVec3, Vec3};

/// Number of polynomial terms.
pub const TERMS: usize = 10;

/// The constant c in the definition of t.
const KNEE: f64 = 0.15;

/// Number of roughness values in a table.
const TABLE_SIZE: usize = 80;

/// The directional albedo of one lobe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LobeAlbedoPolynomial {
    /// Coefficients of the powers of 2t − 1.
    pub terms: [f32; TERMS],
    /// The cosine-weighted mean over all directions, 2 ∫ E(μ) μ dμ.
    pub mean: f32,
}

impl LobeAlbedoPolynomial {
    /// Evaluates the albedo at μ ≥ 0.
    #[inline]
    pub fn at_cosine(&self, cosine: f32) -> f32 {
        evaluate_albedo_fit(cosine, |number| self.terms[number])
    }

    /// Computes the albedo of a lobe with an isotropic α. `reflectance` maps a cosine to the reflectance of a
    /// facet.
    pub fn for_microfacet_lobe(
        distribution: MicrofacetDistribution,
        alpha: f64,
        reflectance: impl Fn(f64) -> f64,
    ) -> Self {
        Self::fit(|cosine| match distribution {
            MicrofacetDistribution::Ggx => integrate_albedo::<12, 16>(cosine, alpha, &reflectance),
            MicrofacetDistribution::Beckmann => beckmann::integrate_albedo(cosine, alpha, &reflectance),
        })
    }

    /// Fits a polynomial to an albedo function, and stores the function's exact mean.
    pub fn fit_storing_exact_mean(albedo: impl Fn(f64) -> f64) -> Self {
        Self { mean: cosine_weighted_mean(&albedo) as f32, ..Self::fit(albedo) }
    }

    /// Fits a polynomial to an albedo function, and stores the polynomial's mean. This keeps the light that
    /// reaches the base consistent with the fit.
    fn fit(albedo: impl Fn(f64) -> f64) -> Self {
        const NODES: usize = 32;
        // Evaluate the albedo at nodes that are denser at grazing angles.
        let nodes: [(f64, f64); NODES] = std::array::from_fn(|i| {
            let t = 0.5 - 0.5 * libm::cos(std::f64::consts::PI * (i as f64 + 0.5) / NODES as f64);
            let cosine = (t * t.sqrt()).max(0.004);
            (cosine, albedo(cosine))
        });
        // Fit a Chebyshev series. Increasing the weights of nodes with large errors equalizes the errors
        // (Lawson's algorithm). Nodes below μ = 0.03 have less weight.
        let least = |cosine: f64| if cosine < 0.03 { 0.1 } else { 1.0 };
        let mut weights = nodes.map(|(cosine, _)| least(cosine));
        let mut terms = [0.0; TERMS];
        for _ in 0..24 {
            terms = fit_chebyshev_least_squares(&nodes, &weights);
            let errors =
                nodes.map(|(cosine, value)| (chebyshev_sum(&terms, cosine) - value).abs() * least(cosine));
            let largest = errors.iter().fold(1e-12, |most: f64, error| most.max(*error));
            for (weight, error) in weights.iter_mut().zip(errors) {
                *weight *= (0.3 + error / largest).sqrt();
            }
        }
        // Raise the polynomial until it is nowhere below the albedo.
        let missing = nodes
            .iter()
            .filter(|(cosine, _)| *cosine > 0.03)
            .map(|(cosine, value)| value - chebyshev_sum(&terms, *cosine));
        terms[0] += missing.fold(0.0, f64::max);
        let fit = Self { terms: chebyshev_to_power_basis(&terms).map(|term| term as f32), mean: 0.0 };
        Self { mean: cosine_weighted_mean(|cosine| fit.at_cosine(cosine as f32).into()) as f32, ..fit }
    }

    /// Interpolates linearly between two albedos.
    fn lerp(&self, other: &Self, part: f32) -> Self {
        let mix = |one: f32, other: f32| one + (other - one) * part;
        Self {
            terms: std::array::from_fn(|i| mix(self.terms[i], other.terms[i])),
            mean: mix(self.mean, other.mean),
        }
    }
}

/// Albedos as functions of roughness.
#[derive(Clone, Debug, PartialEq)]
pub struct AlbedoTable {
    /// Albedos at evenly spaced roughness values from 0 to 1, or a single albedo.
    rows: Vec<LobeAlbedoPolynomial>,
}

impl AlbedoTable {
    /// A table for lobes with α = `alpha(roughness)`. It has a single entry if the roughness is constant.
    pub fn new(
        distribution: MicrofacetDistribution,
        roughness: Option<f32>,
        alpha: impl Fn(f32) -> f32,
        reflectance: impl Fn(f64) -> f64,
    ) -> Self {
        let row = |roughness: f32| {
            LobeAlbedoPolynomial::for_microfacet_lobe(distribution, alpha(roughness).into(), &reflectance)
        };
        let rows = match roughness {
            Some(one) => vec![row(one)],
            None => (0..TABLE_SIZE).map(|i| row(i as f32 / (TABLE_SIZE - 1) as f32)).collect(),
        };
        Self { rows }
    }

    /// A table with a single entry.
    pub fn from_single_albedo(albedo: LobeAlbedoPolynomial) -> Self {
        Self { rows: vec![albedo] }
    }

    /// The albedo for a given roughness in [0, 1].
    pub fn lobe_at_roughness(&self, roughness: f32) -> LobeAlbedoPolynomial {
        let place = roughness.clamp(0.0, 1.0) * (self.rows.len() - 1) as f32;
        let number = (place as usize).min(self.rows.len().saturating_sub(2));
        let next = self.rows.get(number + 1).unwrap_or(&self.rows[number]);
        self.rows[number].lerp(next, place - number as f32)
    }
}

/// Evaluates the albedo at μ ≥ 0. `term` returns the coefficients.
#[inline(always)]
pub fn evaluate_albedo_fit(cosine: f32, term: impl Fn(usize) -> f32) -> f32 {
    let t = (1.0 + KNEE as f32) * cosine / (cosine + KNEE as f32);
    let x = 2.0 * t - 1.0;
    let mut sum = term(TERMS - 1);
    for number in (0..TERMS - 1).rev() {
        sum = sum * x + term(number);
    }
    let sum = if sum > 0.0 { sum } else { 0.0 };
    if sum < 1.0 { sum } else { 1.0 }
}

/// Cosine-weighted mean over directions, 2 ∫ E(μ) μ dμ.
fn cosine_weighted_mean(albedo: impl Fn(f64) -> f64) -> f64 {
    gauss_legendre(32).map(|(cosine, weight)| 2.0 * cosine * weight * albedo(cosine)).sum()
}

/// Chebyshev polynomials at μ.
fn chebyshev_values_at_cosine(cosine: f64) -> [f64; TERMS] {
    let x = 2.0 * (1.0 + KNEE) * cosine / (cosine + KNEE) - 1.0;
    let mut values = [1.0; TERMS];
    values[1] = x;
    for i in 2..TERMS {
        values[i] = 2.0 * x * values[i - 1] - values[i - 2];
    }
    values
}

fn chebyshev_sum(terms: &[f64; TERMS], cosine: f64) -> f64 {
    chebyshev_values_at_cosine(cosine).iter().zip(terms).map(|(value, term)| value * term).sum()
}

/// Least-squares coefficients. Solves the normal equations with Gaussian elimination, which needs no pivoting
/// because the matrix is positive definite.
fn fit_chebyshev_least_squares(nodes: &[(f64, f64)], weights: &[f64]) -> [f64; TERMS] {
    let mut rows = [[0.0; TERMS + 1]; TERMS];
    for (&(cosine, value), weight) in nodes.iter().zip(weights) {
        let basis = chebyshev_values_at_cosine(cosine);
        for i in 0..TERMS {
            for j in 0..TERMS {
                rows[i][j] += weight * weight * basis[i] * basis[j];
            }
            rows[i][TERMS] += weight * weight * basis[i] * value;
        }
    }
    for i in 0..TERMS {
        let pivot = rows[i];
        for row in rows.iter_mut().skip(i + 1) {
            let factor = row[i] / pivot[i];
            for j in i..=TERMS {
                row[j] -= factor * pivot[j];
            }
        }
    }
    let mut terms = [0.0; TERMS];
    for i in (0..TERMS).rev() {
        let known: f64 = (i + 1..TERMS).map(|j| rows[i][j] * terms[j]).sum();
        terms[i] = (rows[i][TERMS] - known) / rows[i][i];
    }
    terms
}

/// Converts Chebyshev coefficients to power-basis coefficients.
fn chebyshev_to_power_basis(terms: &[f64; TERMS]) -> [f64; TERMS] {
    let (mut before, mut own) = ([0.0; TERMS], [0.0; TERMS]);
    (before[0], own[1]) = (1.0, 1.0);
    let mut sums = [0.0; TERMS];
    for (number, term) in terms.iter().enumerate() {
        for i in 0..TERMS {
            sums[i] += term * before[i];
        }
        // Use the recurrence Tₙ₊₁ = 2x·Tₙ − Tₙ₋₁.
        let mut next = before.map(|factor| -factor);
        for i in 1..TERMS {
            next[i] += 2.0 * own[i - 1];
        }
        if number + 1 < TERMS {
            (before, own) = (own, next);
        }
    }
    sums
}

/// Gauss–Legendre nodes in (0, 1) and their weights, computed with Newton's method.
fn gauss_legendre(count: usize) -> impl Iterator<Item = (f64, f64)> {
    (0..count).map(move |i| {
        let mut x = libm::cos(std::f64::consts::PI * (i as f64 + 0.75) / (count as f64 + 0.5));
        let mut slope = 1.0;
        for _ in 0..8 {
            let (mut before, mut own) = (1.0, x);
            for n in 2..=count {
                let n = n as f64;
                (before, own) = (own, ((2.0 * n - 1.0) * x * own - (n - 1.0) * before) / n);
            }
            slope = count as f64 * (x * own - before) / (x * x - 1.0);
            x -= own / slope;
        }
        (0.5 + 0.5 * x, 1.0 / ((1.0 - x * x) * slope * slope))
    })
}

/// The facets that are visible from a direction, parameterized by a point (x, b) on the unit disk. The x axis
/// is perpendicular to the plane of incidence, and the b axis is in this plane.
struct VisibleNormalDistribution {
    alpha: f64,
    to_eye: DVec3,
    /// The stretched view direction, and the direction of the b axis.
    view: DVec3,
    second: DVec3,
    /// Smith's Λ of the view direction.
    masked: f64,
}

impl VisibleNormalDistribution {
    fn new(cosine: f64, alpha: f64) -> Self {
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let view = DVec3::new(alpha * sine, 0.0, cosine).normalize();
        let (to_eye, second) = (DVec3::new(sine, 0.0, cosine), view.cross(DVec3::Y));
        Self { alpha, to_eye, view, second, masked: smith_lambda(cosine, alpha) }
    }

    /// Cosine between a facet and the view direction, and cosine between the reflected direction and the
    /// surface normal.
    fn facet_and_reflected_cosines(&self, x: f64, b: f64) -> [f64; 2] {
        let Self { alpha, to_eye, view, second, .. } = self;
        let part = 0.5 * (1.0 + view.z);
        let y = (1.0 - part) * (1.0 - x * x).sqrt() + part * b;
        let z = (1.0 - x * x - y * y).max(0.0).sqrt();
        let normal = DVec3::Y * x + *second * y + *view * z;
        let half = DVec3::new(alpha * normal.x, alpha * normal.y, normal.z.max(0.0)).normalize();
        let between = half.dot(*to_eye).clamp(0.0, 1.0);
        [between, 2.0 * between * half.z - to_eye.z]
    }

    /// Height of the reflected direction for a point on the chord at x. `part` is the point's position
    /// relative to the chord's center, in units of half the chord's length.
    fn reflected_direction_height(&self, x: f64, part: f64) -> f64 {
        self.facet_and_reflected_cosines(x, (1.0 - x * x).sqrt() * part)[1]
    }

    /// A point on the chord at x whose facet reflects light above the surface, or `None` if there is no such
    /// point.
    fn find_upward_reflecting_point(&self, x: f64) -> Option<f64> {
        const STEPS: u32 = 12;
        let parts = (0..=STEPS).map(|i| 2.0 * f64::from(i) / f64::from(STEPS) - 1.0);
        let heights = parts.map(|part| (part, self.reflected_direction_height(x, part)));
        heights.max_by(|one, other| one.1.total_cmp(&other.1)).filter(|best| best.1 > 0.0).map(|best| best.0)
    }

    /// The interval around `lit` on the chord in which facets reflect light above the surface. Its ends are
    /// relative to the chord's center, in units of half the chord's length.
    fn lit_interval(&self, x: f64, lit: f64) -> [f64; 2] {
        [-1.0, 1.0]
            .map(|end| bisect_last_true(lit, end, |part| self.reflected_direction_height(x, part) > 0.0))
    }
}

/// Smith's Λ.
fn smith_lambda(cosine: f64, alpha: f64) -> f64 {
    let tangent2 = (1.0 - cosine * cosine).max(0.0) / (cosine * cosine);
    0.5 * ((1.0 + alpha * alpha * tangent2).sqrt() - 1.0)
}

/// The last position from `from` toward `to` where a predicate is true, found by bisection. The predicate
/// must be true at `from`.
fn bisect_last_true(mut from: f64, mut to: f64, holds: impl Fn(f64) -> bool) -> f64 {
    if holds(to) {
        return to;
    }
    for _ in 0..16 {
        let middle = 0.5 * (from + to);
        *(if holds(middle) { &mut from } else { &mut to }) = middle;
    }
    from
}

/// Quadrature nodes in (0, 1) and their weights, for functions that vary quickly near both ends.
fn quadrature_dense_at_ends(count: usize) -> Vec<(f64, f64)> {
    gauss_legendre(count).map(|(t, weight)| (t * t * (3.0 - 2.0 * t), weight * 6.0 * t * (1.0 - t))).collect()
}

/// E(μ), the mean of F·G/G₁ over visible normals. Uses `ACROSS` nodes in the direction perpendicular to the
/// plane of incidence and `ALONG` nodes parallel to it. For accuracy, the nodes cover only facets that
/// reflect light above the surface.
fn integrate_albedo<const ACROSS: usize, const ALONG: usize>(
    cosine: f64,
    alpha: f64,
    reflectance: &impl Fn(f64) -> f64,
) -> f64 {
    let facets = VisibleNormalDistribution::new(cosine, alpha);
    // Half of the disk is enough because the integrand is symmetric.
    let widest = bisect_last_true(0.0, 0.25 * TAU, |turn| {
        facets.find_upward_reflecting_point(libm::sin(turn)).is_some()
    });
    let along = quadrature_dense_at_ends(ALONG);
    let mut sum = 0.0;
    for (turn, by_turn) in quadrature_dense_at_ends(ACROSS) {
        let (x, chord) = libm::sincos(widest * turn);
        let Some(lit) = facets.find_upward_reflecting_point(x) else { continue };
        let [from, to] = facets.lit_interval(x, lit);
        for &(part, by_part) in &along {
            let [between, mirrored] =
                facets.facet_and_reflected_cosines(x, chord * (from + (to - from) * part));
            let left =
                (1.0 + facets.masked) / (1.0 + facets.masked + smith_lambda(mirrored.max(1e-12), alpha));
            let area = widest * by_turn * chord * chord * (to - from) * by_part;
            sum += area * reflectance(between) * left;
        }
    }
    sum * 4.0 / TAU
}

/// Double-precision version of [`crate::materials::fresnel::fresnel_dielectric`] for light from outside.
pub fn fresnel_dielectric_f64(cosine: f64, eta: f64) -> f64 {
    let root = (eta * eta - 1.0 + cosine * cosine).sqrt();
    let square = |over: f64, under: f64| if under > 0.0 { (over / under) * (over / under) } else { 0.0 };
    let parallel = square(eta * eta * cosine - root, eta * eta * cosine + root);
    0.5 * (parallel + square(cosine - root, cosine + root))
}

/// Effective reflectance kd/(1 − kd·F_dr) of a diffuse base under a coat, for light that has entered the
/// coat. `returned` is the coat's internal reflectance F_dr.
pub fn reflectance_inside_coat(diffuse: Vec3, returned: f32) -> Vec3 {
    diffuse / (Vec3::ONE - diffuse * returned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::choice::Choice;

    const GGX: MicrofacetDistribution = MicrofacetDistribution::Ggx;

    #[test]
    fn polynomials_are_tight_upper_bounds() {
        /// Facet reflectance as a function of the cosine and the index of refraction.
        type Reflectance = fn(f64, f64) -> f64;
        let grazing: Reflectance = |cosine, _| (1.0 - cosine).powi(5);
        let normal: Reflectance = |cosine, _| 1.0 - (1.0 - cosine).powi(5);
        let exact = [1.0, 1.05, 1.33, 1.5, 2.5, 4.0].map(|eta| (fresnel_dielectric_f64 as Reflectance, eta));
        for (reflectance, eta) in exact.into_iter().chain([(grazing, 0.0), (normal, 0.0)]) {
            let reflectance = |cosine: f64| reflectance(cosine, eta);
            for alpha in [0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 0.6, 1.0] {
                let fit = LobeAlbedoPolynomial::for_microfacet_lobe(GGX, alpha, reflectance);
                for step in (5..=100_u32).step_by(5) {
                    let cosine = f64::from(step) / 100.0;
                    let exact = integrate_albedo::<24, 48>(cosine, alpha, &reflectance);
                    let missing = f64::from(fit.at_cosine(cosine as f32)) - exact;
                    assert!((-1e-4..8e-4).contains(&missing), "η {eta}, α {alpha}, μ {cosine}: {missing}");
                }
            }
        }
    }

    /// Integrates over visible normals in many uniform steps, without treating reflections below the surface
    /// separately.
    fn plain_quadrature(cosine: f64, alpha: f64, reflectance: impl Fn(f64) -> f64) -> f64 {
        const STEPS: i32 = 600;
        let facets = VisibleNormalDistribution::new(cosine, alpha);
        let place = |i: i32| (f64::from(i) + 0.5) / f64::from(STEPS);
        let (mut sum, count) = (0.0, f64::from(STEPS * STEPS));
        for i in 0..STEPS * STEPS {
            let (radius, turn) = (place(i / STEPS).sqrt(), TAU * place(i % STEPS));
            let (sin, cos) = libm::sincos(turn);
            let [between, mirrored] = facets.facet_and_reflected_cosines(radius * cos, radius * sin);
            if mirrored > 0.0 {
                let left = (1.0 + facets.masked) / (1.0 + facets.masked + smith_lambda(mirrored, alpha));
                sum += reflectance(between) * left;
            }
        }
        sum / count
    }

    #[test]
    fn quadrature_matches_brute_force() {
        for alpha in [0.003, 0.1, 0.4, 1.0] {
            for cosine in [0.05, 0.2, 0.6, 1.0] {
                for (eta, fresnel) in
                    [(1.5, fresnel_dielectric_f64 as fn(f64, f64) -> f64), (0.0, |_, _| 1.0)]
                {
                    let reflectance = |cosine: f64| fresnel(cosine, eta);
                    let found = integrate_albedo::<12, 16>(cosine, alpha, &reflectance);
                    let exact = plain_quadrature(cosine, alpha, reflectance);
                    assert!((found - exact).abs() < 3e-4, "α {alpha}, μ {cosine}: {found}, not {exact}");
                }
            }
        }
    }

    #[test]
    fn smooth_lobes_match_fresnel() {
        // The expected mean is 2 ∫ F(μ) μ dμ for η = 1.5.
        let smooth =
            LobeAlbedoPolynomial::fit_storing_exact_mean(|cosine| fresnel_dielectric_f64(cosine, 1.5));
        assert!((smooth.mean - 0.091_778_0).abs() < 2e-5, "{}", smooth.mean);
        let narrow = LobeAlbedoPolynomial::for_microfacet_lobe(GGX, 0.001, |cosine| {
            fresnel_dielectric_f64(cosine, 1.5)
        });
        assert!((narrow.mean - smooth.mean).abs() < 1e-3, "{}", narrow.mean);
    }

    #[test]
    fn interpolated_tables_match_single_entries() {
        let fresnel = |cosine: f64| fresnel_dielectric_f64(cosine, 1.5);
        let alpha = |roughness: f32| (roughness * roughness).max(0.001);
        for &distribution in MicrofacetDistribution::ALL {
            let table = AlbedoTable::new(distribution, None, alpha, fresnel);
            for roughness in [0.0, 0.1, 0.23, 0.5, 0.77, 1.0] {
                let single = AlbedoTable::new(distribution, Some(roughness), alpha, fresnel);
                let single = single.lobe_at_roughness(roughness);
                let lerp = table.lobe_at_roughness(roughness);
                assert!((lerp.mean - single.mean).abs() < 5e-4);
                for cosine in [0.05, 0.1, 0.3, 0.6, 1.0] {
                    let (one, other) = (lerp.at_cosine(cosine), single.at_cosine(cosine));
                    assert!(
                        (one - other).abs() < 2e-3,
                        "{distribution:?}, roughness {roughness}, μ {cosine}: {one} instead of {other}"
                    );
                }
            }
        }
    }
}
