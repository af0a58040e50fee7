//! Light sampling for a packet of points in which each point has its own light.

use super::area::mesh::{AreaSampledTriangles, MeshEmitter};
use super::area::packet::triangle_packet_of;
use super::area::quad::QuadEmitter;
use super::area::sphere::SphereEmitter;
use super::area::{AreaLight, SampledLightPoint, ShapeEmitter};
use super::delta::DeltaPositionLight;
use super::packet::{LightSamplePacket, packet_of};
use super::sample::GeometryOfLight;
use super::{Light, Lights};
use crate::geometry::packet::set_bit_lanes;
use crate::math::Vec3;
use crate::math::lanes::{F32x16, PACKET_SIZE, Vec3x16, lane, set_lane};

/// Samples convex emitters for a packet in which each lane has its own emitter.
macro_rules! convex_packet_of {
    ($i:ident => $all:expr, $points:expr, $u:expr) => {{
        let mut row = packet_of!(GeometryOfLight::Nothing, $i => {
            let (emitter, light) = $all[$i];
            let SampledLightPoint { direction, target, factor } =
                emitter.sample(lane($points, $i), [$u[0][$i], $u[1][$i]]);
            (direction, target, light.radiance * factor)
        });
        for $i in 0..PACKET_SIZE {
            row.sources.set_geometry($i, GeometryOfLight::Object($all[$i].1.object));
        }
        row
    }};
}

impl Lights {
    /// [`Light::sample`] for the points in the mask `used`, where each lane has its own light. Returns the
    /// samples, the inverse pdfs in sr (as in [`Light::inverse_pdfs_of_samples`]), and the number of texture
    /// lookups.
    #[inline(always)]
    pub fn sample_per_lane(
        &self,
        picked: &[u32; PACKET_SIZE],
        (points, normals): (&Vec3x16, &Vec3x16),
        used: u32,
        u: &[F32x16; 2],
    ) -> (LightSamplePacket, F32x16, u64) {
        let mut lights = [self.get(picked[0]); PACKET_SIZE];
        for i in 1..PACKET_SIZE {
            lights[i] = self.get(picked[i]);
        }
        let mut row = LightSamplePacket::black(GeometryOfLight::Nothing);
        let mut left = used;
        // Sample all lights of the same kind together. Other lanes get a copy of one of these lights, but
        // their results are discarded.
        while left != 0 {
            let first = left.trailing_zeros() as usize % PACKET_SIZE;
            let mut of = 0;
            let found = if let Some(filler) = lights[first].as_point() {
                let lights = lights_of_kind_or_filler((&lights, left), &mut of, Light::as_point, filler);
                packet_of!(GeometryOfLight::Nothing, i => {
                    let (direction, weight) = lights[i].direction_and_irradiance(lane(points, i));
                    (direction, lights[i].position.as_vec3(), weight)
                })
            } else if let Some(filler) = as_sphere_and_light(lights[first]) {
                let balls = lights_of_kind_or_filler((&lights, left), &mut of, as_sphere_and_light, filler);
                convex_packet_of!(i => balls, points, u)
            } else if let Some(filler) = as_quad_and_light(lights[first]) {
                let quads = lights_of_kind_or_filler((&lights, left), &mut of, as_quad_and_light, filler);
                let mut row = convex_packet_of!(i => quads, points, u);
                for i in 0..PACKET_SIZE {
                    if let Some((_, Some(two))) = quads[i].1.shape.as_quad() {
                        row.sources.part[i] =
                            two.primitive_containing(lane(points, i), lane(&row.targets, i));
                    }
                }
                row
            } else if let Some(filler) = area_sampled_mesh_and_light(lights[first]) {
                let all =
                    lights_of_kind_or_filler((&lights, left), &mut of, area_sampled_mesh_and_light, filler);
                triangle_packet_of!(i => (all[i].0, all[i].1), points, u)
            } else {
                of = 1 << first;
                let sample = |i: usize, point| {
                    lights[i].sample_unmodulated(point, lane(normals, i), [u[0][i], u[1][i]])
                };
                LightSamplePacket::sample_one_by_one(points, of, sample)
            };
            // Usually, all lanes have lights of the same kind.
            if of == used {
                row = found;
            } else {
                row.copy_lanes(of, &found);
            }
            left &= !of;
        }
        let mut inverse = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            inverse[i] = lights[i].inverse_pdf_of_sample(lane(&row.directions, i), lane(&row.weights, i));
        }
        // Apply the emission modulations. They do not affect the pdfs.
        let mut lookups = 0;
        for i in set_bit_lanes(used) {
            let weight = lane(&row.weights, i);
            if let Some(modulation) = lights[i].emission_modulation().filter(|_| weight != Vec3::ZERO) {
                let (target, direction) = (lane(&row.targets, i), lane(&row.directions, i));
                let weight = weight * modulation.radiance_factor(target, row.sources.part[i], direction);
                set_lane(&mut row.weights, i, weight);
                lookups += 1;
            }
        }
        (row, inverse, lookups)
    }
}

#[inline(always)]
fn as_sphere_and_light(light: &Light) -> Option<(&SphereEmitter, &AreaLight)> {
    let light = light.as_area()?;
    light.shape.as_sphere().map(|sphere| (sphere, light))
}

#[inline(always)]
fn as_quad_and_light(light: &Light) -> Option<(&QuadEmitter, &AreaLight)> {
    let light = light.as_area()?;
    light.shape.as_quad().map(|(quad, _)| (quad, light))
}

#[inline(always)]
fn area_sampled_mesh_and_light(light: &Light) -> Option<(&AreaSampledTriangles, &AreaLight)> {
    let light = light.as_area()?;
    light.shape.as_mesh().and_then(MeshEmitter::as_area_sampled).map(|facets| (facets, light))
}

/// Returns the lights of one kind, and adds the lanes that have such a light to `of`. All other lanes get
/// `filler`.
#[inline(always)]
fn lights_of_kind_or_filler<'a, T: Copy>(
    (lights, left): (&[&'a Light; PACKET_SIZE], u32),
    of: &mut u32,
    kind: impl Fn(&'a Light) -> Option<T>,
    filler: T,
) -> [T; PACKET_SIZE] {
    let mut all = [filler; PACKET_SIZE];
    for i in 0..PACKET_SIZE {
        if let Some(own) = kind(lights[i]) {
            all[i] = own;
            *of |= left & 1 << i;
        }
    }
    all
}
