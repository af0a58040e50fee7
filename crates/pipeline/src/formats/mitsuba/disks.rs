//! Converts disks.

use std::f64::consts::TAU;

use super::graph::PluginInstance;
use super::material_key::UvFlips;
use super::reader::SceneReader;
use super::shapes::ShapeTarget;
use crate::formats::foreign::meshes::MeshData;
use crate::formats::foreign::transform::{linear_part, similarity_scale};
use crate::math::DVec3;

/// Sectors of a textured disk.
const SECTORS: u32 = 512;

/// A disk with Mitsuba's texture coordinates: u is the radius, and v is the angle from +x divided by 2π.
fn polar_disk(normal: DVec3) -> MeshData {
    let mut mesh = MeshData::tessellate_surface([1, SECTORS], |uv| {
        let angle = TAU * uv.y;
        (DVec3::new(libm::cos(angle), libm::sin(angle), 0.0) * uv.x, normal)
    });
    // In each of the remaining triangles, the center is in the middle between the other corners.
    for triangle in &mesh.triangles {
        let rim = triangle.map(|vertex| mesh.uvs[vertex as usize]).into_iter().filter(|uv| uv.x > 0.0);
        let angle = rim.map(|uv| uv.y).sum::<f64>() / 2.0;
        for vertex in triangle.map(|vertex| vertex as usize) {
            if mesh.uvs[vertex].x == 0.0 {
                mesh.uvs[vertex].y = angle;
            }
        }
    }
    mesh.orient_triangles_like_pbrt(false);
    mesh
}

impl<'a> SceneReader<'a> {
    pub(super) fn add_disk(&mut self, object: &'a PluginInstance, target: ShapeTarget<'_>) -> bool {
        let Some(matrix) = self.shape_transform(object) else { return false };
        let is_flipped = self.boolean(object, "flip_normals", false);
        let Some(material) = self.shape_material(object, UvFlips::default()) else { return false };
        let normal = if is_flipped { DVec3::NEG_Z } else { DVec3::Z };
        if self.shape_uses_coordinates(object) {
            return self.add_generated_mesh(polar_disk(normal), object, target, material, &matrix);
        }
        self.start_shape(object, target, "disk", material);
        match similarity_scale(&matrix) {
            Some(scale) => {
                let normal = linear_part(&matrix).inverse().transpose() * normal;
                self.document.set("center", matrix.transform_point3(DVec3::ZERO));
                self.document.set("normal", normal.normalize());
                self.document.set("radius", scale);
            }
            None => {
                self.document.set("normal", normal);
                self.document.set("radius", 1.0);
                self.set_matrix(&matrix);
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec2;

    #[test]
    fn coordinates_are_radius_and_angle() {
        let mesh = polar_disk(DVec3::Z);
        assert_eq!(mesh.triangles.len(), SECTORS as usize);
        for triangle in &mesh.triangles {
            let corners = triangle.map(|vertex| (mesh.positions[vertex as usize], mesh.uvs[vertex as usize]));
            let middle = corners.iter().map(|(at, _)| *at).sum::<DVec3>() / 3.0;
            let uv = corners.iter().map(|(_, uv)| *uv).sum::<DVec2>() / 3.0;
            let turns = libm::atan2(middle.y, middle.x).rem_euclid(TAU) / TAU;
            assert!((uv.x - middle.length()).abs() < 1e-4 && (uv.y - turns).abs() < 1e-6, "{uv} {middle}");
        }
    }
}
