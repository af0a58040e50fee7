//! Identifies this build.

/// The glimt version and a hash of the sources that affect images. Two builds with the same string render
/// bit-identical images.
pub const BUILD: &str = concat!(env!("CARGO_PKG_VERSION"), " (build ", env!("GLIMT_BUILD"), ")");

#[cfg(test)]
#[path = "../build/sources.rs"]
mod sources;

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn build_id_contains_version_and_hash() {
        let hash =
            BUILD.strip_prefix(env!("CARGO_PKG_VERSION")).and_then(|rest| rest.strip_prefix(" (build "));
        let hash = hash.and_then(|rest| rest.strip_suffix(')')).expect("a hash");
        assert!(hash.len() == 12 && hash.bytes().all(|byte| byte.is_ascii_hexdigit()), "{hash}");
    }

    #[test]
    fn identity_covers_sources_but_not_tests() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = folder.path().join("src");
        let write = |name: &str, text: &str| {
            let path = root.join(name);
            fs::create_dir_all(path.parent().expect("a folder")).expect("made");
            fs::write(path, text).expect("written");
        };
        let identity = || sources::source_hash(&[root.clone(), folder.path().join("none")]);
        write("a.rs", "let a = 1;\nlet b = 2;\n");
        write("deep/b.rs", "");
        let before = identity();
        for test in ["deep/tests.rs", "deep/tests/c.rs"] {
            write(test, "a test");
            assert_eq!(identity(), before, "{test}");
        }
        write("a.rs", "let a = 1;\r\nlet b = 2;\r\n");
        assert_eq!(identity(), before, "line endings");
        write("a.rs", "let a = 1;\nlet b = 3;\n");
        assert_ne!(identity(), before, "content");
        write("a.rs", "let a = 1;\nlet b = 2;\n");
        assert_eq!(identity(), before);
        fs::rename(root.join("deep/b.rs"), root.join("deep/c.rs")).expect("renamed");
        assert_ne!(identity(), before, "names");
    }
}
