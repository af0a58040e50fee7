use std::fs;
use std::path::{Path, PathBuf};

use proptest::prelude::*;
use serde_json::json;

use super::super::write::{Durability, ExistingFilePolicy};
use super::super::{AttributeLossPolicy, BitDepth, FilmEncodingSettings};
use super::*;
use crate::control::CancelToken;
use crate::film::tone::ToneMapping;
use crate::film::{Film, FilmQuantity, TileSamples};
use crate::math::Vec3;

/// A film with 70 × 40 pixels and six tiles, with samples only in the tiles of one part.
fn film(index: u32, count: u32) -> Film {
    let film = Film::new(70, 40, None).expect("a film");
    for tile in (0..film.tile_count()).filter(|tile| *tile as u32 % count == index - 1) {
        let rect = film.tile_rect(tile).expect("a tile");
        let radiance = (0..rect.area() * 3).map(|i| Vec3::new(i as f32 / 3.0, tile as f32, 0.1)).collect();
        film.add_samples(
            tile,
            TileSamples {
                pixels: rect.into(),
                samples: 3,
                radiance,
                negative: None,
                layers: Default::default(),
            },
        );
    }
    film
}

fn encoding_settings() -> FilmEncodingSettings {
    FilmEncodingSettings {
        quantity: FilmQuantity::Radiance,
        tone: ToneMapping { exposure_stops: 0.3, ..ToneMapping::default() },
        bit_depth: BitDepth::Sixteen,
        metadata: vec![("glimt:scene".to_owned(), "a.toml".to_owned())],
        is_light: true,
    }
}

fn head(index: u32, count: u32, film: &Film) -> PartHeader {
    PartHeader {
        kind: PartFileKind::Part,
        identity: vec![
            NamedRenderInput::from_setting("seed", "7"),
            NamedRenderInput::from_file("knot.obj", "12ab"),
            NamedRenderInput::from_combined_hash("ff"),
        ],
        share: PartShare { index, count, block_count: 0, blocks: Vec::new() },
        picture: ImageHeader::from_film(film, &encoding_settings()),
        scene: String::new(),
        references: Vec::new(),
    }
}

const OPEN: ExistingFilePolicy<'static> = ExistingFilePolicy {
    is_kept: &|_| false,
    may_replace: &|_| Ok(()),
    sweep: None,
    losses: AttributeLossPolicy::Refuse,
};

fn put(folder: &Path, name: &str, head: &PartHeader, film: &Film) -> PathBuf {
    let path = folder.join(name);
    save(&path, head, film, &json!({ "a": 1 }), &OPEN, &CancelToken::new(), Durability::Process)
        .expect("saved");
    path
}

fn opened(path: &Path) -> Result<PartFile, PartError> {
    PartFile::open_and_validate(path, &CancelToken::new())
}

/// Writes all parts of an image to a folder.
fn parts(folder: &Path, count: u32) -> Vec<PathBuf> {
    let part = |index| {
        let film = film(index, count);
        put(folder, &format!("{index}.part"), &head(index, count, &film), &film)
    };
    (1..=count).map(part).collect()
}

fn merged(paths: &[PathBuf]) -> Result<MergedParts, PartError> {
    let parts = paths.iter().map(|path| opened(path)).collect::<Result<Vec<_>, _>>()?;
    merge_parts(&parts, false, &CancelToken::new(), |_, _| ())
}

#[test]
fn parts_merge_in_any_order() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = film(1, 1);
    for count in [1, 2, 4, 9] {
        let mut paths = parts(folder.path(), count);
        paths.reverse();
        let film = merged(&paths).expect("they fit").film;
        assert_eq!(film.radiance_image().pixels, whole.radiance_image().pixels, "{count} parts");
        assert_eq!(film.mean_luminance_standard_error(), whole.mean_luminance_standard_error());
        let part = opened(&paths[0]).expect("a part");
        assert_eq!(part.head.picture.film_encoding_settings(), Some(encoding_settings()));
        assert_eq!(part.state, json!({ "a": 1 }));
    }
}

#[test]
fn mismatched_parts_are_rejected() {
    let folder = tempfile::tempdir().expect("a folder");
    let paths = parts(folder.path(), 3);
    let error = |paths: &[PathBuf]| merged(paths).expect_err("rejected");
    let incomplete = error(&paths[..2]);
    assert!(
        matches!(&incomplete, PartError::Missing { missing, count: 3 } if missing == &[3]),
        "{incomplete}"
    );
    let doubled = error(&[&paths[..], &paths[1..2]].concat());
    assert!(matches!(doubled, PartError::Doubled { index: 2, count: 3, .. }), "{doubled}");
    // Change the seed, a mesh, the scene, the number of parts, the output settings and the type.
    let film = film(2, 3);
    let other = |change: &dyn Fn(&mut PartHeader)| {
        let mut head = head(2, 3, &film);
        change(&mut head);
        let path = put(folder.path(), "other.part", &head, &film);
        error(&[paths[0].clone(), path, paths[2].clone()])
    };
    type HeadEdit<'a> = &'a dyn Fn(&mut PartHeader);
    for (change, words) in [
        (
            &(|head: &mut PartHeader| head.identity[0].value = "8".into()) as HeadEdit<'_>,
            &["seed", "8", "7"][..],
        ),
        (&|head: &mut PartHeader| head.identity[1].value = "cd".into(), &["knot.obj"]),
        (&|head: &mut PartHeader| head.identity[2].value = "00".into(), &["materials"]),
        (&|head: &mut PartHeader| head.share.count = 4, &["4", "3"]),
        (&|head: &mut PartHeader| head.picture.bit_depth = 8, &["settings"]),
    ] {
        let PartError::Other { path, differences, .. } = other(change) else { panic!("{words:?}") };
        assert!(path.ends_with("other.part") && differences.len() == 1, "{differences:?}");
        assert!(words.iter().all(|word| differences[0].contains(word)), "{differences:?}");
    }
    let checkpoint = other(&|head: &mut PartHeader| head.kind = PartFileKind::Checkpoint);
    assert!(
        matches!(checkpoint, PartError::Kind { found: "checkpoint", wanted: "part", .. }),
        "{checkpoint}"
    );
    // A part with index 3 that contains the tiles from part 2.
    let stolen = put(folder.path(), "3.part", &head(3, 3, &film), &film);
    let stolen = error(&[paths[0].clone(), paths[1].clone(), stolen]);
    assert!(matches!(stolen, PartError::Damaged { .. }), "{stolen}");
}

#[test]
fn foreign_and_damaged_files_are_rejected() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = parts(folder.path(), 1).remove(0);
    assert!(is_part_or_checkpoint(&path));
    let bytes = fs::read(&path).expect("a part");
    let with = |change: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = bytes.clone();
        change(&mut bytes);
        let other = folder.path().join("other");
        fs::write(&other, bytes).expect("written");
        opened(&other).expect_err("rejected")
    };
    assert!(matches!(with(&|bytes| bytes[0] = 0), PartError::Foreign { .. }));
    for length in [0, 5, 12, 15, 20, bytes.len() / 2, bytes.len() - 1] {
        let error = with(&|bytes| bytes.truncate(length));
        assert!(
            matches!(error, PartError::Unfinished { bytes, .. } if bytes == length as u64),
            "{length}: {error}"
        );
    }
    assert!(matches!(with(&|bytes| *bytes = b"short".to_vec()), PartError::Foreign { .. }));
    assert!(matches!(with(&|bytes| bytes[12] = 9), PartError::Version { found: 9, known: VERSION, .. }));
    assert!(matches!(with(&|bytes| bytes.push(0)), PartError::Damaged { .. }));
    assert!(opened(folder.path()).is_err() && opened(&folder.path().join("none")).is_err());
}

#[test]
fn invalid_headers_are_rejected() {
    let folder = tempfile::tempdir().expect("a folder");
    let film = film(1, 2);
    let right = head(1, 2, &film);
    assert!(opened(&put(folder.path(), "right", &right, &film)).is_ok());
    let changes: [fn(&mut PartHeader); 9] = [
        |head| head.share.index = 0,
        |head| head.share.index = 3,
        |head| head.share.count = 0,
        |head| head.share.blocks = vec![0],
        |head| head.picture.width = 0,
        |head| head.picture.height = u32::MAX,
        |head| head.picture.crop = [0, 0, 0, 40],
        |head| head.picture.crop = [u32::MAX, 0, 70, 40],
        |head| head.picture.crop = [1, 0, 70, 40],
    ];
    for (number, change) in changes.into_iter().enumerate() {
        let mut head = right.clone();
        change(&mut head);
        let path = put(folder.path(), "wrong", &head, &film);
        let result = opened(&path);
        assert!(
            matches!(&result, Err(PartError::Damaged { why, .. }) if why == read::IMPOSSIBLE_HEADER),
            "{number}: {result:?}"
        );
    }
}

#[test]
fn too_many_open_files_are_detected() {
    let unreadable = |number| PartError::Unreadable {
        path: "a".into(),
        source: std::io::Error::from_raw_os_error(number),
    };
    use nix::errno::Errno;
    for number in [Errno::EMFILE, Errno::ENFILE] {
        assert!(unreadable(number as i32).is_too_many_open_files(), "{number}");
    }
    assert!(!unreadable(Errno::ENOENT as i32).is_too_many_open_files());
    assert!(!PartError::Foreign { path: "a".into() }.is_too_many_open_files());
}

#[test]
fn metadata_differences_are_listed() {
    let folder = tempfile::tempdir().expect("a folder");
    let part = |index, scene: &str| {
        let film = film(index, 2);
        let mut head = head(index, 2, &film);
        head.picture.metadata = vec![("glimt:scene".to_owned(), scene.to_owned())];
        opened(&put(folder.path(), scene, &head, &film)).expect("a part")
    };
    let parts = [part(1, "a.toml"), part(2, "b.toml")];
    let PartError::Other { differences, .. } = merge::check_and_list_missing(&parts).expect_err("two scenes")
    else {
        panic!("the scenes differ")
    };
    assert!(differences[0].contains("b.toml") && differences[0].contains("a.toml"), "{differences:?}");
}

#[test]
fn parts_from_different_builds_do_not_match() {
    let inputs = |build: &str| {
        vec![NamedRenderInput::from_setting("glimt", build), NamedRenderInput::from_setting("width", "4")]
    };
    let [a, b] = ["0.1.0 (build 1)", "0.1.0 (build 2)"].map(inputs);
    assert_eq!(render_input_differences(&a, &a, "here", "there"), [""; 0]);
    let found = render_input_differences(&a, &b, "here", "there");
    assert!(found.len() == 1 && found[0].contains("build 1") && found[0].contains("build 2"), "{found:?}");
}

#[test]
fn removed_records_are_detected() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = parts(folder.path(), 2).remove(0);
    let part = opened(&path).expect("a part");
    let bytes = fs::read(&path).expect("a part");
    let (_, offset, length) = part.tiles[1];
    let record = offset as usize - 8..offset as usize + length as usize + 16;
    let without = [&bytes[..record.start], &bytes[record.end..]].concat();
    fs::write(&path, without).expect("written");
    assert!(matches!(opened(&path), Err(PartError::Damaged { .. })));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn flipped_bits_and_truncations_are_detected(place in 0.0..1.0_f64, bit in 0_u8..8, cuts in any::<bool>()) {
        let folder = tempfile::tempdir().expect("a folder");
        let path = parts(folder.path(), 6).remove(0);
        let mut bytes = fs::read(&path).expect("a part");
        let index = (place * bytes.len() as f64) as usize;
        if cuts {
            bytes.truncate(index);
        } else {
            bytes[index] ^= 1 << bit;
        }
        fs::write(&path, bytes).expect("written");
        prop_assert!(opened(&path).is_err());
    }
}

#[test]
fn inputs_match_the_end_of_a_path() {
    let film = film(1, 1);
    let names = ["maps/a.png", "../b.png", "maps/../../c/d.png", "..", ""];
    let head = PartHeader { references: names.map(str::to_owned).into(), ..head(1, 1, &film) };
    for (path, expected) in [
        ("/scenes/knot.obj", Some("knot.obj")),
        ("/scenes/maps/a.png", Some("maps/a.png")),
        ("/scenes/a.png", None),
        ("/b.png", Some("../b.png")),
        ("/ab.png", None),
        ("/c/d.png", Some("maps/../../c/d.png")),
        ("/d.png", None),
        ("/scenes", None),
    ] {
        assert_eq!(head.find_input_that_is_path_suffix(Path::new(path)), expected, "{path}");
    }
}
