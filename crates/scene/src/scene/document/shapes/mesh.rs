//! `[[mesh]]`.

use std::collections::HashMap;
use std::path::PathBuf;

use super::super::super::description::{Located, Mesh, Shape};
use super::super::limits::Limits;
use super::super::table::Table;
use crate::math::DVec3;

/// Endings of mesh files that can be read.
pub(super) const MESHES: [&str; 3] = ["obj", "off", "ply"];

/// Endings that other versions read.
pub(super) const UNAVAILABLE: [&str; 3] = ["stl", "gltf", "glb"];

/// The mesh files named so far, each once, however it is written.
#[derive(Default)]
pub(super) struct MeshFiles {
    list: Vec<Located<PathBuf>>,
    indices: HashMap<PathBuf, usize>,
}

impl MeshFiles {
    fn index(&mut self, file: Located<PathBuf>) -> usize {
        let identity = file.value.canonicalize().unwrap_or_else(|_| file.value.clone());
        *self.indices.entry(identity).or_insert_with(|| {
            self.list.push(file);
            self.list.len() - 1
        })
    }

    pub(super) fn into_list(self) -> Vec<Located<PathBuf>> {
        self.list
    }
}

pub(super) fn read(table: &Table<'_>, files: &mut MeshFiles) -> Option<Shape> {
    let file = table.required("file", "\"mesh.obj\"").file(&MESHES, &UNAVAILABLE);
    let scale = table.optional("scale").scale(Limits::NotZero).unwrap_or(DVec3::ONE);
    let rotate = table.optional("rotate").vector(Limits::Any).unwrap_or(DVec3::ZERO);
    let translate = table.optional("translate").vector(Limits::Any).unwrap_or(DVec3::ZERO);
    let smooth = table.optional("smooth").flag().unwrap_or(true);
    Some(Shape::Mesh(Mesh { file: files.index(file?), scale, rotate, translate, smooth }))
}
