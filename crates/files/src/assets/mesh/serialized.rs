//! Mitsuba's serialized meshes. Each mesh consists of a header and a zlib stream, and a table at the end of
//! the file contains their offsets: 4 bytes each in version 3, 8 bytes in versions 4 and 5.

use std::io::Read;
use std::path::Path;

use flate2::read::ZlibDecoder;

use super::assemble::assemble;
use super::parsed::ParsedMesh;
use super::{AssetError, FILE_LIMIT, LoadedMesh, MeshFileBytes};
use crate::assets::read::{self, Monitor};
use crate::control::{CancelToken, Progress};
use crate::math::{DVec3, Vec2, Vec3};

/// Magic number in the first two bytes of each mesh.
const MAGIC: u16 = 0x041c;
/// Size of the header before each zlib stream, which consists of the magic number and the version.
const HEADER_BYTES: usize = 4;
/// Maximum number of vertices and of triangles in a mesh.
const MAX_COUNT: u64 = 1 << 30;
/// Maximum length of a name.
const MAX_NAME_BYTES: usize = 1 << 16;
/// Maximum number of bytes read at once.
const CHUNK_BYTES: usize = 1 << 20;

/// Bits of a mesh's flags. Those without a suffix apply to versions 3 and 4, and normals also to version 5.
const HAS_NORMALS: u32 = 0x1;
const HAS_COORDINATES: u32 = 0x2;
const HAS_COLORS: u32 = 0x8;
const IS_DOUBLE: u32 = 0x2000;
/// Version 5: the mesh has texture coordinates.
const HAS_COORDINATES_5: u32 = 0x4;
/// Version 5: encoded tangent frames replace the normals.
const HAS_TANGENTS_5: u32 = 0x2;

/// Whether a path has the extension `.serialized`.
pub fn has_serialized_extension(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("serialized"))
}

/// Reads mesh `part` of a file, counted from 0, or all meshes merged into one if `part` is `None`.
///
/// # Errors
/// - [`AssetError::Unreadable`] if the file is not a regular file of at most 4 GiB.
/// - [`AssetError::Malformed`] if the file is invalid, `part` is out of range, or the mesh has no usable face.
/// - [`AssetError::Canceled`].
pub fn load(
    path: &Path,
    part: Option<u32>,
    progress: Progress<'_>,
    token: &CancelToken,
) -> Result<LoadedMesh, AssetError> {
    let monitor = Monitor { progress, token };
    let bytes = read::read_bytes(path, FILE_LIMIT, monitor)?;
    let source = MeshFileBytes { path, bytes: &bytes, monitor };
    let parsed = parse(&source, part)?;
    let loaded = LoadedMesh { hash: read::hash_bytes(&bytes), ..assemble(&source, parsed)? };
    monitor.report_and_check_cancel(2 * bytes.len(), 2 * bytes.len())?;
    Ok(loaded)
}

fn parse(source: &MeshFileBytes<'_>, part: Option<u32>) -> Result<ParsedMesh, AssetError> {
    let offsets = mesh_offsets(source)?;
    let mut parsed = ParsedMesh::default();
    match part {
        Some(part) => {
            let Some(&offset) = offsets.get(part as usize) else {
                let count = offsets.len();
                let reason = format!("part {part} is out of range: the file has {count}, numbered from 0");
                return Err(source.malformed_error_without_line(reason));
            };
            add_mesh(source, offset, &mut parsed)?;
        }
        None => offsets.iter().try_for_each(|&offset| add_mesh(source, offset, &mut parsed))?,
    }
    Ok(parsed)
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

/// Version of the mesh at an offset, or `None` if no mesh starts there.
fn version_at(bytes: &[u8], at: usize) -> Option<u16> {
    if u16_at(bytes, at)? == MAGIC { u16_at(bytes, at + 2) } else { None }
}

/// Reads the offsets of all meshes from the end of the file.
fn mesh_offsets(source: &MeshFileBytes<'_>) -> Result<Vec<usize>, AssetError> {
    let bytes = source.bytes;
    let malformed = |reason: &str| Err(source.malformed_error_without_line(reason));
    let Some(version) = version_at(bytes, 0) else {
        return malformed("it is not a serialized Mitsuba mesh");
    };
    if !(3..=5).contains(&version) {
        return malformed(&format!("version {version} is not supported, only versions 3 to 5"));
    }
    let offset_bytes = if version == 3 { 4 } else { 8 };
    let table_end = bytes.len().saturating_sub(4);
    let count = bytes
        .get(table_end..)
        .and_then(|last| last.first_chunk())
        .map_or(0, |last| u32::from_le_bytes(*last));
    let table_start = table_end.checked_sub(offset_bytes * count as usize);
    let Some(table) =
        table_start.and_then(|start| bytes.get(start..table_end)).filter(|table| !table.is_empty())
    else {
        return malformed("the offset table at the end of the file is invalid; the file may be truncated");
    };
    let read = |entry: &[u8]| entry.iter().rev().fold(0_u64, |sum, byte| sum << 8 | u64::from(*byte));
    let offsets: Vec<usize> = table
        .chunks_exact(offset_bytes)
        .map(|entry| usize::try_from(read(entry)).unwrap_or(usize::MAX))
        .collect();
    Ok(offsets)
}

/// Reads the values of one mesh from its zlib stream.
struct MeshStream<'a> {
    source: &'a MeshFileBytes<'a>,
    decoder: ZlibDecoder<&'a [u8]>,
}

impl MeshStream<'_> {
    /// Reads `count` bytes. Allocates memory only as data arrives, because `count` may be corrupt.
    fn read_bytes(&mut self, count: usize) -> Result<Vec<u8>, AssetError> {
        let mut bytes = Vec::new();
        while bytes.len() < count {
            self.source.monitor.token.check_pause_and_cancel()?;
            let start = bytes.len();
            bytes.resize(count.min(start + CHUNK_BYTES), 0);
            self.decoder.read_exact(&mut bytes[start..]).map_err(|error| {
                let reason = match error.kind() {
                    std::io::ErrorKind::UnexpectedEof => "the mesh ends too early".to_owned(),
                    _ => format!("the compressed data is invalid: {error}"),
                };
                self.source.malformed_error_without_line(reason)
            })?;
        }
        Ok(bytes)
    }

    fn read_byte_array<const N: usize>(&mut self) -> Result<[u8; N], AssetError> {
        let mut array = [0; N];
        array.copy_from_slice(&self.read_bytes(N)?);
        Ok(array)
    }

    fn read_u32(&mut self) -> Result<u32, AssetError> {
        Ok(u32::from_le_bytes(self.read_byte_array()?))
    }

    fn read_u64(&mut self) -> Result<u64, AssetError> {
        Ok(u64::from_le_bytes(self.read_byte_array()?))
    }

    /// Reads a count, such as the number of vertices. `what` names the counted elements in errors.
    fn read_count(&mut self, what: &str) -> Result<usize, AssetError> {
        let count = self.read_u64()?;
        if count > MAX_COUNT {
            let reason = format!("it claims {count} {what}; the limit is {MAX_COUNT}");
            return Err(self.source.malformed_error_without_line(reason));
        }
        Ok(count as usize)
    }

    /// Skips a null-terminated name.
    fn skip_terminated_name(&mut self) -> Result<(), AssetError> {
        for _ in 0..MAX_NAME_BYTES {
            if self.read_byte_array::<1>()? == [0] {
                return Ok(());
            }
        }
        Err(self.source.malformed_error_without_line("the name of a mesh is too long"))
    }

    /// Reads `count` floating-point numbers in single or double precision.
    fn read_floats(&mut self, count: usize, is_double: bool) -> Result<Vec<f64>, AssetError> {
        let size = if is_double { 8 } else { 4 };
        let bytes = self.read_bytes(count * size)?;
        let single =
            |bytes: &[u8]| bytes.first_chunk().map_or(0.0, |bytes| f64::from(f32::from_le_bytes(*bytes)));
        let double = |bytes: &[u8]| bytes.first_chunk().map_or(0.0, |bytes| f64::from_le_bytes(*bytes));
        Ok(bytes
            .chunks_exact(size)
            .map(|bytes| if is_double { double(bytes) } else { single(bytes) })
            .collect())
    }

    fn read_indices(&mut self, count: usize) -> Result<Vec<u32>, AssetError> {
        let bytes = self.read_bytes(count * 4)?;
        let (indices, _) = bytes.as_chunks::<4>();
        Ok(indices.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect())
    }
}

/// Adds the mesh at an offset.
fn add_mesh(source: &MeshFileBytes<'_>, offset: usize, parsed: &mut ParsedMesh) -> Result<(), AssetError> {
    let Some(version) = version_at(source.bytes, offset) else {
        return Err(source.malformed_error_without_line("an offset in the table does not point to a mesh"));
    };
    source.report_progress(offset)?;
    let compressed = source.bytes.get(offset + HEADER_BYTES..).unwrap_or_default();
    let mut stream = MeshStream { source, decoder: ZlibDecoder::new(compressed) };
    let flags = stream.read_u32()?;
    let first = parsed.positions.len() as u32;
    let faces = match version {
        5 => add_vertices_of_version_5(&mut stream, flags, parsed)?,
        _ => add_vertices(&mut stream, flags, version, parsed)?,
    };
    let count = parsed.positions.len() as u32 - first;
    for (face, corners) in faces.chunks_exact(3).enumerate() {
        for &corner in corners {
            if corner >= count {
                let reason = super::vertex_out_of_range_message(corner.into(), count.into());
                return Err(source.malformed_error_without_line(format!("face {}: {reason}", face + 1)));
            }
            parsed.faces.push_corner(first + corner);
        }
        parsed.faces.end_face(3);
    }
    Ok(())
}

/// Adds the vertices of a mesh in version 3 or 4. Returns the vertex indices of its triangles.
fn add_vertices(
    stream: &mut MeshStream<'_>,
    flags: u32,
    version: u16,
    parsed: &mut ParsedMesh,
) -> Result<Vec<u32>, AssetError> {
    if version == 4 {
        stream.skip_terminated_name()?;
    }
    let (vertices, triangles) = (stream.read_count("vertices")?, stream.read_count("triangles")?);
    let is_double = flags & IS_DOUBLE != 0;
    let positions = stream.read_floats(3 * vertices, is_double)?;
    let normals =
        if flags & HAS_NORMALS != 0 { stream.read_floats(3 * vertices, is_double)? } else { Vec::new() };
    let uvs =
        if flags & HAS_COORDINATES != 0 { stream.read_floats(2 * vertices, is_double)? } else { Vec::new() };
    if flags & HAS_COLORS != 0 {
        stream.read_floats(3 * vertices, is_double)?;
        parsed.warnings.push("vertex colors are ignored".to_owned());
    }
    append_vertices(parsed, vertices, &positions, &normals, &uvs);
    stream.read_indices(3 * triangles)
}

/// Adds the vertices of a mesh in version 5, in which a vertex is a record of eight numbers. Returns the
/// vertex indices of its triangles.
fn add_vertices_of_version_5(
    stream: &mut MeshStream<'_>,
    flags: u32,
    parsed: &mut ParsedMesh,
) -> Result<Vec<u32>, AssetError> {
    let length = stream.read_u32()? as usize;
    if length > MAX_NAME_BYTES {
        return Err(stream.source.malformed_error_without_line("the name of a mesh is too long"));
    }
    stream.read_bytes(length)?;
    let (vertices, triangles) = (stream.read_count("vertices")?, stream.read_count("triangles")?);
    let (_, _) = (stream.read_count("surface points")?, stream.read_count("normals")?);
    let records = stream.read_floats(8 * vertices, false)?;
    let part = |start: usize, length: usize| -> Vec<f64> {
        records.chunks_exact(8).flat_map(|record| record[start..start + length].iter().copied()).collect()
    };
    let has_normals = flags & HAS_NORMALS != 0 && flags & HAS_TANGENTS_5 == 0;
    let normals = if has_normals { part(3, 3) } else { Vec::new() };
    let uvs = if flags & HAS_COORDINATES_5 != 0 { part(6, 2) } else { Vec::new() };
    append_vertices(parsed, vertices, &part(0, 3), &normals, &uvs);
    let faces = stream.read_indices(4 * triangles)?;
    Ok(faces.chunks_exact(4).flat_map(|face| face[..3].iter().copied()).collect())
}

/// Appends `count` vertices. If only some of the merged meshes have normals or texture coordinates, the
/// others get zeros.
fn append_vertices(parsed: &mut ParsedMesh, count: usize, positions: &[f64], normals: &[f64], uvs: &[f64]) {
    let before = parsed.positions.len();
    parsed.positions.extend(positions.chunks_exact(3).map(DVec3::from_slice));
    if !normals.is_empty() || !parsed.normals.is_empty() {
        parsed.normals.resize(before, Vec3::ZERO);
        parsed.normals.extend(normals.chunks_exact(3).map(|normal| DVec3::from_slice(normal).as_vec3()));
        parsed.normals.resize(before + count, Vec3::ZERO);
    }
    if !uvs.is_empty() || !parsed.uvs.is_empty() {
        parsed.uvs.resize(before, Vec2::ZERO);
        parsed.uvs.extend(uvs.chunks_exact(2).map(|uv| Vec2::new(uv[0] as f32, uv[1] as f32)));
        parsed.uvs.resize(before + count, Vec2::ZERO);
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::ZlibEncoder;

    use super::*;
    use crate::assets::expect_rejection;
    use crate::control::ignore_progress;

    /// Encodes a mesh of one triangle, whose first vertex is (x, 0, 0), in the given version of the format.
    fn triangle(version: u16, x: f32) -> Vec<u8> {
        let mut data: Vec<u8> = Vec::new();
        let floats = |data: &mut Vec<u8>, values: &[f32]| {
            values.iter().for_each(|value| data.extend(value.to_le_bytes()));
        };
        if version == 5 {
            data.extend((0x1000_u32 | HAS_COORDINATES_5).to_le_bytes());
            data.extend(1_u32.to_le_bytes());
            data.push(b'a');
            [3_u64, 1, 0, 0].iter().for_each(|count| data.extend(count.to_le_bytes()));
            for [px, py, u] in [[x, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 0.5]] {
                floats(&mut data, &[px, py, 0.0, 0.0, 0.0, 0.0, u, 0.25]);
            }
            [0_u32, 1, 2, 0].iter().for_each(|corner| data.extend(corner.to_le_bytes()));
        } else {
            data.extend((0x1000 | HAS_COORDINATES).to_le_bytes());
            if version == 4 {
                data.extend(b"name\0");
            }
            [3_u64, 1].iter().for_each(|count| data.extend(count.to_le_bytes()));
            floats(&mut data, &[x, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
            floats(&mut data, &[0.0, 0.25, 1.0, 0.25, 0.5, 0.25]);
            [0_u32, 1, 2].iter().for_each(|corner| data.extend(corner.to_le_bytes()));
        }
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(&data).expect("written");
        let header = [MAGIC.to_le_bytes(), version.to_le_bytes()].concat();
        [header, encoder.finish().expect("finished")].concat()
    }

    fn file(version: u16, meshes: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = meshes.concat();
        let mut offset = 0;
        for mesh in meshes {
            match version {
                3 => bytes.extend((offset as u32).to_le_bytes()),
                _ => bytes.extend((offset as u64).to_le_bytes()),
            }
            offset += mesh.len();
        }
        bytes.extend((meshes.len() as u32).to_le_bytes());
        bytes
    }

    fn load_bytes(bytes: &[u8], part: Option<u32>) -> Result<LoadedMesh, AssetError> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.serialized");
        std::fs::write(&path, bytes).expect("written");
        load(&path, part, &ignore_progress, &CancelToken::new())
    }

    #[test]
    fn all_versions_support_parts() {
        for version in [3, 4, 5] {
            let bytes = file(version, &[triangle(version, -1.0), triangle(version, -5.0)]);
            for (part, x, count) in [(Some(0), -1.0, 1), (Some(1), -5.0, 1), (None, -5.0, 2)] {
                let mesh = load_bytes(&bytes, part).expect("a mesh").mesh;
                let [min, _] = mesh.bounds_in_file_coordinates().expect("bounds");
                assert_eq!((min.x, mesh.triangles.len()), (x, count), "version {version}");
                assert_eq!(mesh.uvs[0], Vec2::new(0.0, 0.25), "version {version}");
            }
            let (_, reason) = expect_rejection(load_bytes(&bytes, Some(2)));
            assert!(reason.contains("out of range"), "{reason}");
        }
    }

    #[test]
    fn truncated_files_are_rejected() {
        let bytes = file(4, &[triangle(4, 0.5), triangle(4, 0.25)]);
        for length in 0..bytes.len() {
            assert!(load_bytes(&bytes[..length], Some(1)).is_err(), "{length}");
        }
    }

    #[test]
    fn corrupted_files_do_not_panic() {
        let bytes = file(5, &[triangle(5, 0.5)]);
        for at in 0..bytes.len() {
            for flip in [1, 0x80, 0xff] {
                let mut wrong = bytes.clone();
                wrong[at] ^= flip;
                let _ = load_bytes(&wrong, None);
            }
        }
    }
}
