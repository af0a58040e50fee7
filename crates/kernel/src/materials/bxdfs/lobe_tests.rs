//! Checks for lobes of any shape, shared by the tests of all kinds of BSDFs. They compare values with an
//! `f64` reference and samples with pdfs, and compute albedos. The `alphas` of a surface are used only to
//! place directions, so for other lobes the width of the closest microfacet lobe is sufficient.

use crate::materials::bsdf::{DielectricSamplePacket, LobesToSample, ShownLobes};
use crate::materials::bxdf::{Bxdf, ShadingGeometry};
use crate::materials::bxdf_packet::BxdfPacket;
use crate::math::lanes::{F32x16, PACKET_SIZE, Vec3x16, lane, set_lane};
use crate::math::random::unit_generator as random;
use crate::math::{DVec3, Vec3};

use super::reference_tests::squared_slope;
use super::test_packet::OutOfLineTestPacket;
use std::f64::consts::{PI, TAU};

/// The tested values of α.
pub const ALPHAS: [f32; 7] = [0.001, 0.004, 0.02, 0.05, 0.2, 0.5, 1.0];

/// The tested view cosines.
pub const COSINES: [f64; 5] = [0.05, 0.15, 0.4, 0.8, 1.0];

/// Tangent of the test surfaces, along x.
pub const TANGENT: Vec3 = Vec3::new(3.0, 0.0, 0.5);

/// Computes a unit direction from its cosine with the z axis and its azimuth.
pub fn spherical_direction(cosine: f64, azimuth: f64) -> DVec3 {
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let (sin, cos) = libm::sincos(azimuth);
    DVec3::new(sine * cos, sine * sin, cosine)
}

/// How light reaches the viewer in a narrow lobe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NarrowLightPath {
    /// By reflection.
    Mirrored,
    /// By refraction. Contains the index of refraction on the light's side divided by the index on the
    /// viewer's side.
    Refracted(f64),
    /// By transmission, in the direction of reflection mirrored at the surface.
    Through,
}

impl NarrowLightPath {
    /// The sign of z on the light's side.
    pub fn light_side_sign(self) -> f64 {
        match self {
            Self::Mirrored => 1.0,
            Self::Refracted(_) | Self::Through => -1.0,
        }
    }
}

/// Estimates a value from samples with `side` strata along each axis. Half as many are usually enough, so
/// they are used first, and kept if the estimate `is_close` to the exact value.
pub fn estimate_close_to_exact<T>(
    side: u32,
    estimate: impl Fn(u32) -> T,
    is_close: impl Fn(&T) -> bool,
) -> T {
    let coarse = estimate(side / 2);
    if is_close(&coarse) { coarse } else { estimate(side) }
}

/// Returns packets of lobe choices and random numbers for `side` × `side` stratified samples.
fn stratified_packets(side: u32) -> impl Iterator<Item = (F32x16, [F32x16; 2])> {
    let mut next = random(5);
    (0..side * side).step_by(PACKET_SIZE).map(move |first| {
        let (mut choices, mut u): (F32x16, [F32x16; 2]) = ([0.0; PACKET_SIZE], [[0.0; PACKET_SIZE]; 2]);
        let place = |i: u32, next: f32| ((i as f32 + next) / side as f32).min(1.0 - f32::EPSILON);
        for i in 0..PACKET_SIZE as u32 {
            let number = first + i;
            // Use the golden ratio to spread the choices over the cells.
            let choice = (f64::from(number) * 0.618_033_988_749_894_9).fract();
            choices[i as usize] = choice as f32;
            u[0][i as usize] = place(number % side, next());
            u[1][i as usize] = place(number / side % side, next());
        }
        (choices, u)
    })
}

/// A sample on either side of a surface.
pub struct TwoSidedSample {
    /// Unit direction.
    pub direction: DVec3,
    /// Pdf of the direction in sr⁻¹.
    pub density: f64,
    /// f·cosθ divided by the pdf.
    pub share: f64,
    /// Whether the direction and the packet's light are on opposite sides.
    pub is_beyond: bool,
}

/// A surface whose normal is the z axis, seen from a direction.
pub struct TestSurface<B: Bxdf> {
    row: OutOfLineTestPacket<B>,
    to_eye: DVec3,
    alphas: [f64; 2],
    light: NarrowLightPath,
}

impl<B: Bxdf> TestSurface<B> {
    /// Creates a surface with a material. `alphas` are the α values of its narrow lobe.
    pub fn new(point: &B::Point, alphas: [f32; 2], to_eye: DVec3) -> Self {
        Self::with_light_path(point, alphas, to_eye, NarrowLightPath::Mirrored)
    }

    /// [`TestSurface::new`] for the given kind of lighting.
    pub fn with_light_path(
        point: &B::Point,
        alphas: [f32; 2],
        to_eye: DVec3,
        light: NarrowLightPath,
    ) -> Self {
        let mut row = OutOfLineTestPacket::<B>::empty();
        for i in 0..PACKET_SIZE {
            let normal = Vec3::Z * light.light_side_sign() as f32;
            let place = ShadingGeometry { normal, wo: to_eye.as_vec3(), tangent: TANGENT };
            row.set_bsdf(i, point, ShownLobes::ALL, &place);
        }
        Self { row, to_eye, alphas: alphas.map(f64::from), light }
    }

    /// Normals on the lit side.
    fn lit_side_normals(&self) -> Vec3x16 {
        [[0.0; PACKET_SIZE], [0.0; PACKET_SIZE], [self.light.light_side_sign() as f32; PACKET_SIZE]]
    }

    /// Cosine between a direction and the normal on the lit side.
    fn height(&self, direction: DVec3) -> f64 {
        direction.z * self.light.light_side_sign()
    }

    /// f, the part of f from the wide lobes, and the pdf, for light from each direction.
    pub fn evaluate_bsdf(&self, lobes: LobesToSample, directions: &[DVec3]) -> Vec<(DVec3, DVec3, f64)> {
        let mut all = Vec::with_capacity(directions.len());
        for (number, some) in directions.chunks(PACKET_SIZE).enumerate() {
            let mut rows = [[0.0; PACKET_SIZE], [0.0; PACKET_SIZE], [1.0; PACKET_SIZE]];
            for (i, direction) in some.iter().enumerate() {
                set_lane(&mut rows, i, direction.as_vec3());
            }
            let values = self.row.f(&rows);
            let pdf = self.row.pdf(lobes, &self.lit_side_normals(), &rows, &values);
            for i in 0..some.len() {
                let (wide, narrow) = (lane(&values.wide, i).as_dvec3(), lane(&values.narrow, i).as_dvec3());
                let f = lane(&values.f(), i).as_dvec3();
                assert!(
                    (wide + narrow - f).abs().max_element() <= 2e-6 * f.max_element(),
                    "the parts should add up to {f}"
                );
                // Compare only one lane per packet, because evaluating single lanes is slow.
                if i == number % some.len() {
                    self.check_single_lane(i, some[i], f, wide);
                }
                all.push((f, wide, f64::from(pdf[i])));
            }
        }
        all
    }

    /// Compares f, and the contribution of the wide lobes to it, between a single lane and its packet.
    fn check_single_lane(&self, i: usize, direction: DVec3, f: DVec3, wide: DVec3) {
        let [alone, of_wide_lobes, of_all_lobes] = self.row.lane_f_by_lobe_set(i, direction.as_vec3());
        assert_eq!(alone, of_all_lobes);
        let off = (of_wide_lobes.as_dvec3() - wide).abs().max_element();
        assert!(off <= 1e-5 * f.max_element(), "{of_wide_lobes} instead of {wide}");
        let alone = alone.as_dvec3();
        assert!((alone - f).abs().max_element() <= 1e-5 * f.max_element(), "{alone} instead of {f}");
    }

    /// Directions sampled with `side` × `side` stratified random numbers.
    pub fn sample_directions(&self, lobes: LobesToSample, side: u32) -> Vec<DVec3> {
        let rows = stratified_packets(side)
            .map(|(choices, u)| self.row.sample(lobes, &self.lit_side_normals(), &choices, &u));
        let mut all: Vec<DVec3> =
            rows.flat_map(|row| (0..PACKET_SIZE).map(move |i| lane(&row, i).as_dvec3())).collect();
        all.truncate((side * side) as usize);
        all
    }

    /// Samples on either side with the same random numbers as [`TestSurface::sample_directions`].
    pub fn sample_reflection_or_transmission(
        &self,
        side: u32,
        sample: impl Fn(&BxdfPacket<B>, &F32x16, &[F32x16; 2]) -> DielectricSamplePacket,
    ) -> Vec<TwoSidedSample> {
        let rows = stratified_packets(side).map(|(choices, u)| sample(&self.row.0, &choices, &u));
        let one = |row: &DielectricSamplePacket, i: usize| TwoSidedSample {
            direction: lane(&row.directions, i).as_dvec3(),
            density: f64::from(row.densities[i]),
            share: f64::from(row.shares[i]),
            is_beyond: row.beyond[i] != 0,
        };
        let mut all: Vec<TwoSidedSample> =
            rows.flat_map(|row| (0..PACKET_SIZE).map(|i| one(&row, i)).collect::<Vec<_>>()).collect();
        all.truncate((side * side) as usize);
        all
    }

    /// Albedo of all lobes, estimated as the mean of f·cos/pdf over samples.
    pub fn sampled_albedo(&self, side: u32) -> DVec3 {
        self.mean_sample_weight(&self.sample_directions(LobesToSample::All, side))
    }

    /// [`TestSurface::sampled_albedo`] with 16 lobe choices per cell.
    pub fn lobe_stratified_albedo(&self, side: u32) -> DVec3 {
        let mut next = random(6);
        let mut samples = Vec::new();
        for number in 0..side * side {
            let [x, y] =
                [number % side, number / side].map(|i| ((i as f32 + next()) / side as f32).min(0.999_999_9));
            let choices =
                std::array::from_fn(|i| ((i as f32 + next()) / PACKET_SIZE as f32).min(0.999_999_9));
            let u = [[x; PACKET_SIZE], [y; PACKET_SIZE]];
            let directions = self.row.sample(LobesToSample::All, &self.lit_side_normals(), &choices, &u);
            samples.extend((0..PACKET_SIZE).map(|i| lane(&directions, i).as_dvec3()));
        }
        self.mean_sample_weight(&samples)
    }

    /// Maximum of f·cos/pdf over samples of all lobes.
    pub fn largest_weight(&self, side: u32) -> f64 {
        let samples = self.sample_directions(LobesToSample::All, side);
        let values = self.evaluate_bsdf(LobesToSample::All, &samples);
        let weights = samples.iter().zip(values).map(|(direction, (f, _, pdf))| {
            if pdf > 0.0 { f.max_element() * self.height(*direction).max(0.0) / pdf } else { 0.0 }
        });
        weights.fold(0.0, f64::max)
    }

    /// Mean of f·cos/pdf.
    fn mean_sample_weight(&self, samples: &[DVec3]) -> DVec3 {
        let values = self.evaluate_bsdf(LobesToSample::All, samples);
        let sum: DVec3 = samples
            .iter()
            .zip(values)
            .filter(|(direction, (_, _, pdf))| self.height(**direction) > 0.0 && *pdf > 0.0)
            .map(|(direction, (f, _, pdf))| f * (self.height(*direction) / pdf))
            .sum();
        sum / samples.len() as f64
    }

    /// Albedo by quadrature of f, over half vectors for the narrow lobe and over directions for the wide
    /// lobes.
    pub fn albedo(&self) -> DVec3 {
        self.albedo_with_ring_count(192)
    }

    /// [`TestSurface::albedo`] with a given number of rings of half vectors.
    pub fn albedo_with_ring_count(&self, rings: u32) -> DVec3 {
        let (directions, weights): (Vec<DVec3>, Vec<f64>) = self
            .directions_from_half_vectors(rings, 192)
            .map(|(direction, weight)| (direction, weight * self.height(direction)))
            .unzip();
        let values = self.evaluate_bsdf(LobesToSample::All, &directions);
        let narrow: DVec3 =
            values.iter().zip(weights).map(|((f, wide, _), weight)| (*f - *wide) * weight).sum();
        let (rings, steps) = (128_u32, 64_u32);
        let directions: Vec<DVec3> = (0..rings * steps)
            .map(|i| {
                let cosine2 = (f64::from(i / steps) + 0.5) / f64::from(rings);
                let up = spherical_direction(cosine2.sqrt(), f64::from(i % steps) / f64::from(steps) * TAU);
                DVec3::new(up.x, up.y, up.z * self.light.light_side_sign())
            })
            .collect();
        let wide: DVec3 =
            self.evaluate_bsdf(LobesToSample::All, &directions).iter().map(|(_, wide, _)| *wide).sum();
        narrow + wide * (PI / f64::from(rings * steps))
    }

    /// Albedo of a narrow lobe with the given f, by quadrature over half vectors in `f64`.
    pub fn reference_albedo(&self, f: impl Fn(DVec3, DVec3) -> f64) -> f64 {
        let all = self.directions_from_half_vectors(200, 100);
        all.map(|(direction, weight)| weight * self.height(direction) * f(self.to_eye, direction)).sum()
    }

    /// Directions above the surface and their solid angles, computed from half vectors with equal steps in y
    /// and azimuth. (1 − y)² is the fraction of D outside a given angle, so the steps also cover the tail.
    fn directions_from_half_vectors(&self, rings: u32, steps: u32) -> impl Iterator<Item = (DVec3, f64)> {
        (0..rings * steps).filter_map(move |i| {
            let y = (f64::from(i / steps) + 0.5) / f64::from(rings);
            let phi = (f64::from(i % steps) + 0.5) / f64::from(steps) * TAU;
            let (direction, solid_angle) = self.map_to_direction(y, phi)?;
            Some((direction, solid_angle / f64::from(rings * steps)))
        })
    }

    /// The direction at a point of the half-vector map, and its solid angle per unit area of the map. `None`
    /// if the direction is below the surface.
    pub fn map_to_direction(&self, y: f64, phi: f64) -> Option<(DVec3, f64)> {
        let [u, v] = self.alphas;
        let outside = (1.0 - y) * (1.0 - y);
        let slope = ((1.0 - outside) / outside).sqrt();
        let (sin, cos) = libm::sincos(phi);
        let half = DVec3::new(u * slope * cos, v * slope * sin, 1.0).normalize();
        let cosine = half.dot(self.to_eye);
        let mirrored = half * (2.0 * cosine) - self.to_eye;
        // Ratio between the solid angles of directions and half vectors.
        let (direction, spread) = match self.light {
            NarrowLightPath::Mirrored => (mirrored, 4.0 * cosine),
            NarrowLightPath::Through => (DVec3::new(mirrored.x, mirrored.y, -mirrored.z), 4.0 * cosine),
            NarrowLightPath::Refracted(eta) => {
                let beyond = (eta * eta - 1.0 + cosine * cosine).sqrt();
                if beyond.is_nan() {
                    return None;
                }
                let direction = (half * (cosine - beyond) - self.to_eye) / eta;
                (direction, (cosine - beyond).powi(2) / (eta * beyond))
            }
        };
        let stretched = (half.x / u).powi(2) + (half.y / v).powi(2) + half.z * half.z;
        let density = half.z / (PI * u * v * stretched * stretched);
        let is_seen = cosine > 0.0 && self.height(direction) > 0.0;
        is_seen.then(|| (direction, spread * 2.0 * (1.0 - y) / density))
    }

    /// The point on the half-vector map that corresponds to a direction.
    fn direction_to_map(&self, direction: DVec3) -> [f64; 2] {
        let [u, v] = self.alphas;
        let sum = match self.light {
            NarrowLightPath::Mirrored => direction + self.to_eye,
            NarrowLightPath::Through => DVec3::new(direction.x, direction.y, -direction.z) + self.to_eye,
            NarrowLightPath::Refracted(eta) => self.to_eye + direction * eta,
        };
        let half = if sum.z < 0.0 { -sum } else { sum }.normalize();
        let (x, y) = (half.x / u / half.z, half.y / v / half.z);
        let slope2 = x * x + y * y;
        let turn = y.atan2(x) / TAU;
        [1.0 - 1.0 / (1.0 + slope2).sqrt(), if turn < 0.0 { turn + 1.0 } else { turn }]
    }

    /// χ² test that compares samples with the pdf in cells of the half-vector map. The statistic must be at
    /// most six standard deviations above its mean.
    pub fn check_samples(&self, what: &str, lobes: LobesToSample) {
        const CELLS: u32 = 16;
        // Near total reflection, refraction into a thinner medium has a square-root singularity.
        let fine = if let NarrowLightPath::Refracted(..1.0) = self.light { 36 } else { 12 };
        let mut next = random(23);
        let mut counts = vec![0.0; (CELLS * CELLS + 1) as usize];
        let total = 400 * 400;
        for _ in 0..total / PACKET_SIZE {
            let mut numbers = || std::array::from_fn(|_| next());
            let directions =
                self.row.sample(lobes, &self.lit_side_normals(), &numbers(), &[numbers(), numbers()]);
            for i in 0..PACKET_SIZE {
                let direction = lane(&directions, i).as_dvec3();
                let [y, turn] = self.direction_to_map(direction);
                let cell = |part: f64| ((part * f64::from(CELLS)) as u32).min(CELLS - 1);
                let below = CELLS * CELLS;
                let number = if self.height(direction) > 0.0 { cell(y) * CELLS + cell(turn) } else { below };
                counts[number as usize] += 1.0;
            }
        }
        // Integrate the pdf over each cell. The remaining probability is below the surface.
        let side = CELLS * fine;
        let part = |i: u32| (f64::from(i) + 0.5) / f64::from(side);
        let places: Vec<(usize, DVec3, f64)> = (0..side * side)
            .filter_map(|i| {
                let (ring, step) = (i / side, i % side);
                let (direction, solid_angle) = self.map_to_direction(part(ring), part(step) * TAU)?;
                Some(((ring / fine * CELLS + step / fine) as usize, direction, solid_angle))
            })
            .collect();
        let directions: Vec<DVec3> = places.iter().map(|place| place.1).collect();
        let mut expected = vec![0.0; counts.len()];
        for ((cell, _, solid_angle), (_, _, pdf)) in places.iter().zip(self.evaluate_bsdf(lobes, &directions))
        {
            expected[*cell] += pdf * solid_angle / f64::from(side * side) * total as f64;
        }
        let above: f64 = expected.iter().sum();
        assert!(above < 1.003 * total as f64, "{what}: the pdf integrates to {}", above / total as f64);
        expected[(CELLS * CELLS) as usize] = (total as f64 - above).max(0.0);
        // Merge cells with few expected samples.
        let (mut sum, mut cells, mut rest) = (0.0, 0.0, [0.0; 2]);
        for (count, expected) in counts.iter().zip(&expected) {
            if *expected >= 20.0 {
                sum += (count - expected).powi(2) / expected;
                cells += 1.0;
            } else {
                rest = [rest[0] + count, rest[1] + expected];
            }
        }
        assert!((rest[0] - rest[1]).abs() <= 6.0 * rest[1].sqrt() + 30.0, "{what}: {rest:?} in small cells");
        assert!(sum < cells + 6.0 * (2.0_f64 * cells).sqrt(), "{what}: χ² {sum} over {cells} cells");
    }
}

/// Checks reciprocity and compares f with a reference, for directions near the peak and elsewhere.
pub fn check_values<B: Bxdf>(
    what: &str,
    point: &B::Point,
    alphas: [f32; 2],
    reference: impl Fn(DVec3, DVec3) -> DVec3,
) {
    check_values_within::<B>(what, point, alphas, |_, _| 1.0, reference);
}

/// [`check_values`] for the Beckmann distribution, which amplifies rounding errors at steep slopes.
pub fn check_beckmann_values<B: Bxdf>(
    what: &str,
    point: &B::Point,
    alphas: [f32; 2],
    reference: impl Fn(DVec3, DVec3) -> DVec3,
) {
    let room = |o: DVec3, i: DVec3| 1.0 + squared_slope(o + i, alphas.map(f64::from));
    check_values_within::<B>(what, point, alphas, room, reference);
}

/// [`check_values`] with a factor on the tolerated relative error.
fn check_values_within<B: Bxdf>(
    what: &str,
    point: &B::Point,
    alphas: [f32; 2],
    room: impl Fn(DVec3, DVec3) -> f64,
    reference: impl Fn(DVec3, DVec3) -> DVec3,
) {
    let mut next = random(9);
    let least = alphas[0].min(alphas[1]);
    let (reciprocity, error) = if least >= 0.05 { (1e-5, 2e-5) } else { (1e-3, 5e-3) };
    for _ in 0..300 {
        let to_eye = spherical_direction(f64::from(0.05 + 0.95 * next()), f64::from(next()) * TAU)
            .as_vec3()
            .as_dvec3();
        let there = TestSurface::<B>::new(point, alphas, to_eye);
        let far = spherical_direction(f64::from(0.05 + 0.95 * next()), f64::from(next()) * TAU);
        let near = there.map_to_direction(f64::from(0.98 * next()), f64::from(next()) * TAU);
        let near = near.map_or(far, |(near, _)| near);
        for light in [far, near].map(|light| light.as_vec3().as_dvec3()) {
            if light.z < 0.02 {
                continue;
            }
            let (f, _, _) = there.evaluate_bsdf(LobesToSample::All, &[light])[0];
            let (back, _, _) =
                TestSurface::<B>::new(point, alphas, light).evaluate_bsdf(LobesToSample::All, &[to_eye])[0];
            let size = f.max_element();
            assert!(
                (f - back).abs().max_element() <= reciprocity * size,
                "{what}: {f} forward, {back} reversed, from {light} to {to_eye}"
            );
            let (to_eye, light) = (to_eye.normalize(), light.normalize());
            let exact = reference(to_eye, light);
            assert!(
                (f - exact).abs().max_element() <= room(to_eye, light) * error * exact.max_element() + 1e-25,
                "{what}: {f} instead of {exact}, from {light} to {to_eye}"
            );
        }
    }
}
