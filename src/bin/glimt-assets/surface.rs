//! Polygon meshes with vertex attributes, and mesh file writers.

use std::fmt::Write;

use super::vector::{Vector, cross, scale, subtract, unit};

/// A polygon mesh. `normals` and `uvs` are empty or have one entry per position.
#[derive(Default)]
pub(crate) struct PolygonMesh {
    pub(crate) positions: Vec<Vector>,
    pub(crate) normals: Vec<Vector>,
    pub(crate) uvs: Vec<[f64; 2]>,
    pub(crate) faces: Vec<Vec<u32>>,
}

/// Finite-difference step for normals.
const STEP: f64 = 1e-4;

impl PolygonMesh {
    /// Creates `columns` × `rows` quads over s and t in [0, 1], with normals and the texture coordinates
    /// (1 − s, t) times `repeat`. The outside is along ∂t × ∂s.
    pub(crate) fn parametric_grid(
        columns: u32,
        rows: u32,
        repeat: [f64; 2],
        point: impl Fn(f64, f64) -> Vector,
    ) -> Self {
        let mut surface = Self::default();
        for column in 0..=columns {
            for row in 0..=rows {
                let (s, t) = (f64::from(column) / f64::from(columns), f64::from(row) / f64::from(rows));
                surface.positions.push(point(s, t));
                // Avoid the ends, where the surface may converge to a point.
                let inner = t.clamp(10.0 * STEP, 1.0 - 10.0 * STEP);
                let across = subtract(point(s + STEP, inner), point(s - STEP, inner));
                let along = subtract(point(s, inner + STEP), point(s, inner - STEP));
                surface.normals.push(unit(cross(along, across)));
                surface.uvs.push([(1.0 - s) * repeat[0], t * repeat[1]]);
            }
        }
        let index = |column: u32, row: u32| column * (rows + 1) + row;
        for column in 0..columns {
            for row in 0..rows {
                let (next, above) = (column + 1, row + 1);
                surface.faces.push(vec![
                    index(column, row),
                    index(column, above),
                    index(next, above),
                    index(next, row),
                ]);
            }
        }
        surface
    }

    pub(crate) fn triangle_count(&self) -> usize {
        self.faces.iter().map(|face| face.len() - 2).sum()
    }

    /// Writes little-endian binary PLY with only positions and triangles.
    pub(crate) fn to_ply(&self) -> Vec<u8> {
        let mut file = format!(
            "ply\nformat binary_little_endian 1.0\ncomment made by glimt-assets\nelement vertex {}\nproperty float \
             x\nproperty float y\nproperty float z\nelement face {}\nproperty list uchar uint \
             vertex_indices\nend_header\n",
            self.positions.len(),
            self.triangle_count()
        )
        .into_bytes();
        for coordinate in self.positions.as_flattened() {
            file.extend((*coordinate as f32).to_le_bytes());
        }
        for face in &self.faces {
            for pair in face[1..].windows(2) {
                file.push(3);
                [face[0], pair[0], pair[1]].iter().for_each(|corner| file.extend(corner.to_le_bytes()));
            }
        }
        file
    }

    /// Writes OBJ, keeping polygons.
    pub(crate) fn to_obj(&self, title: &str) -> Vec<u8> {
        let mut file = format!("# {title}. Made by glimt-assets.\n");
        for position in &self.positions {
            write_keyword_and_numbers(&mut file, "v", position, 5);
        }
        for uv in &self.uvs {
            write_keyword_and_numbers(&mut file, "vt", uv, 4);
        }
        for normal in &self.normals {
            write_keyword_and_numbers(&mut file, "vn", normal, 4);
        }
        for face in &self.faces {
            file.push('f');
            for corner in face.iter().map(|corner| corner + 1) {
                // Writing to a string cannot fail.
                let _ = write!(file, " {corner}/{corner}/{corner}");
            }
            file.push('\n');
        }
        file.into_bytes()
    }

    /// Writes OFF, keeping polygons.
    pub(crate) fn to_off(&self, title: &str) -> Vec<u8> {
        let mut file = format!("OFF\n# {title}. Made by glimt-assets.\n");
        let _ = writeln!(file, "{} {} 0", self.positions.len(), self.faces.len());
        for position in &self.positions {
            write_keyword_and_numbers(&mut file, "", position, 7);
        }
        for face in &self.faces {
            let corners: Vec<String> = face.iter().map(u32::to_string).collect();
            let _ = writeln!(file, "{} {}", face.len(), corners.join(" "));
        }
        file.into_bytes()
    }
}

fn write_keyword_and_numbers(file: &mut String, keyword: &str, numbers: &[f64], digits: usize) {
    // Add 0 after rounding to avoid `-0.00000`.
    let unit = 10_f64.powi(digits as i32);
    let words: Vec<String> =
        numbers.iter().map(|number| format!("{:.digits$}", (number * unit).round() / unit + 0.0)).collect();
    let words = words.join(" ");
    file.push_str(keyword);
    file.push_str(if keyword.is_empty() { "" } else { " " });
    file.push_str(&words);
    file.push('\n');
}

/// The twelve vertices and twenty faces of a regular icosahedron of radius 1.
pub(crate) fn icosahedron() -> (Vec<Vector>, Vec<[u32; 3]>) {
    let golden = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut corners = Vec::new();
    for (a, b) in [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)] {
        corners.push([a, b, 0.0]);
    }
    for (a, b) in [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)] {
        corners.push([0.0, a, b]);
    }
    for (a, b) in [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)] {
        corners.push([b, 0.0, a]);
    }
    let corners: Vec<Vector> = corners.into_iter().map(unit).collect();
    let edge = 1.06;
    let near = |a: usize, b: usize| {
        let d = subtract(corners[a], corners[b]);
        super::vector::dot(d, d) < edge * edge * 1.01
    };
    let mut faces = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(c, a) {
                    let front = cross(subtract(corners[b], corners[a]), subtract(corners[c], corners[a]));
                    let outside = super::vector::dot(front, corners[a]) > 0.0;
                    let (second, third) = if outside { (b, c) } else { (c, b) };
                    faces.push([a, second, third].map(|corner| corner as u32));
                }
            }
        }
    }
    (corners, faces)
}

/// The midpoint of two points on the unit sphere, projected onto the sphere.
pub(crate) fn sphere_midpoint(a: Vector, b: Vector) -> Vector {
    unit(scale(super::vector::add(a, b), 0.5))
}
