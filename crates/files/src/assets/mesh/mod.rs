//! Mesh files: OBJ with MTL, OFF, PLY and STL. Each parser collects vertices and faces, from which `assemble`
//! builds a valid [`TriangleMesh`](crate::geometry::mesh::TriangleMesh).

pub(crate) mod assemble;
mod coincident;
mod corners;
mod mtl;
pub(crate) mod normals;
mod obj;
mod off;
pub(crate) mod parsed;
pub mod ply;
mod polygon;
#[cfg(test)]
mod polygon_tests;
pub mod serialized;
mod stl;
pub mod subdivide;
mod text;

use std::path::{Path, PathBuf};

use super::read::{self, Monitor};
use super::{AssetError, LoadedMesh};
use crate::control::{CancelToken, Canceled, Progress};

pub use normals::vertex_normals;

/// Maximum size of a mesh file.
const FILE_LIMIT: u64 = 4 << 30;

/// File name extensions that [`load`] supports.
pub const EXTENSIONS: [&str; 4] = ["obj", "off", "ply", "stl"];

/// Reads a mesh file. The format is determined by the extension, ignoring case.
///
/// Polygons are triangulated. Unusable faces are skipped and counted. Unused vertices are removed. Normals
/// have unit length. Missing normals are computed, except that a file without any normals produces a mesh
/// without normals. The texture coordinate v is 0 at the bottom, as in the file. Progress is measured in
/// bytes. Every byte is counted twice: when it is read and when it is parsed.
///
/// # Errors
/// - [`AssetError::Unreadable`] if the file is not a regular file of at most 4 GiB with a known extension.
/// - [`AssetError::Malformed`] with the line (text) or the face (binary) if the file is invalid or has no
///   usable face.
/// - [`AssetError::Canceled`].
pub fn load(path: &Path, progress: Progress<'_>, token: &CancelToken) -> Result<LoadedMesh, AssetError> {
    let (parse, read) = parse_and_read_functions(path)?;
    let monitor = Monitor { progress, token };
    parse_bytes(path, &read(path, FILE_LIMIT, monitor)?, parse, monitor)
}

/// Like [`load`], for the bytes of a file that need not exist.
///
/// # Errors
/// Same as [`load`].
pub fn load_from_bytes(
    path: &Path,
    bytes: &[u8],
    progress: Progress<'_>,
    token: &CancelToken,
) -> Result<LoadedMesh, AssetError> {
    parse_bytes(path, bytes, parse_and_read_functions(path)?.0, Monitor { progress, token })
}

/// Returns the functions for the format that the extension determines.
fn parse_and_read_functions(path: &Path) -> Result<(ParseFn, ReadFileFn), AssetError> {
    let extension =
        path.extension().map(|extension| extension.to_string_lossy().to_lowercase()).unwrap_or_default();
    match extension.as_str() {
        "obj" => Ok((obj::parse, read::read_text_bytes)),
        "off" => Ok((off::parse, read::read_unless_zeros_in_magic)),
        "ply" => Ok((ply::parse, read::read_unless_zeros_in_magic)),
        "stl" => Ok((stl::parse, read::read_unless_zeros_at_start)),
        _ => Err(AssetError::unreadable(path, UNKNOWN_FORMAT)),
    }
}

fn parse_bytes(
    path: &Path,
    bytes: &[u8],
    parse: ParseFn,
    monitor: Monitor<'_>,
) -> Result<LoadedMesh, AssetError> {
    let source = MeshFileBytes { path, bytes: text::strip_byte_order_mark(bytes), monitor };
    if source.bytes.is_empty() {
        return Err(source.malformed_error_without_line(EMPTY_FILE));
    }
    let loaded = LoadedMesh { hash: read::hash_bytes(bytes), ..parse(&source)? };
    monitor.report_and_check_cancel(2 * bytes.len(), 2 * bytes.len())?;
    Ok(loaded)
}

/// Lists the material libraries that an OBJ file references, and the images that these libraries reference,
/// including unused ones. Reads only the statements with file names, so errors elsewhere in the files do not
/// matter. Memory use is bounded. Returns an empty list for other formats and unreadable files.
///
/// # Errors
/// Returns [`Canceled`] if the token is canceled.
pub fn referenced_files(path: &Path, token: &CancelToken) -> Result<Vec<PathBuf>, Canceled> {
    let is_obj = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("obj"));
    if is_obj { obj::referenced_files(path, token) } else { Ok(Vec::new()) }
}

const UNKNOWN_FORMAT: &str = "unknown mesh format; the extension must be .obj, .off, .ply or .stl";

/// Error message for an empty file.
const EMPTY_FILE: &str = "the file is empty";

/// Error message for an out-of-range vertex index in a file with `count` vertices. Indices start at 0.
pub(crate) fn vertex_out_of_range_message(vertex: i64, count: u64) -> String {
    format!("vertex {vertex} is out of range: there are {count}, numbered from 0")
}

type ParseFn = fn(&MeshFileBytes<'_>) -> Result<LoadedMesh, AssetError>;
type ReadFileFn = fn(&Path, u64, Monitor<'_>) -> Result<Vec<u8>, AssetError>;

/// A mesh file in memory, with the monitor for its parser.
#[derive(Clone, Copy)]
pub(crate) struct MeshFileBytes<'a> {
    pub(crate) path: &'a Path,
    pub(crate) bytes: &'a [u8],
    pub(crate) monitor: Monitor<'a>,
}

impl MeshFileBytes<'_> {
    /// Reports that the parser has reached byte `at`.
    fn report_progress(&self, at: usize) -> Result<(), AssetError> {
        Ok(self.monitor.report_and_check_cancel(self.bytes.len() + at, 2 * self.bytes.len())?)
    }

    /// Creates an error without a line number.
    fn malformed_error_without_line(&self, reason: impl Into<String>) -> AssetError {
        AssetError::malformed(self.path, None, reason)
    }

    /// Creates an error with the line number of byte `at` in a text file.
    fn malformed_error_with_line(&self, at: usize, reason: impl Into<String>) -> AssetError {
        AssetError::malformed(self.path, Some(self.line_number(at)), reason)
    }

    /// Returns the number of the line that contains byte `at`. The first line is 1.
    fn line_number(&self, at: usize) -> usize {
        let before = &self.bytes[..at.min(self.bytes.len())];
        1 + memchr::memchr_iter(b'\n', before).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assets::expect_rejection;
    use crate::control::ignore_progress;
    use proptest::prelude::*;
    use std::fs;
    use std::sync::Mutex;

    fn try_bytes(name: &str, bytes: &[u8]) -> Result<LoadedMesh, AssetError> {
        try_bytes_in(tempfile::tempdir().expect("a folder").path(), name, bytes)
    }

    fn try_bytes_in(folder: &Path, name: &str, bytes: &[u8]) -> Result<LoadedMesh, AssetError> {
        let path = folder.join(name);
        fs::write(&path, bytes).expect("written");
        load(&path, &ignore_progress, &CancelToken::new())
    }

    #[test]
    fn extensions_ignore_case() {
        let off = b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
        assert_eq!(try_bytes("A.OFF", off).expect("read").mesh.triangles, [[0, 1, 2]]);
        assert_eq!(expect_rejection(try_bytes("a.xyz", off)), (None, UNKNOWN_FORMAT.to_owned()));
    }

    #[test]
    fn a_byte_order_mark_is_skipped() {
        let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
            element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
        for (name, text) in [
            ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
            ("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
            ("a.ply", ply),
        ] {
            let [plain, marked] = [text.to_owned(), format!("\u{feff}{text}")]
                .map(|text| try_bytes(name, text.as_bytes()).expect("read"));
            assert_eq!(marked.mesh.positions, plain.mesh.positions, "{name}");
            assert!(marked.warnings.is_empty(), "{name}");
        }
    }

    #[test]
    fn progress_increases_to_the_total() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("many.off");
        let mut text = "OFF\n3 100000 0\n0 0 0\n1 0 0\n0 1 0\n".to_owned();
        text.push_str(&"3 0 1 2\n".repeat(100_000));
        fs::write(&path, &text).expect("written");
        let seen = Mutex::new(Vec::new());
        let note = |done, total| seen.lock().expect("no panic").push((done, total));
        load(&path, &note, &CancelToken::new()).expect("read");
        let seen = seen.into_inner().expect("no panic");
        assert!(seen.len() > 10 && seen.is_sorted());
        assert_eq!(seen.last(), Some(&(2 * text.len() as u64, 2 * text.len() as u64)));
    }

    #[test]
    fn a_canceled_load_returns_canceled() {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, text) in [("a.off", "OFF 3 1 0"), ("a.ply", "ply\n"), ("a.obj", "v 0 0 0\n")] {
            let path = folder.path().join(name);
            fs::write(&path, text).expect("written");
            let token = CancelToken::new();
            token.cancel();
            assert!(matches!(load(&path, &ignore_progress, &token), Err(AssetError::Canceled(_))), "{name}");
        }
    }

    /// Random text made of mesh file keywords, so that parsers get past the first line.
    fn wordy() -> impl Strategy<Value = String> {
        let words = "OFF COFF STOFF 4OFF ply format ascii binary_little_endian 1.0 element vertex face property \
                     list uchar int float x y z vertex_indices end_header v vt vn f l g o usemtl mtllib \
                     newmtl solid facet normal outer loop vertex endloop endfacet endsolid 0 1 2 3 4 -1 1/1 1//1 2/3/4 7 1e999 nan -inf 4000000000 99999999999999999999 . # \\";
        let words: Vec<&str> = words.split_whitespace().collect();
        let word = (proptest::sample::select(words), proptest::sample::select(vec![" ", "\n", "\r\n", "\t"]));
        proptest::collection::vec(word, 0..60)
            .prop_map(|words| words.into_iter().flat_map(|(word, gap)| [word, gap]).collect())
    }

    proptest! {
        #[test]
        fn fuzzed_meshes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200), text in wordy()) {
            let folder = tempfile::tempdir().expect("a folder");
            let load = |ending: &str, bytes: &[u8]| {
                let _ = try_bytes_in(folder.path(), &format!("a.{ending}"), bytes);
            };
            for ending in EXTENSIONS {
                load(ending, &bytes);
                load(ending, text.as_bytes());
            }
            for start in ["OFF\n3 1 0\n", "ply\nformat ascii 1.0\n", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "solid\nfacet normal 0 0 1\nouter loop\n"] {
                for ending in EXTENSIONS {
                    load(ending, format!("{start}{text}").as_bytes());
                }
            }
        }

        #[test]
        fn loaded_meshes_are_valid(
            coordinates in proptest::collection::vec(
                proptest::sample::select(vec!["0", "1", "2", "-1", "nan", "1e999", "0.5"]), 24),
            corners in proptest::collection::vec(0_u32..8, 3..40),
        ) {
            let mut text = format!("OFF\n8 {} 0\n", corners.len().div_ceil(5));
            for vertex in coordinates.chunks(3) {
                text.push_str(&format!("{}\n", vertex.join(" ")));
            }
            for face in corners.chunks(5) {
                let words: Vec<_> = face.iter().map(u32::to_string).collect();
                text.push_str(&format!("{} {}\n", face.len(), words.join(" ")));
            }
            if let Ok(loaded) = try_bytes("a.off", text.as_bytes()) {
                let mesh = loaded.mesh;
                prop_assert!(!mesh.triangles.is_empty());
                prop_assert!(mesh.positions.iter().all(|p| p.is_finite()));
                let mut used = vec![false; mesh.positions.len()];
                for triangle in 0..mesh.triangles.len() as u32 {
                    let [a, b, c] = mesh.corners(triangle);
                    prop_assert!(a != b && b != c && c != a);
                    mesh.triangles[triangle as usize].iter().for_each(|&v| used[v as usize] = true);
                }
                prop_assert!(used.into_iter().all(|used| used));
            }
        }
    }
}
