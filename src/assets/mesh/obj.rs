//! OBJ by `tobj`, which makes one index of the three that a corner has; what it accepts and must not, or cannot
//! say, is checked here.

use std::borrow::Cow;
use std::cell::{Cell, RefCell};
use std::collections::{BTreeSet, HashMap};
use std::io::{self, BufRead, Read};
use std::path::Path;

use super::assemble::{Parsed, assemble};
use super::text::{Cursor, shown};
use super::{AssetError, LoadedMesh, Source, mtl};
use crate::assets::FileMaterial;
use crate::assets::contain::contain;
use crate::math::{Vec2, Vec3};

/// Bytes that `tobj` gets at a time, between two polls of the token.
const CHUNK: usize = 1 << 18;

/// Faces stay as they are: polygons are cut by our own hands, and points and lines among them counted.
const OPTIONS: tobj::LoadOptions =
    tobj::LoadOptions { single_index: true, triangulate: false, ignore_points: false, ignore_lines: false };

pub(super) fn parse(source: &Source<'_>) -> Result<LoadedMesh, AssetError> {
    let survey = Survey::of(source.bytes);
    let libraries = Libraries { source, found: RefCell::default(), failed: RefCell::default() };
    let mut reader = Chunks { source, text: &survey.text, at: 0, stopped: Cell::new(false) };
    let result = contain(|| tobj::load_obj_buf(&mut reader, &OPTIONS, |name| libraries.load(name)));
    source.watch.token.check()?;
    if let Some(error) = libraries.failed.into_inner() {
        return Err(error);
    }
    let Ok(Ok((models, materials))) = result else {
        let reason = match result {
            Ok(Err(error)) => error.to_string(),
            Err(panic) => panic,
            Ok(Ok(_)) => String::new(),
        };
        return Err(first_fault(source).unwrap_or_else(|| source.wrong(reason)));
    };
    let Found { materials: known, mut warnings, missing } = libraries.found.into_inner();
    let materials: Vec<FileMaterial> = materials.map_or(Vec::new(), |found| {
        found.iter().filter_map(|material| known.get(&material.name).cloned()).collect()
    });
    if !missing {
        let unknown = survey.used_materials.iter().filter(|name| !known.contains_key(*name));
        warnings.extend(unknown.map(|name| format!("no material is named {name:?}")));
    }
    let mut parsed = Parsed { materials, warnings, ..Parsed::default() };
    join(&models, &mut parsed);
    assemble(source, parsed)
}

/// The text as `tobj` may read it, and what it does not tell.
struct Survey<'a> {
    text: Cow<'a, [u8]>,
    used_materials: BTreeSet<String>,
}

impl<'a> Survey<'a> {
    /// Lines that `tobj` mistakes for faces (`l`, `p`) are blanked, lines that go on behind a backslash joined,
    /// bytes beyond UTF-8 replaced.
    fn of(bytes: &'a [u8]) -> Self {
        let mut text = Cow::Borrowed(bytes);
        let mut used_materials = BTreeSet::new();
        let mut start = 0;
        for end in memchr::memchr_iter(b'\n', bytes).chain([bytes.len()]) {
            let line = bytes[start..end].trim_ascii();
            match line {
                [b'l' | b'p', b' ' | b'\t', ..] => text.to_mut()[start..end].fill(b' '),
                [b'u', b's', b'e', b'm', b't', b'l', b' ', name @ ..] => {
                    used_materials.insert(String::from_utf8_lossy(name).trim().to_owned());
                }
                [.., b'\\'] => {
                    let slash = bytes[start..end].trim_ascii_end().len() + start - 1;
                    text.to_mut()[slash..(end + 1).min(bytes.len())].fill(b' ');
                }
                _ => {}
            }
            start = (end + 1).min(bytes.len());
        }
        if !text.is_ascii() && std::str::from_utf8(&text).is_err() {
            text = Cow::Owned(String::from_utf8_lossy(&text).into_owned().into_bytes());
        }
        Self { text, used_materials }
    }
}

/// A reader that reports and can be stopped.
struct Chunks<'a> {
    source: &'a Source<'a>,
    text: &'a [u8],
    at: usize,
    stopped: Cell<bool>,
}

impl Read for Chunks<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let got = self.fill_buf()?.read(buffer)?;
        self.consume(got);
        Ok(got)
    }
}

impl BufRead for Chunks<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        let end = (self.at / CHUNK + 1) * CHUNK;
        if self.at.is_multiple_of(CHUNK) {
            let at = self.at.min(self.source.bytes.len());
            self.stopped.set(self.stopped.get() || self.source.tick(at).is_err());
        }
        if self.stopped.get() {
            return Err(io::Error::other("cancelled"));
        }
        Ok(&self.text[self.at..end.min(self.text.len())])
    }

    fn consume(&mut self, amount: usize) {
        self.at += amount;
    }
}

/// The material files that an OBJ names, as they are met.
struct Libraries<'a> {
    source: &'a Source<'a>,
    found: RefCell<Found>,
    failed: RefCell<Option<AssetError>>,
}

#[derive(Default)]
struct Found {
    materials: HashMap<String, FileMaterial>,
    warnings: Vec<String>,
    missing: bool,
}

impl Libraries<'_> {
    /// One file, or several in one statement. A missing one is a warning; a malformed one is the mesh's error.
    fn load(&self, statement: &Path) -> tobj::MTLLoadResult {
        let folder = self.source.path.parent().unwrap_or(Path::new(""));
        let whole = folder.join(statement);
        let text = statement.to_string_lossy().replace('\\', "/");
        let names: Vec<_> = if whole.exists() {
            vec![whole]
        } else if folder.join(&text).exists() {
            vec![folder.join(&text)]
        } else {
            text.split_whitespace().map(|name| folder.join(name)).collect()
        };
        let mut materials = Vec::new();
        for path in names {
            materials.extend(self.load_file(&path)?);
        }
        let places = materials.iter().enumerate().map(|(index, found)| (found.name.clone(), index)).collect();
        Ok((materials, places))
    }

    fn load_file(&self, path: &Path) -> Result<Vec<tobj::Material>, tobj::LoadError> {
        match mtl::load(path, self.source.watch) {
            Ok(materials) => {
                let folder = path.parent().unwrap_or(Path::new(""));
                let known = materials.iter().map(|found| (found.name.clone(), mtl::material(found, folder)));
                self.found.borrow_mut().materials.extend(known);
                Ok(materials)
            }
            Err(error @ AssetError::Unreadable { .. }) => {
                let mut found = self.found.borrow_mut();
                found.missing = true;
                found.warnings.push(format!("{error}; its materials are left out"));
                Ok(Vec::new())
            }
            Err(error) => {
                *self.failed.borrow_mut() = Some(error);
                Err(tobj::LoadError::ReadError)
            }
        }
    }
}

/// The models (one for each object, group and material) as one mesh.
fn join(models: &[tobj::Model], parsed: &mut Parsed) {
    let vertices = |model: &tobj::Model| model.mesh.positions.len() / 3;
    let any_uvs = models.iter().any(|model| !model.mesh.texcoords.is_empty());
    let any_normals = models.iter().any(|model| !model.mesh.normals.is_empty());
    let any_materials = models.iter().any(|model| model.mesh.material_id.is_some());
    for model in models {
        let mesh = &model.mesh;
        let base = parsed.positions.len() as u32;
        let end = parsed.positions.len() + vertices(model);
        parsed.positions.extend(mesh.positions.chunks_exact(3).map(Vec3::from_slice));
        if any_uvs && whole(mesh.texcoords.len(), 2 * vertices(model), model, "texture coordinates", parsed) {
            parsed.uvs.extend(mesh.texcoords.chunks_exact(2).map(Vec2::from_slice));
        }
        if any_normals && whole(mesh.normals.len(), 3 * vertices(model), model, "normals", parsed) {
            parsed.normals.extend(mesh.normals.chunks_exact(3).map(Vec3::from_slice));
        }
        parsed.uvs.resize(if any_uvs { end } else { 0 }, Vec2::ZERO);
        parsed.normals.resize(if any_normals { end } else { 0 }, Vec3::ZERO);
        add_faces(mesh, base, parsed);
        if any_materials {
            let material = mesh.material_id.map_or(u32::MAX, |id| id as u32);
            parsed.face_materials.resize(parsed.faces.len(), material);
        }
    }
}

/// Whether every corner of a model has the attribute; `tobj` leaves gaps out, so that a part cannot be told apart.
fn whole(found: usize, wanted: usize, model: &tobj::Model, what: &str, parsed: &mut Parsed) -> bool {
    if found != wanted && found > 0 {
        let name = &model.name;
        parsed
            .warnings
            .push(format!("some corners of {name:?} have {what} and some have none: ignored there"));
    }
    found == wanted
}

fn add_faces(mesh: &tobj::Mesh, base: u32, parsed: &mut Parsed) {
    let mut corners = mesh.indices.iter();
    let triangles = mesh.indices.len() / 3;
    let arities: &mut dyn Iterator<Item = usize> = if mesh.face_arities.is_empty() {
        parsed.faces.reserve(triangles);
        &mut std::iter::repeat_n(3, triangles)
    } else {
        &mut mesh.face_arities.iter().map(|arity| *arity as usize)
    };
    for arity in arities {
        corners.by_ref().take(arity).for_each(|corner| parsed.faces.corner(base + corner));
        parsed.faces.close(arity);
    }
}

/// `tobj` knows that something is wrong, but not where: look for the first line that it refuses.
fn first_fault(source: &Source<'_>) -> Option<AssetError> {
    let mut counts = [0_i64; 3];
    let mut cursor = Cursor::new(source.bytes, 0);
    while cursor.skip_blank() {
        let at = cursor.at();
        let reason = match cursor.word() {
            b"v" => counted(&mut cursor, &mut counts[0], 3, "coordinates"),
            b"vt" => counted(&mut cursor, &mut counts[1], 2, "texture coordinates"),
            b"vn" => counted(&mut cursor, &mut counts[2], 3, "normal coordinates"),
            b"f" => face_fault(&mut cursor, counts),
            _ => None,
        };
        if let Some(reason) = reason {
            return Some(source.wrong_at(at, reason));
        }
        cursor.end_line();
    }
    None
}

fn counted(cursor: &mut Cursor<'_>, count: &mut i64, wanted: usize, what: &str) -> Option<String> {
    *count += 1;
    let mut found = 0;
    while cursor.skip_in_line() {
        let start = *cursor;
        if cursor.float().is_none() {
            let mut start = start;
            return Some(format!("expected {wanted} {what}, found {}", shown(start.word())));
        }
        found += 1;
    }
    match found {
        4 if wanted == 3 => None,
        5 if what == "coordinates" => {
            Some("coordinates are followed by one weight or three colours".to_owned())
        }
        _ if found < wanted => Some(format!("expected {wanted} {what}, found {found}")),
        _ => None,
    }
}

fn face_fault(cursor: &mut Cursor<'_>, counts: [i64; 3]) -> Option<String> {
    while cursor.skip_in_line() {
        let word = cursor.word();
        if word == b"\\" {
            cursor.end_line();
            continue;
        }
        let parts: Vec<&[u8]> = word.split(|&byte| byte == b'/').collect();
        if parts.len() > 3 {
            return Some(format!("expected a corner like 1/2/3, found {}", shown(word)));
        }
        for (part, (count, what)) in
            parts.iter().zip(counts.iter().zip(["vertex", "texture coordinate", "normal"]))
        {
            if part.is_empty() && what != "vertex" {
                continue;
            }
            match Cursor::new(part, 0).integer() {
                None => return Some(format!("expected a corner like 1/2/3, found {}", shown(word))),
                Some(index) if index == 0 || index > *count || index < -count => {
                    return Some(format!("{what} {index} is out of range: there are {count}, from 1"));
                }
                Some(_) => {}
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assets::Dropped;
    use crate::assets::mesh::load;
    use crate::control::{CancelToken, unwatched};
    use std::fs;

    fn read_with(files: &[(&str, &[u8])]) -> Result<LoadedMesh, AssetError> {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, bytes) in files {
            fs::write(folder.path().join(name), bytes).expect("written");
        }
        load(&folder.path().join(files[0].0), &unwatched, &CancelToken::new())
    }

    fn read(text: &str) -> Result<LoadedMesh, AssetError> {
        read_with(&[("a.obj", text.as_bytes())])
    }

    fn says(text: &str) -> String {
        let text = read(text).expect_err("refused").to_string();
        text.rsplit_once("/a.obj").map_or(text.clone(), |(_, rest)| rest.to_owned())
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn corners_with_other_uvs_are_other_vertices() {
        let text = format!("{SQUARE}vt 0 0\nvt 1 0.25\nvn 0 0 2\nf 1/1/1 2/2/1 3/1/1\nf 1/2/1 3/1/1 4/1/1\n");
        let mesh = read(&text).expect("whole").mesh;
        assert_eq!((mesh.positions.len(), mesh.uvs.len(), mesh.normals.len()), (5, 5, 5));
        assert_eq!(mesh.uvs[1], Vec2::new(1.0, 0.25));
        assert_eq!(mesh.normals, [Vec3::Z; 5]);
        assert_eq!(mesh.triangles, [[0, 1, 2], [3, 2, 4]]);
    }

    #[test]
    fn quads_relative_indices_and_long_lines_are_read() {
        for faces in [
            "f 1 2 3 4",
            "f -4 -3 -2 -1",
            "f 1 2 \\\n 3 4",
            "f 1 2 3 4\nl 1 2 3\np 1\nl 2 4",
            "  f 1 2 3 4\r",
        ] {
            let mesh = read(&format!("# \u{e9}\n{SQUARE}{faces}\n")).expect(faces).mesh;
            assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]], "{faces}");
            assert!(mesh.normals.is_empty() && mesh.uvs.is_empty() && mesh.materials.is_empty());
        }
        let bytes = [b"# \xff\xfe\n".as_slice(), SQUARE.as_bytes(), b"f 1 2 3\n"].concat();
        assert_eq!(read_with(&[("a.obj", &bytes)]).expect("read").mesh.triangles.len(), 1);
    }

    #[test]
    fn triangles_know_their_materials() {
        let text = format!("mtllib my one.mtl\n{SQUARE}f 1 2 3\nusemtl b\nf 1 3 4\nusemtl none\nf 2 3 4\n");
        let mtl = b"newmtl a\nKd 1 0 0\nnewmtl b\nKe 5 5 5\n";
        let loaded = read_with(&[("a.obj", text.as_bytes()), ("my one.mtl", mtl)]).expect("whole");
        assert_eq!(loaded.mesh.materials, [u32::MAX, 1, u32::MAX]);
        assert_eq!(loaded.materials[1].emission, Vec3::splat(5.0));
        assert_eq!(loaded.warnings, ["no material is named \"none\""]);
    }

    #[test]
    fn a_missing_library_is_a_warning_and_a_wrong_one_an_error() {
        let text = format!("mtllib none.mtl\nusemtl red\n{SQUARE}f 1 2 3\n");
        let loaded = read(&text).expect("a mesh all the same");
        assert_eq!((loaded.warnings.len(), loaded.materials.len(), loaded.mesh.materials.len()), (1, 0, 0));
        assert!(loaded.warnings[0].contains("none.mtl"), "{:?}", loaded.warnings);
        let result = read_with(&[("a.obj", text.as_bytes()), ("none.mtl", b"newmtl red\nKd 1\n")]);
        assert!(result.expect_err("refused").to_string().contains("none.mtl:2: `Kd`"));
    }

    #[test]
    fn groups_without_normals_get_them_when_others_have_some() {
        let text = format!("{SQUARE}vn 0 0 -1\no one\nf 1//1 2//1 3//1\no two\nf 1 3 4\n");
        let mesh = read(&text).expect("whole").mesh;
        assert_eq!(mesh.normals, [Vec3::NEG_Z, Vec3::NEG_Z, Vec3::NEG_Z, Vec3::Z, Vec3::Z, Vec3::Z]);
        let mixed = format!("{SQUARE}vt 0 1\no one\nf 1/1 2 3\n");
        let loaded = read(&mixed).expect("whole");
        assert!(loaded.warnings[0].contains("\"one\"") && loaded.mesh.uvs.iter().all(|uv| *uv == Vec2::ZERO));
    }

    #[test]
    fn what_tobj_accepts_is_dropped_and_counted() {
        let text =
            format!("{SQUARE}v nan 0 0\nv 1e999 0 0\nf 1 2 3\nf 1 2 5\nf 1 2 6\nf 1 2\nf 1\nf 1 1 2\n");
        let loaded = read(&text).expect("one face is good");
        assert_eq!(loaded.dropped, Dropped { non_finite: 2, degenerate: 3 });
        assert_eq!(loaded.mesh.positions.len(), 3);
    }

    #[test]
    fn errors_name_the_line() {
        assert_eq!(says("v 0 0 0\nv 1 0 0\nf 1 2 3\n"), ":3: vertex 3 is out of range: there are 2, from 1");
        assert_eq!(
            says(&format!("{SQUARE}f 1 2 -9\n")),
            ":5: vertex -9 is out of range: there are 4, from 1"
        );
        assert_eq!(
            says(&format!("{SQUARE}vt 0 0\n\n# x\nf 1/1 2/2 3/1\n")),
            ":8: texture coordinate 2 is out of range: there are 1, from 1"
        );
        assert_eq!(says("v 0 0\n"), ":1: expected 3 coordinates, found 2");
        assert_eq!(says("v 0 zero 0\n"), ":1: expected 3 coordinates, found \"zero\"");
        assert_eq!(says(&format!("{SQUARE}f 1 2 x\n")), ":5: expected a corner like 1/2/3, found \"x\"");
        assert_eq!(says(&format!("{SQUARE}f 0 1 2\n")), ":5: vertex 0 is out of range: there are 4, from 1");
        assert!(says(SQUARE).contains("no usable face"));
        assert!(says("").contains("no usable face"));
    }

    #[test]
    fn a_face_of_very_many_corners_ends() {
        let corners: Vec<String> = (0..300_000).map(|index| (index % 4 + 1).to_string()).collect();
        let loaded = read(&format!("{SQUARE}f {}\n", corners.join(" "))).expect("a fan");
        assert!(!loaded.mesh.triangles.is_empty());
    }
}
