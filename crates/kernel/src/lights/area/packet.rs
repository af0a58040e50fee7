//! Samples one area light for a packet of points.

use super::sample_point::SampledLightPoint;
use super::{AreaLight, Emitter, MeshEmitter, ShapeEmitter};
use crate::lights::packet::{LightSamplePacket, packet_of};
use crate::lights::sample::GeometryOfLight;
use crate::math::lanes::{F32x16, PACKET_SIZE, Vec3x16, lane, set_lane};

/// Samples triangles by area for a packet in which each lane has its own light.
macro_rules! triangle_packet_of {
    ($i:ident => ($facets:expr, $light:expr), $points:expr, $u:expr) => {{
        let mut row = packet_of!(GeometryOfLight::Nothing, $i => {
            let sample: SampledLightPoint = $facets.sample(lane($points, $i), [$u[0][$i], $u[1][$i]]);
            (sample.direction, sample.target, $light.radiance * sample.factor)
        });
        for $i in 0..PACKET_SIZE {
            let source = GeometryOfLight::Primitive($light.object, $facets.sampled_primitive($u[0][$i]));
            row.sources.set_geometry($i, source);
        }
        row
    }};
}

pub(crate) use triangle_packet_of;

impl AreaLight {
    /// [`AreaLight::sample_unmodulated`] for the points in the mask `used`.
    #[inline(always)]
    pub fn sample_unmodulated_packet(
        &self,
        points: &Vec3x16,
        normals: &Vec3x16,
        used: u32,
        u: &[F32x16; 2],
    ) -> LightSamplePacket {
        let source = self.geometry_of_light();
        macro_rules! packet_from {
            ($emitter:expr) => {
                packet_of!(source, i => {
                    let sample: SampledLightPoint = $emitter.sample(lane(points, i), [u[0][i], u[1][i]]);
                    (sample.direction, sample.target, self.radiance * sample.factor)
                })
            };
        }
        // All quads share one loop, because compilers do not vectorize a second one.
        if let Some((quad, of_two)) = self.shape.as_quad() {
            // Compute the differences in a separate loop because they need double precision. Otherwise,
            // compilers would also compute everything else only eight lanes at a time.
            let mut offsets = [[0.0; PACKET_SIZE]; 3];
            for i in 0..PACKET_SIZE {
                set_lane(&mut offsets, i, quad.offset_to_corner(lane(points, i)));
            }
            let mut row = packet_of!(source, i => {
                let sample = quad.sample_given_corner_offset(lane(points, i), lane(&offsets, i), [u[0][i], u[1][i]]);
                (sample.direction, sample.target, self.radiance * sample.factor)
            });
            if let Some(two) = of_two {
                for i in 0..PACKET_SIZE {
                    row.sources.part[i] = two.primitive_containing(lane(points, i), lane(&row.targets, i));
                }
            }
            return row;
        }
        if let Some(facets) = self.shape.as_mesh().and_then(MeshEmitter::as_area_sampled) {
            return triangle_packet_of!(i => (facets, self), points, u);
        }
        if let Emitter::TexturedQuad(picture) = &self.shape {
            return packet_from!(picture);
        }
        if let Emitter::Sphere(sphere) = &self.shape {
            return packet_from!(sphere);
        }
        if let Emitter::Disk(disk) = &self.shape {
            return packet_from!(disk);
        }
        if let Emitter::Box(cuboid) = &self.shape {
            return packet_from!(cuboid);
        }
        // Other shapes do not have a vectorized loop.
        LightSamplePacket::sample_one_by_one(points, used, |i, point| {
            self.sample_unmodulated(point, lane(normals, i), [u[0][i], u[1][i]])
        })
    }
}
