//! Samples of lights for a row of points, each of which picked its own light.

use super::area::mesh::{Facets, MeshEmitter};
use super::area::quad::QuadEmitter;
use super::area::row::row_of_facets;
use super::area::sphere::SphereEmitter;
use super::area::{AreaLight, LightSamplePoint, ShapeEmitter};
use super::delta::DeltaLight;
use super::row::{LightRow, row_of};
use super::sample::Source;
use super::{Light, Lights};
use crate::geometry::packet::lanes;
use crate::math::Vec3;
use crate::math::lanes::{F32x16, PACKET_SIZE, Vec3x16, lane, set_lane};

/// Samples a row of convex emitters, with a light for each lane.
macro_rules! row_of_wholes {
    ($i:ident => $all:expr, $points:expr, $u:expr) => {{
        let mut row = row_of!(Source::Nothing, $i => {
            let (emitter, light) = $all[$i];
            let LightSamplePoint { direction, target, factor } =
                emitter.sample(lane($points, $i), [$u[0][$i], $u[1][$i]]);
            (direction, target, light.radiance * factor)
        });
        for $i in 0..PACKET_SIZE {
            row.sources.set($i, Source::Object($all[$i].1.object));
        }
        row
    }};
}

impl Lights {
    /// [`Light::sample`] for each point whose bit is set, with its own light and numbers; the inverse pdfs in sr⁻¹, as
    /// [`Light::inverse_densities`]; and the number of texture look-ups.
    #[inline(always)]
    pub fn sample_each(
        &self,
        picked: &[u32; PACKET_SIZE],
        (points, normals): (&Vec3x16, &Vec3x16),
        used: u32,
        u: &[F32x16; 2],
    ) -> (LightRow, F32x16, u64) {
        let mut lights = [self.get(picked[0]); PACKET_SIZE];
        for i in 1..PACKET_SIZE {
            lights[i] = self.get(picked[i]);
        }
        let mut row = LightRow::dark(Source::Nothing);
        let mut left = used;
        // Sample the lights of each kind side by side. Lanes of other kinds get one of these lights as well, without effect.
        while left != 0 {
            let first = left.trailing_zeros() as usize % PACKET_SIZE;
            let mut of = 0;
            let found = if let Some(filler) = lights[first].as_point() {
                let lights = alike((&lights, left), &mut of, Light::as_point, filler);
                row_of!(Source::Nothing, i => {
                    let (direction, weight) = lights[i].arriving(lane(points, i));
                    (direction, lights[i].position.as_vec3(), weight)
                })
            } else if let Some(filler) = ball(lights[first]) {
                let balls = alike((&lights, left), &mut of, ball, filler);
                row_of_wholes!(i => balls, points, u)
            } else if let Some(filler) = quad(lights[first]) {
                let quads = alike((&lights, left), &mut of, quad, filler);
                let mut row = row_of_wholes!(i => quads, points, u);
                for i in 0..PACKET_SIZE {
                    if let Some((_, Some(two))) = quads[i].1.shape.as_quad() {
                        row.sources.part[i] = two.part(lane(points, i), lane(&row.targets, i));
                    }
                }
                row
            } else if let Some(filler) = facets(lights[first]) {
                let all = alike((&lights, left), &mut of, facets, filler);
                row_of_facets!(i => (all[i].0, all[i].1), points, u)
            } else {
                of = 1 << first;
                let sample =
                    |i: usize, point| lights[i].plain_sample(point, lane(normals, i), [u[0][i], u[1][i]]);
                LightRow::one_by_one(points, of, sample)
            };
            // Most rows pick lights of one kind.
            if of == used {
                row = found;
            } else {
                row.take_lanes(of, &found);
            }
            left &= !of;
        }
        let mut inverse = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            inverse[i] = lights[i].inverse_density(lane(&row.directions, i), lane(&row.weights, i));
        }
        // Take the pdfs of plain lamps.
        let mut lookups = 0;
        for i in lanes(used) {
            let weight = lane(&row.weights, i);
            if let Some(texture) = lights[i].emission_texture().filter(|_| weight != Vec3::ZERO) {
                let (target, direction) = (lane(&row.targets, i), lane(&row.directions, i));
                let weight = weight * texture.at(target, row.sources.part[i], direction);
                set_lane(&mut row.weights, i, weight);
                lookups += 1;
            }
        }
        (row, inverse, lookups)
    }
}

#[inline(always)]
fn ball(light: &Light) -> Option<(&SphereEmitter, &AreaLight)> {
    let light = light.as_area()?;
    light.shape.as_sphere().map(|ball| (ball, light))
}

#[inline(always)]
fn quad(light: &Light) -> Option<(&QuadEmitter, &AreaLight)> {
    let light = light.as_area()?;
    light.shape.as_quad().map(|(quad, _)| (quad, light))
}

#[inline(always)]
fn facets(light: &Light) -> Option<(&Facets, &AreaLight)> {
    let light = light.as_area()?;
    light.shape.as_mesh().and_then(MeshEmitter::facets).map(|facets| (facets, light))
}

/// Lights of one kind, and a bit of `left` for each lane that has one; the other lanes get the filler.
#[inline(always)]
fn alike<'a, T: Copy>(
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
