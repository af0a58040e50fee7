//! The numbers of a mesh file, as its parser found them.

use std::path::PathBuf;

use rayon::prelude::*;

use super::places::shared;
use crate::assets::{Companion, FileMaterial};
use crate::control::{CancelToken, Cancelled};
use crate::geometry::mesh::NormalGroup;
use crate::math::{DVec3, Vec2, Vec3};

/// Polygons over vertices: corners of all, one after the other.
#[derive(Debug, Default)]
pub(crate) struct Faces {
    pub(super) corners: Vec<u32>,
    /// Corners of each face; empty as long as all are triangles.
    pub(super) arities: Vec<u32>,
}

impl Faces {
    /// Adds a corner to the face that [`Faces::close`] will end.
    pub(crate) fn corner(&mut self, vertex: u32) {
        self.corners.push(vertex);
    }

    /// Ends a face of this many corners.
    pub(crate) fn close(&mut self, arity: usize) {
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

    /// Gives corners at one place the same vertex, the first of them.
    pub(super) fn join(&mut self, positions: &[Vec3], token: &CancelToken) -> Result<(), Cancelled> {
        let mut first: Vec<u32> = (0..positions.len() as u32).collect();
        for place in shared(positions, token)? {
            place.iter().for_each(|&vertex| first[vertex as usize] = place[0]);
        }
        self.corners.par_iter_mut().for_each(|corner| *corner = first[*corner as usize]);
        Ok(())
    }

    /// Most corners that vertices of 32 bits can number.
    pub(crate) const MOST_CORNERS: usize = u32::MAX as usize;

    /// Number of faces.
    pub(crate) fn len(&self) -> usize {
        if self.arities.is_empty() { self.corners.len() / 3 } else { self.arities.len() }
    }
}

/// A mesh file's numbers. `normals`, `normal_groups`, `uvs`, `second_uvs` and `colors` are empty or one for each position; a normal of zero is missing.
/// `face_materials` is empty or one for each face.
#[derive(Debug, Default)]
pub(crate) struct Parsed {
    pub(crate) positions: Vec<DVec3>,
    pub(crate) normals: Vec<Vec3>,
    pub(crate) normal_groups: Vec<NormalGroup>,
    pub(crate) uvs: Vec<Vec2>,
    pub(crate) second_uvs: Vec<Vec2>,
    /// In sRGB.
    pub(crate) colors: Vec<[u8; 3]>,
    pub(crate) faces: Faces,
    /// Texture coordinates of each corner of the faces, NaN where it takes those of its vertex; or empty.
    pub(crate) corner_uvs: Vec<Vec2>,
    /// Color of each corner of the faces, or empty.
    pub(crate) corner_colors: Vec<[u8; 3]>,
    /// Whether each face has vertices of its own, of which those at one place become one.
    pub(crate) has_corners_apart: bool,
    pub(crate) face_materials: Vec<u32>,
    pub(crate) materials: Vec<FileMaterial>,
    pub(crate) warnings: Vec<String>,
    pub(crate) material_warnings: Vec<String>,
    pub(crate) companions: Vec<Companion>,
    pub(crate) pictures: Vec<PathBuf>,
}

/// The range of the colors of a file whose format does not say it: 0 to 1, or 0 to 255.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ColorRange {
    greatest: f64,
    has_fractions: bool,
}

impl ColorRange {
    /// The greatest number.
    pub(crate) fn greatest(&self) -> f64 {
        self.greatest
    }

    pub(crate) fn add(&mut self, parts: [f64; 3]) {
        for part in parts.into_iter().filter(|part| part.is_finite()) {
            self.greatest = self.greatest.max(part);
            self.has_fractions |= part.fract() != 0.0;
        }
    }

    /// The number that stands for 1. Fractions up to 2 are colors brighter than 1.
    pub(crate) fn one(&self) -> f64 {
        let are_bytes = self.greatest > 2.0 || (self.greatest > 1.0 && !self.has_fractions);
        if are_bytes { 255.0 } else { 1.0 }
    }

    /// A color of this range in bytes.
    pub(crate) fn bytes(&self, parts: [f64; 3]) -> [u8; 3] {
        color_bytes(parts.map(|part| part / self.one()))
    }
}

/// A vertex color with parts from 0 to 1 in sRGB, in bytes; NaN is 0.
pub(crate) fn color_bytes(parts: [f64; 3]) -> [u8; 3] {
    parts.map(|part| (part.clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
}
