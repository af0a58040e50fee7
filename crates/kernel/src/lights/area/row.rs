//! Samples of one light that is a shape, for a row of points.

use super::sample_point::LightSamplePoint;
use super::{AreaLight, Emitter, MeshEmitter, ShapeEmitter};
use crate::lights::row::{LightRow, row_of};
use crate::lights::sample::Source;
use crate::math::lanes::{F32x16, PACKET_SIZE, Vec3x16, lane, set_lane};

/// Makes the row of samples of facets, with a light for each lane.
macro_rules! row_of_facets {
    ($i:ident => ($facets:expr, $light:expr), $points:expr, $u:expr) => {{
        let mut row = row_of!(Source::Nothing, $i => {
            let sample: LightSamplePoint = $facets.sample(lane($points, $i), [$u[0][$i], $u[1][$i]]);
            (sample.direction, sample.target, $light.radiance * sample.factor)
        });
        for $i in 0..PACKET_SIZE {
            let source = Source::Primitive($light.object, $facets.part($u[0][$i]));
            row.sources.set($i, source);
        }
        row
    }};
}

pub(in crate::lights) use row_of_facets;

impl AreaLight {
    /// [`AreaLight::plain_sample`] for the points whose bits are set, each by its own numbers.
    #[inline(always)]
    pub fn sample_row(&self, points: &Vec3x16, normals: &Vec3x16, used: u32, u: &[F32x16; 2]) -> LightRow {
        let source = self.source();
        macro_rules! row_by {
            ($emitter:expr) => {
                row_of!(source, i => {
                    let sample: LightSamplePoint = $emitter.sample(lane(points, i), [u[0][i], u[1][i]]);
                    (sample.direction, sample.target, self.radiance * sample.factor)
                })
            };
        }
        // One loop serves all quads: compilers make no vector instructions of a second one.
        if let Some((quad, of_two)) = self.shape.as_quad() {
            // The differences are of double precision: among them, the other operations would come eight at a time.
            let mut offsets = [[0.0; PACKET_SIZE]; 3];
            for i in 0..PACKET_SIZE {
                set_lane(&mut offsets, i, quad.corner_from(lane(points, i)));
            }
            let mut row = row_of!(source, i => {
                let sample = quad.sample_from(lane(points, i), lane(&offsets, i), [u[0][i], u[1][i]]);
                (sample.direction, sample.target, self.radiance * sample.factor)
            });
            if let Some(two) = of_two {
                for i in 0..PACKET_SIZE {
                    row.sources.part[i] = two.part(lane(points, i), lane(&row.targets, i));
                }
            }
            return row;
        }
        if let Some(facets) = self.shape.as_mesh().and_then(MeshEmitter::facets) {
            return row_of_facets!(i => (facets, self), points, u);
        }
        if let Emitter::TexturedQuad(picture) = &self.shape {
            return row_by!(picture);
        }
        if let Emitter::Sphere(sphere) = &self.shape {
            return row_by!(sphere);
        }
        if let Emitter::Disk(disk) = &self.shape {
            return row_by!(disk);
        }
        if let Emitter::Box(cuboid) = &self.shape {
            return row_by!(cuboid);
        }
        // The others have no loop.
        LightRow::one_by_one(points, used, |i, point| {
            self.plain_sample(point, lane(normals, i), [u[0][i], u[1][i]])
        })
    }
}
