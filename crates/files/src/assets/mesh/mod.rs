//! Mesh files: OBJ with MTL, OFF, PLY, STL. Each parser gives the numbers as the file has them; `assemble` makes a mesh of
//! them that keeps the invariants of [`TriangleMesh`](crate::geometry::mesh::TriangleMesh).

pub(crate) mod assemble;
mod corners;
mod mtl;
pub(crate) mod normals;
mod obj;
mod off;
pub(crate) mod parsed;
mod places;
pub mod ply;
mod polygon;
mod stl;
mod text;

use std::path::Path;

use super::read::{self, Watch};
use super::{AssetError, LoadedMesh};
use crate::control::{CancelToken, Progress};

pub use normals::vertex_normals;

/// Most bytes of a mesh file.
const FILE_LIMIT: u64 = 4 << 30;

/// The endings that [`load`] knows.
pub const ENDINGS: [&str; 4] = ["obj", "off", "ply", "stl"];

/// Reads a mesh file; its ending, in any case, chooses the format.
///
/// Polygons are cut into triangles; unusable faces are left out and counted; unused vertices are left out. Normals are
/// unit vectors: if some are missing they are computed, if the file has none the mesh has none. v of texture
/// coordinates is the file's (0 at the bottom). Progress is in bytes; reading and parsing each count the file once.
///
/// # Errors
/// [`AssetError::Unreadable`] if the file is not a regular one of a known ending and sensible size;
/// [`AssetError::Malformed`] with the line (text) or the face (binary) if the file is wrong or has no usable face;
/// [`AssetError::Cancelled`].
pub fn load(path: &Path, progress: Progress<'_>, token: &CancelToken) -> Result<LoadedMesh, AssetError> {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
    let (parse, read): (Parser, Reader) = match ending.as_str() {
        "obj" => (obj::parse, read::text),
        "off" => (off::parse, read::lettered),
        "ply" => (ply::parse, read::lettered),
        "stl" => (stl::parse, read::not_blank),
        _ => return Err(AssetError::unreadable(path, "meshes end in .obj, .off, .ply or .stl")),
    };
    let watch = Watch { progress, token };
    let bytes = read(path, FILE_LIMIT, watch)?;
    let source = Source { path, bytes: text::without_mark(&bytes), watch };
    if source.bytes.is_empty() {
        return Err(source.wrong("the file is empty"));
    }
    let loaded = LoadedMesh { hash: read::hash(&bytes), ..parse(&source)? };
    watch.tick(2 * bytes.len(), 2 * bytes.len())?;
    Ok(loaded)
}

type Parser = fn(&Source<'_>) -> Result<LoadedMesh, AssetError>;
type Reader = fn(&Path, u64, Watch<'_>) -> Result<Vec<u8>, AssetError>;

/// A file in memory, with the watch on its parsing.
#[derive(Clone, Copy)]
pub(crate) struct Source<'a> {
    pub(crate) path: &'a Path,
    pub(crate) bytes: &'a [u8],
    pub(crate) watch: Watch<'a>,
}

impl Source<'_> {
    /// Reports that the parser is at this byte.
    fn tick(&self, at: usize) -> Result<(), AssetError> {
        Ok(self.watch.tick(self.bytes.len() + at, 2 * self.bytes.len())?)
    }

    /// An error about the whole file.
    fn wrong(&self, reason: impl Into<String>) -> AssetError {
        AssetError::malformed(self.path, None, reason)
    }

    /// An error at a byte of a text file.
    fn wrong_at(&self, at: usize, reason: impl Into<String>) -> AssetError {
        AssetError::malformed(self.path, Some(self.line(at)), reason)
    }

    /// The line of a byte, from 1.
    fn line(&self, at: usize) -> usize {
        let before = &self.bytes[..at.min(self.bytes.len())];
        1 + memchr::memchr_iter(b'\n', before).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::ignore_progress;
    use proptest::prelude::*;
    use std::fs;
    use std::sync::Mutex;

    fn try_bytes(name: &str, bytes: &[u8]) -> Result<LoadedMesh, AssetError> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join(name);
        fs::write(&path, bytes).expect("written");
        load(&path, &ignore_progress, &CancelToken::new())
    }

    #[test]
    fn the_ending_chooses_in_any_case() {
        let off = b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
        assert_eq!(try_bytes("A.OFF", off).expect("read").mesh.triangles, [[0, 1, 2]]);
        assert!(
            try_bytes("a.xyz", off).expect_err("refused").to_string().contains(".obj, .off, .ply or .stl")
        );
    }

    #[test]
    fn a_byte_order_mark_is_no_part_of_the_first_word() {
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
    fn progress_never_falls_and_ends_at_the_total() {
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
    fn a_cancelled_load_stops() {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, text) in [("a.off", "OFF 3 1 0"), ("a.ply", "ply\n"), ("a.obj", "v 0 0 0\n")] {
            let path = folder.path().join(name);
            fs::write(&path, text).expect("written");
            let token = CancelToken::new();
            token.cancel();
            assert!(matches!(load(&path, &ignore_progress, &token), Err(AssetError::Cancelled(_))), "{name}");
        }
    }

    /// Text made of the words of mesh files, so that parsers get past their first line.
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
        fn garbage_never_panics(bytes in proptest::collection::vec(any::<u8>(), 0..200), text in wordy()) {
            for ending in ENDINGS {
                let _ = try_bytes(&format!("a.{ending}"), &bytes);
                let _ = try_bytes(&format!("a.{ending}"), text.as_bytes());
            }
            for start in ["OFF\n3 1 0\n", "ply\nformat ascii 1.0\n", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "solid\nfacet normal 0 0 1\nouter loop\n"] {
                for ending in ENDINGS {
                    let _ = try_bytes(&format!("a.{ending}"), format!("{start}{text}").as_bytes());
                }
            }
        }

        #[test]
        fn what_loads_keeps_the_invariants(
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
