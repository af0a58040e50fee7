//! Writes `plymesh` shapes, whose meshes are in files.

use std::io::Read;
use std::path::Path;

use super::lexer::{PbrtError, PbrtResult};
use super::parameters::{Parameters, Text};
use super::scene::PbrtConverter;
use super::shapes::MaterialAndPlacement;
use crate::assets::mesh::{load, load_from_bytes};
use crate::assets::{AssetError, Companion, LoadedMesh, read_gzip_file};
use crate::control::ignore_progress;
use crate::formats::foreign::meshes::MeshData;
use crate::formats::foreign::transform::matrix_value;
use crate::math::DMat4;
use crate::system::file::FileStamp;

/// Maximum size of a decompressed mesh.
const MAX_MESH_BYTES: u64 = 4 << 30;
/// Files below this size are read immediately, in order to skip meshes without area.
const SMALL_FILE_BYTES: u64 = 2048;
/// Start of the loader's message for a mesh without area.
const NO_USABLE_FACE: &str = "no usable face";

/// Properties of a mesh file that are read before the file is loaded.
struct MeshFileProperties {
    has_normals: bool,
    has_uvs: bool,
    size: u64,
}

impl PbrtConverter<'_> {
    /// Writes a `plymesh`. Its file is loaded later, with all other assets, unless the importer must
    /// decompress or change the mesh.
    pub(super) fn convert_mesh_file(
        &mut self,
        parameters: &Parameters,
        placement: &MaterialAndPlacement<'_>,
    ) -> PbrtResult<()> {
        let file = required_filename(parameters)?.clone();
        if parameters.find("displacement").is_some() {
            let text = "the surface is not displaced";
            let span = parameters.span_of("displacement");
            self.notes.note_substitution("`displacement` of a shape", text, span);
        }
        parameters.ignore(&["edgelength", "displacement.edgelength"]);
        if self.tolerate_if_missing(&file, "mesh", "skipped") {
            return Ok(());
        }
        let is_compressed = has_gzip_extension(&file.text);
        if !is_compressed && !file.text.to_lowercase().ends_with(".ply") {
            let error = PbrtError::new(file.span, "`plymesh` can only read PLY files");
            return Err(error.with_help("the file name must end with .ply or .ply.gz"));
        }
        let path = self.asset_path(&file.text);
        self.companions.push(Companion {
            path: path.clone(),
            hash: None,
            stamp: FileStamp::from_path(&path),
        });
        let header = read_ply_properties(&path);
        let must_read = header.as_ref().is_some_and(|header| {
            header.size < SMALL_FILE_BYTES
                || placement.is_reversed
                || placement.emits && header.has_normals
                || placement.needs_uv && !header.has_uvs
        });
        if is_compressed || must_read {
            match self.load_mesh_file(parameters)? {
                Some(data)
                    if is_compressed || placement.emits || placement.needs_uv && data.uvs.is_empty() =>
                {
                    self.convert_mesh_data(data, &file_prefix(&file.text), placement);
                    return Ok(());
                }
                Some(_) => {}
                None => {
                    self.notes.note("a mesh without area", "skipped", file.span);
                    return Ok(());
                }
            }
        }
        self.document.set_span_for_next_values(placement.span.clone());
        match placement.group {
            Some(group) => self.document.start_group_list_table(group, "mesh"),
            None => self.document.start_list_table("mesh"),
        }
        self.document.set("material", placement.material.clone());
        let name = self.register_asset_file(&file);
        self.document.set("file", name);
        self.document.set_span_for_next_values(placement.span.clone());
        if header.is_some_and(|header| !header.has_normals) {
            self.document.set("smooth", false);
        }
        if placement.matrix != DMat4::IDENTITY {
            self.document.set("matrix", matrix_value(&placement.matrix));
        }
        Ok(())
    }

    /// Reads the mesh of a `plymesh`. Returns `None` if it has no area.
    pub(super) fn load_mesh_file(&mut self, parameters: &Parameters) -> PbrtResult<Option<MeshData>> {
        let file = required_filename(parameters)?;
        let path = self.asset_path(&file.text);
        match self.load_plain_or_gzip(&path) {
            Ok(loaded) => Ok(Some(MeshData::from_loaded(&loaded))),
            Err(AssetError::Malformed { reason, .. }) if reason.starts_with(NO_USABLE_FACE) => Ok(None),
            Err(error) => Err(PbrtError::new(file.span.clone(), error.to_string())),
        }
    }

    fn load_plain_or_gzip(&mut self, path: &Path) -> Result<LoadedMesh, AssetError> {
        if !has_gzip_extension(&path.to_string_lossy()) {
            let loaded = load(path, &ignore_progress, self.token);
            let hash = loaded.as_ref().ok().map(|loaded| loaded.hash);
            self.companions.push(Companion { path: path.to_owned(), hash, stamp: None });
            return loaded;
        }
        let file = read_gzip_file(path, MAX_MESH_BYTES, self.token);
        let (hash, stamp) = file.as_ref().map_or((None, None), |file| (Some(file.hash), file.stamp));
        self.companions.push(Companion { path: path.to_owned(), hash, stamp });
        load_from_bytes(&path.with_extension(""), &file?.bytes, &ignore_progress, self.token)
    }
}

fn required_filename(parameters: &Parameters) -> PbrtResult<&Text> {
    let missing = || PbrtError::new(parameters.span.clone(), "this mesh has no `filename`");
    parameters.string("filename")?.ok_or_else(missing)
}

fn has_gzip_extension(file: &str) -> bool {
    file.to_lowercase().ends_with(".gz")
}

fn file_prefix(file: &str) -> String {
    let name = Path::new(file).file_name().unwrap_or_default().to_string_lossy().into_owned();
    name.split('.').next().unwrap_or_default().to_owned()
}

/// Reads the header of a PLY file. Returns `None` if the file is unreadable, which loading it will report.
fn read_ply_properties(path: &Path) -> Option<MeshFileProperties> {
    /// Maximum size of a header.
    const MAX_HEADER: u64 = 4096;
    let (file, metadata) = crate::system::file::open_regular_file(path).ok()?.ok()?;
    let mut bytes = Vec::new();
    file.take(MAX_HEADER).read_to_end(&mut bytes).ok()?;
    let text = String::from_utf8_lossy(&bytes);
    let header = text.split("end_header").next().unwrap_or_default();
    let has = |names: &[&str]| {
        let is_property = |line: &str| {
            line.starts_with("property")
                && names.contains(&line.split_whitespace().last().unwrap_or_default())
        };
        header.lines().any(|line| is_property(line.trim()))
    };
    let has_normals = has(&["nx"]);
    let has_uvs = has(&["u", "s", "texture_u", "texture_s"]);
    Some(MeshFileProperties { has_normals, has_uvs, size: metadata.len() })
}
