//! Unprocessed contents of a mesh file, as returned by its parser.

use std::path::PathBuf;

use rayon::prelude::*;

use super::coincident;
use crate::assets::{Companion, FileMaterial};
use crate::control::{CancelToken, Canceled};
use crate::geometry::mesh::VertexNormalGroup;
use crate::math::{DVec3, Vec2, Vec3};

/// Returns the index of the face that contains a corner, given each face's number of corners.
pub(super) fn face_index_of_corner(arities: &[u32], corner: usize) -> usize {
    let mut end = 0;
    let is_before = |arity: &&u32| {
        end += **arity as usize;
        end <= corner
    };
    arities.iter().take_while(is_before).count()
}

/// Concatenated vertex indices of all polygons.
#[derive(Debug, Default)]
pub(crate) struct Faces {
    pub(super) corners: Vec<u32>,
    /// Number of corners per face. Empty if all faces are triangles.
    pub(super) arities: Vec<u32>,
}

impl Faces {
    /// Adds a corner to the current face. Call [`Faces::end_face`] after the last corner.
    pub(crate) fn push_corner(&mut self, vertex: u32) {
        self.corners.push(vertex);
    }

    /// Ends the current face, which has `arity` corners.
    pub(crate) fn end_face(&mut self, arity: usize) {
        if self.arities.is_empty() && arity == 3 {
            return;
        }
        if self.arities.is_empty() {
            let before = self.corners.len().saturating_sub(arity) / 3;
            self.arities.resize(before, 3);
        }
        self.arities.push(arity as u32);
    }

    pub(crate) fn reserve(&mut self, triangles: usize) {
        self.corners.reserve(3 * triangles);
    }

    /// Replaces each corner's vertex with the first vertex at the same position.
    pub(super) fn merge_vertices_by_position(
        &mut self,
        positions: &[Vec3],
        token: &CancelToken,
    ) -> Result<(), Canceled> {
        let mut first: Vec<u32> = (0..positions.len() as u32).collect();
        for place in coincident::find_coincident_vertex_sets(positions, token)? {
            place.iter().for_each(|&vertex| first[vertex as usize] = place[0]);
        }
        self.corners.par_iter_mut().for_each(|corner| *corner = first[*corner as usize]);
        Ok(())
    }

    /// Maximum number of corners, limited by 32-bit vertex indices.
    pub(crate) const MAX_CORNERS: usize = u32::MAX as usize;

    /// Index of the face that contains a corner.
    pub(super) fn face_of_corner(&self, corner: usize) -> usize {
        if self.arities.is_empty() {
            return corner / 3;
        }
        face_index_of_corner(&self.arities, corner)
    }

    /// Number of faces.
    pub(crate) fn len(&self) -> usize {
        if self.arities.is_empty() { self.corners.len() / 3 } else { self.arities.len() }
    }
}

/// Contents of a mesh file. `normals`, `normal_groups`, `uvs`, `second_uvs` and `colors` are empty or have
/// one entry per position. A zero normal means that the normal is missing. `face_materials` is empty or has
/// one entry per face.
#[derive(Debug, Default)]
pub(crate) struct ParsedMesh {
    pub(crate) positions: Vec<DVec3>,
    pub(crate) normals: Vec<Vec3>,
    pub(crate) normal_groups: Vec<VertexNormalGroup>,
    pub(crate) uvs: Vec<Vec2>,
    pub(crate) second_uvs: Vec<Vec2>,
    /// Colors in sRGB.
    pub(crate) colors: Vec<[u8; 3]>,
    pub(crate) faces: Faces,
    /// Texture coordinates of each face corner, or empty. For NaN, the vertex's coordinates are used.
    pub(crate) corner_uvs: Vec<Vec2>,
    /// Color of each face corner, or empty.
    pub(crate) corner_colors: Vec<[u8; 3]>,
    /// Whether every corner is a separate vertex. If so, coincident vertices must be merged.
    pub(crate) has_separate_corners: bool,
    pub(crate) face_materials: Vec<u32>,
    pub(crate) materials: Vec<FileMaterial>,
    pub(crate) warnings: Vec<String>,
    pub(crate) material_warnings: Vec<String>,
    pub(crate) companions: Vec<Companion>,
    pub(crate) pictures: Vec<PathBuf>,
}

/// Extreme values of a color component, each with the byte offset of its color.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ColorComponentExtremes {
    least: Option<(f64, usize)>,
    greatest: Option<(f64, usize)>,
    non_finite: Option<(f64, usize)>,
    /// First value that is not an integer.
    fraction: Option<(f64, usize)>,
}

impl ColorComponentExtremes {
    pub(super) fn add_component(&mut self, value: f64, at: usize) {
        if !value.is_finite() {
            self.non_finite.get_or_insert((value, at));
            return;
        }
        if value.fract() != 0.0 {
            self.fraction.get_or_insert((value, at));
        }
        if self.least.is_none_or(|(least, _)| value < least) {
            self.least = Some((value, at));
        }
        if self.greatest.is_none_or(|(greatest, _)| value > greatest) {
            self.greatest = Some((value, at));
        }
    }

    /// Largest value, or 0 if all values are negative.
    pub(super) fn max(&self) -> f64 {
        self.greatest.map_or(0.0, |(greatest, _)| greatest.max(0.0))
    }

    /// Returns the byte offset of a color with a value outside [0, `one`], and a warning.
    pub(super) fn out_of_range_color_warning(&self, one: f64) -> Option<(usize, String)> {
        let least = self.least.filter(|(least, _)| *least < 0.0);
        let greatest = self.greatest.filter(|(greatest, _)| *greatest > one);
        let (value, at) = self.non_finite.or(greatest).or(least)?;
        Some((at, clamped_color_warning(value, one)))
    }

    /// Returns the byte offset of a color with a fraction, and a warning that the header declares integers.
    pub(super) fn fraction_in_integer_color_warning(&self) -> Option<(usize, String)> {
        self.fraction.map(|(value, at)| (at, dropped_color_fractions_warning(value)))
    }
}

/// Warning about colors that are out of range.
pub(super) fn clamped_color_warning(value: f64, one: f64) -> String {
    format!("the color component {value} is outside the range from 0 to {one}; such values are clamped")
}

/// Warning about fractions in colors declared as integers.
pub(super) fn dropped_color_fractions_warning(value: f64) -> String {
    format!("the header declares integer colors, but a component is {value}; fractions are dropped")
}

/// Guesses whether colors range from 0 to 1 or from 0 to 255, for formats that do not specify the range.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ColorRangeDetector(ColorComponentExtremes);

impl ColorRangeDetector {
    /// Adds a color and its byte offset.
    pub(crate) fn add_color(&mut self, parts: [f64; 3], at: usize) {
        parts.into_iter().for_each(|part| self.0.add_component(part, at));
    }

    /// Color value at full intensity. If there are fractions and no value exceeds 2, values above 1 are
    /// assumed to be bright colors rather than bytes.
    pub(crate) fn full_intensity(&self) -> f64 {
        let (max, has_fractions) = (self.0.max(), self.0.fraction.is_some());
        let are_bytes = max > 2.0 || (max > 1.0 && !has_fractions);
        if are_bytes { 255.0 } else { 1.0 }
    }

    /// Returns the byte offset of a color with an out-of-range value, and a warning.
    pub(super) fn out_of_range_warning(&self) -> Option<(usize, String)> {
        self.0.out_of_range_color_warning(self.full_intensity())
    }

    /// Converts a color in this range to bytes.
    pub(crate) fn color_to_bytes(&self, parts: [f64; 3]) -> [u8; 3] {
        unit_color_to_bytes(parts.map(|part| part / self.full_intensity()))
    }
}

/// Converts an sRGB color with components in [0, 1] to bytes. NaN becomes 0.
pub(crate) fn unit_color_to_bytes(parts: [f64; 3]) -> [u8; 3] {
    parts.map(|part| (part.clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
}

/// Warning about colors with an alpha below 1.
pub(super) const ALPHA_IGNORED: &str = "color alpha is ignored";

/// Like [`ALPHA_IGNORED`], but with a line number.
pub(super) fn alpha_ignored_warning(line: usize) -> String {
    format!("line {line}: {ALPHA_IGNORED}")
}

/// Warning for files with both face colors and vertex colors.
pub(super) const FACE_COLORS_IGNORED: &str = "face colors are ignored because the vertices have colors";
