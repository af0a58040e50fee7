//! Lists the files that an OBJ file references, without parsing its faces or vertices.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::super::text::{LineReader, convert_mac_line_ends};
use super::super::{FILE_LIMIT, mtl};
use super::libraries::resolve_library_paths;
use super::words::ObjTextCursor;
use crate::control::{CancelToken, Canceled};

/// Lists an OBJ file's material libraries and their images. See [`super::super::referenced_files`].
pub(in crate::assets::mesh) fn referenced_files(
    path: &Path,
    token: &CancelToken,
) -> Result<Vec<PathBuf>, Canceled> {
    let mut files = BTreeSet::new();
    for library in referenced_libraries(path, token)? {
        if let Ok(mut lines) = LineReader::open(&library, mtl::FILE_LIMIT) {
            while let Some(line) = lines.read_next_line(token)? {
                files.extend(mtl::map_statement_image_candidates(&library, line));
            }
        }
        files.insert(library);
    }
    Ok(files.into_iter().collect())
}

fn referenced_libraries(path: &Path, token: &CancelToken) -> Result<BTreeSet<PathBuf>, Canceled> {
    let mut libraries = BTreeSet::new();
    let Ok(mut lines) = LineReader::open(path, FILE_LIMIT) else { return Ok(libraries) };
    loop {
        // Most lines contain only numbers.
        lines.skip_buffered_lines_without_letter(b'm');
        let Some(line) = lines.read_next_line(token)? else { return Ok(libraries) };
        if !is_library_statement(line) {
            continue;
        }
        let statement = lines.append_continuation_lines(token)?;
        let statement = convert_mac_line_ends(statement);
        let mut words = ObjTextCursor::new(&statement);
        words.next_word();
        libraries.extend(resolve_library_paths(path, &words.take_name()));
    }
}

fn is_library_statement(line: &[u8]) -> bool {
    ObjTextCursor::new(line).next_word().is_some_and(|word| word.eq_ignore_ascii_case(b"mtllib"))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::assets::mesh::load;
    use crate::control::ignore_progress;

    const FACE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    const LIBRARY: &str =
        "newmtl a\nKd 1 0 0\nmap_Kd -s 2 2 skin.png\n\trefl  sky #1.png\nnewmtl b\nbump \"b c.png\"\n";

    fn listed(path: &Path) -> BTreeSet<PathBuf> {
        let files = referenced_files(path, &CancelToken::new()).expect("not canceled");
        assert!(files.is_sorted_by(|a, b| a < b), "without duplicates");
        files.into_iter().collect()
    }

    #[test]
    fn listed_files_match_the_loaded_mesh() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        for name in ["a.mtl", "b.mtl", "a b.mtl", "h#1.mtl"] {
            fs::write(at(name), LIBRARY).expect("written");
        }
        fs::write(at("mac.mtl"), LIBRARY.replace('\n', "\r")).expect("written");
        fs::write(at("h\u{fc}t.mtl"), b"newmtl a\nmap_Kd h\xfct.png\n").expect("written");
        for text in [
            FACE.to_owned(),
            format!("mtllib a.mtl\n{FACE}"),
            format!("\u{feff}mtllib a.mtl\n{FACE}"),
            format!("# mtllib b.mtl\n{FACE} \tMTLLIB\ta b.mtl # libraries"),
            format!("{FACE}mtllib a.mtl \\\n b.mtl\nmtllib missing.mtl a.mtl\n"),
            format!("mtllib \\ \n a.mtl\n{FACE}"),
            format!("mtllib h#1.mtl\nmtllib h\u{fc}t.mtl\nmtllib mac.mtl\nmtllibs b.mtl\nmtllib\n{FACE}"),
        ] {
            for ending in ["\n", "\r\n", "\r"] {
                let path = at("mesh.obj");
                fs::write(&path, text.replace('\n', ending)).expect("written");
                let mesh = load(&path, &ignore_progress, &CancelToken::new()).expect("read");
                let companions = mesh.companions.into_iter().map(|companion| companion.path);
                let expected: BTreeSet<_> = companions.chain(mesh.pictures).collect();
                assert_eq!(listed(&path), expected, "{text:?} {ending:?}");
            }
        }
    }

    #[test]
    fn references_in_malformed_files_are_listed() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        fs::write(at("a.mtl"), "Kd one\nmap_Kd a.png\nnewmtl\nmap_Ks b.png\n").expect("written");
        fs::write(at("mesh.obj"), format!("{FACE}f 1 2 9\nv\nmtllib a.mtl\nf")).expect("written");
        assert!(load(&at("mesh.obj"), &ignore_progress, &CancelToken::new()).is_err());
        assert_eq!(listed(&at("mesh.obj")), ["a.mtl", "a.png", "b.png"].map(at).into());
        assert_eq!(listed(&at("none.obj")), BTreeSet::new());
        assert_eq!(listed(folder.path()), BTreeSet::new());
    }

    #[test]
    fn long_lines_are_not_kept_in_memory() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("mesh.obj");
        let text = format!("f {}\nmtllib a.mtl\n", "1 ".repeat(3 << 20));
        fs::write(&path, text).expect("written");
        let mut lines = LineReader::open(&path, FILE_LIMIT).expect("opened");
        while let Some(line) = lines.read_next_line(&CancelToken::new()).expect("not canceled") {
            assert!(line.len() <= 1 << 20);
        }
        assert_eq!(listed(&path), [folder.path().join("a.mtl")].into());
    }

    #[test]
    fn statements_between_many_numbers_are_found() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("mesh.obj");
        let mut text = String::new();
        for index in 0..20_000 {
            // Lines of varying length, so that buffers end at different places within lines.
            text += &format!("v {} 0 0\n", "1".repeat(index % 37 + 1));
            if index % 1000 == 0 {
                text += &format!(" mtllib {index}.mtl\n");
            }
        }
        fs::write(&path, text).expect("written");
        let expected = (0..20).map(|index| folder.path().join(format!("{}.mtl", 1000 * index))).collect();
        assert_eq!(listed(&path), expected);
    }

    #[test]
    fn canceled_listing_stops() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("mesh.obj");
        fs::write(&path, format!("mtllib a.mtl\n{FACE}")).expect("written");
        let token = CancelToken::new();
        token.cancel();
        assert!(referenced_files(&path, &token).is_err());
    }
}
