//! Opens glTF files: JSON text, the chunks of GLB files, and buffers (Khronos, *glTF 2.0 Specification*).

use std::path::Path;

use super::json::{JsonAsset, Root, Uri};
use super::{FILE_LIMIT, GltfError, GltfFile, resolve_relative_uri, truncate_for_message};
use crate::assets::read::{self, Monitor};
use crate::assets::{AssetError, Companion};
use crate::control::{CancelToken, Progress, ignore_progress};
use crate::system::file::FileStamp;

/// Maximum size of the JSON, including data URIs.
pub(super) const JSON_LIMIT: usize = 512 << 20;

/// UTF-8 byte order mark, written by some programs.
pub(super) const BOM: &[u8] = b"\xef\xbb\xbf";

impl GltfFile {
    /// Opens a glTF file and reads its buffers.
    ///
    /// # Errors
    /// [`AssetError`], with the location in the JSON.
    pub fn open(path: &Path, progress: Progress<'_>, token: &CancelToken) -> Result<Self, AssetError> {
        let monitor = Monitor { progress, token };
        let bytes = read::read_unless_zeros_at_start(path, FILE_LIMIT, monitor)?;
        read::reject_utf16(path, &bytes)?;
        let (length, hash) = (bytes.len(), read::hash_bytes(&bytes));
        let wrong = |wrong: GltfError| AssetError::malformed(path, None, wrong.0);
        let (json, binary) = if bytes.starts_with(b"glTF") {
            glb_chunk_ranges(&bytes).map_err(wrong)?
        } else {
            (0..length, None)
        };
        // Parse the JSON.
        let text = &bytes[json];
        if text.len() > JSON_LIMIT {
            let (has, limit) = (text.len().div_ceil(1 << 20), JSON_LIMIT >> 20);
            return Err(wrong(GltfError::new(format!(
                "the JSON has {has} MiB; the limit is {limit} MiB; store the buffers in .glb or .bin files"
            ))));
        }
        let text = text.strip_prefix(BOM).unwrap_or(text);
        if !text.trim_ascii_start().starts_with(b"{") {
            let reason = if length == 0 {
                EMPTY_FILE
            } else if bytes.starts_with(b"glTF") {
                "not a glTF file: the JSON is not an object"
            } else {
                NEITHER_GLB_NOR_JSON
            };
            return Err(AssetError::malformed(path, None, reason));
        }
        let mut root: Root = serde_json::from_slice(text).map_err(|error| {
            if let Some(version) = version_of_pre_2_0_file(text) {
                return wrong(GltfError::new(unsupported_version_message(&version)));
            }
            let what = error.to_string();
            let what = replace_rust_terms(what.split(" at line ").next().unwrap_or_default());
            AssetError::malformed(
                path,
                Some(error.line()),
                format!("column {}: {}", error.column(), truncate_parser_message(&what)),
            )
        })?;
        check_gltf_versions(&root).map_err(wrong)?;
        check_required_extensions(&root).map_err(wrong)?;
        // Extract the binary chunk, then read the buffers.
        let binary = binary.map(|range| {
            let mut bytes = bytes;
            bytes.truncate(range.end);
            bytes.drain(..range.start);
            bytes
        });
        let (buffers, companions) = read_buffers(path, &mut root, binary, monitor)?;
        let mut container = Self {
            path: path.to_owned(),
            hash,
            root,
            buffers,
            companions,
            first_part_with_same_mesh: Vec::new(),
        };
        container.first_part_with_same_mesh = container.map_duplicate_parts().map_err(wrong)?;
        monitor.report_and_check_cancel(2 * length, 2 * length)?;
        Ok(container)
    }
}

/// Error message for an empty file.
pub(super) const EMPTY_FILE: &str = "the file is empty";
pub(super) const NEITHER_GLB_NOR_JSON: &str = "not a glTF file: neither GLB nor a JSON object";

pub(super) fn unsupported_version_message(version: &str) -> String {
    format!("glTF {} is not supported; version 2 is required", truncate_for_message(version))
}

pub(super) fn unsupported_glb_message(version: u32) -> String {
    format!("GLB version {version} is not supported; version 2 is required")
}

pub(super) fn newer_version_required_message(required: &str) -> String {
    format!("it requires glTF {required}; only 2.0 is supported")
}

pub(super) fn invalid_min_version_message(text: &str) -> String {
    format!("asset.minVersion is not a version: {:?}", truncate_for_message(text))
}

/// Error message for an unsupported extension that a file's meshes or images need.
pub(super) fn unsupported_extension_message(extension: &str, help: &str) -> String {
    format!("{extension} is not supported; {help}")
}

pub(super) fn unknown_extension_message(extension: &str) -> String {
    format!(
        "the required extension {} is not supported (extensionsRequired)",
        truncate_for_message(extension)
    )
}

pub(super) fn short_buffer_message(claimed: u64, has: usize) -> String {
    format!("it claims {claimed} bytes but has {has}")
}

pub(super) fn unreadable_buffer_file_message(reason: &str, number: usize, name: &str) -> String {
    format!("{reason}; {name} stores buffers[{number}] there")
}

/// An unsupported mesh compression extension.
pub(super) const DRACO: &str = "KHR_draco_mesh_compression";

/// Returns the version of a file that predates glTF 2.0, or `None` for other files. Such a file does not
/// parse as [`Root`], because older versions use JSON objects where glTF 2.0 uses arrays.
fn version_of_pre_2_0_file(text: &[u8]) -> Option<String> {
    #[derive(serde::Deserialize)]
    struct AssetOnlyRoot {
        asset: JsonAsset,
    }
    let AssetOnlyRoot { asset } = serde_json::from_slice(text).ok()?;
    let is_old = asset.version.starts_with("1.") || asset.version.starts_with("0.");
    is_old.then_some(asset.version)
}

/// Replaces Rust terms with JSON terms in a JSON parser message.
pub(super) fn replace_rust_terms(message: &str) -> String {
    let Some((before, expected)) = message.rsplit_once(", expected ") else { return message.to_owned() };
    let before = match before.strip_prefix("invalid type: ") {
        Some("map") => "invalid type: object".to_owned(),
        Some("sequence") => "invalid type: array".to_owned(),
        Some(_) | None => before.to_owned(),
    };
    let expected = match expected {
        "usize" | "u64" | "u32" => "a nonnegative integer",
        "f64" => "a number",
        "a sequence" => "an array",
        "a map" => "an object",
        other if other.starts_with("struct ") => "an object",
        other => other,
    };
    format!("{before}, expected {expected}")
}

/// Truncates long parser messages.
pub(super) fn truncate_parser_message(text: &str) -> String {
    text.chars().take(200).collect()
}

type ByteRange = std::ops::Range<usize>;

/// Byte ranges of the JSON and binary chunks in a GLB file (4.4).
fn glb_chunk_ranges(bytes: &[u8]) -> Result<(ByteRange, Option<ByteRange>), GltfError> {
    const JSON: u32 = 0x4e4f_534a;
    const BINARY: u32 = 0x004e_4942;
    let word = |at: usize| bytes.get(at..at + 4)?.first_chunk().copied().map(u32::from_le_bytes);
    match word(4) {
        Some(2) => {}
        Some(version) => {
            return Err(GltfError::new(unsupported_glb_message(version)));
        }
        None => return Err(GltfError::new("the file ends inside the header")),
    }
    let declared = word(8).map_or(0, |length| length as usize);
    let end_of = |at: usize| (at + 8).checked_add(word(at)? as usize).filter(|end| *end <= bytes.len());
    let is_chunk = |at: usize| matches!(word(at + 4), Some(JSON | BINARY)) && end_of(at).is_some();
    let (mut json, mut binary, mut at) = (None, None, 12);
    while let (Some(length), Some(kind)) = (word(at), word(at + 4)) {
        let start = at + 8;
        let Some(end) = end_of(at) else {
            // Ignore bytes past the length declared in the header.
            if at >= declared && json.is_some() && !matches!(kind, JSON | BINARY) {
                break;
            }
            let has = bytes.len() - start;
            return Err(GltfError::new(format!(
                "the chunk at byte {at} claims {length} bytes, but only {has} remain"
            )));
        };
        match kind {
            JSON if json.is_none() => json = Some(start..end),
            BINARY if binary.is_none() => binary = Some(start..end),
            _ => {}
        }
        // Some programs write chunks without padding them to a multiple of four.
        let next = end.next_multiple_of(4);
        at = if !is_chunk(next) && is_chunk(end) { end } else { next };
    }
    Ok((json.ok_or_else(|| GltfError::new("the JSON chunk is missing"))?, binary))
}

fn check_gltf_versions(root: &Root) -> Result<(), GltfError> {
    let required = root.asset.min_version.as_str();
    let number = |text: &str| text.parse::<u32>().ok();
    let parts = match required.split_once('.') {
        Some((major, minor)) => number(major).zip(number(minor)),
        None => number(required).map(|major| (major, 0)),
    };
    match parts {
        _ if required.is_empty() => {}
        Some(version) if version <= (2, 0) => {}
        Some(_) => {
            return Err(GltfError::new(newer_version_required_message(required)));
        }
        None => return Err(GltfError::new(invalid_min_version_message(required))),
    }
    match root.asset.version.as_str() {
        version if version.starts_with("2.") => Ok(()),
        "" => Err(GltfError::new("not a glTF file: asset.version is missing")),
        version => Err(GltfError::new(unsupported_version_message(version))),
    }
}

/// Unsupported extensions that change how meshes or images are stored, each with advice on exporting the
/// file without it.
pub(super) const UNSUPPORTED_EXTENSIONS: [(&str, &str); 5] = [
    (DRACO, "export it without Draco compression"),
    ("EXT_meshopt_compression", "export it without meshopt compression"),
    ("KHR_meshopt_compression", "export it without meshopt compression"),
    ("KHR_texture_basisu", "export it with PNG or JPEG textures instead of Basis textures"),
    ("EXT_mesh_gpu_instancing", "export it with a node for each instance"),
];

/// Extensions that are either supported or ignored with a note.
pub(super) const KNOWN_EXTENSIONS: [&str; 21] = [
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_transform",
    // Metadata that does not affect images.
    "KHR_xmp",
    "KHR_xmp_json_ld",
];

/// Rejects files that require unsupported extensions (3.12).
fn check_required_extensions(root: &Root) -> Result<(), GltfError> {
    for name in &root.extensions_required {
        if let Some((_, help)) = UNSUPPORTED_EXTENSIONS.iter().find(|(known, _)| known == name) {
            return Err(GltfError::new(unsupported_extension_message(name, help)));
        }
        if !KNOWN_EXTENSIONS.contains(&name.as_str()) {
            return Err(GltfError::new(unknown_extension_message(name)));
        }
    }
    Ok(())
}

/// Reads all buffers and returns them with the list of buffer files.
fn read_buffers(
    path: &Path,
    root: &mut Root,
    mut binary: Option<Vec<u8>>,
    monitor: Monitor<'_>,
) -> Result<(Vec<Vec<u8>>, Vec<Companion>), AssetError> {
    let (mut all, mut files, mut total) = (Vec::new(), Vec::new(), 0);
    for (number, buffer) in root.buffers.iter_mut().enumerate() {
        let wrong = |wrong: GltfError| {
            AssetError::malformed(path, None, wrong.add_location(format!("buffers[{number}]")).0)
        };
        let bytes = match buffer.uri.take() {
            Some(Uri::Data(bytes)) => bytes,
            Some(Uri::File(uri)) => {
                let file = resolve_relative_uri(path, &uri).map_err(wrong)?;
                let silent = Monitor { progress: &ignore_progress, token: monitor.token };
                let stamp = FileStamp::from_path(&file);
                let bytes =
                    read::read_bytes(&file, FILE_LIMIT - total, silent).map_err(|error| match error {
                        AssetError::Unreadable { path: missing, reason } => {
                            let name = path.file_name().unwrap_or_default().to_string_lossy();
                            AssetError::unreadable(
                                &missing,
                                unreadable_buffer_file_message(&reason, number, &name),
                            )
                        }
                        other => other,
                    })?;
                files.push(Companion { path: file, hash: Some(read::hash_bytes(&bytes)), stamp });
                bytes
            }
            None if number == 0 => binary
                .take()
                .ok_or_else(|| wrong(GltfError::new("it has neither a URI nor a binary chunk")))?,
            None => return Err(wrong(GltfError::new("it has no URI"))),
        };
        if (bytes.len() as u64) < buffer.byte_length {
            let (has, claimed) = (bytes.len(), buffer.byte_length);
            return Err(wrong(GltfError::new(short_buffer_message(claimed, has))));
        }
        total += bytes.len() as u64;
        if total > FILE_LIMIT {
            return Err(wrong(GltfError::new(format!("the buffers exceed {} MiB", FILE_LIMIT >> 20))));
        }
        all.push(bytes);
    }
    Ok((all, files))
}
