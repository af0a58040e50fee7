use std::fs;
use std::path::{Path, PathBuf};

use proptest::prelude::*;
use serde_json::json;

use super::super::write::{Durability, Guard};
use super::super::{BitDepth, Finish, Losses};
use super::*;
use crate::control::CancelToken;
use crate::film::tone::ToneMapping;
use crate::film::{Film, Quantity, TileSamples};
use crate::math::Vec3;

/// A film of 70 × 40 pixels, six tiles, with samples in those that belong to a part.
fn film(index: u32, count: u32) -> Film {
    let film = Film::new(70, 40, None).expect("a film");
    for tile in (0..film.tile_count()).filter(|tile| *tile as u32 % count == index - 1) {
        let rect = film.tile_rect(tile).expect("a tile");
        let radiance = (0..rect.area() * 3).map(|i| Vec3::new(i as f32 / 3.0, tile as f32, 0.1)).collect();
        film.add(tile, &TileSamples { pixels: rect.into(), samples: 3, radiance, negative: None });
    }
    film
}

fn finish() -> Finish {
    Finish {
        quantity: Quantity::Radiance,
        tone: ToneMapping { exposure_stops: 0.3, ..ToneMapping::default() },
        bit_depth: BitDepth::Sixteen,
        metadata: vec![("glimt:scene".to_owned(), "a.toml".to_owned())],
        is_light: true,
    }
}

fn head(index: u32, count: u32, film: &Film) -> Head {
    Head {
        kind: Kind::Part,
        identity: vec![Trait::setting("seed", "7"), Trait::file("knot.obj", "12ab"), Trait::everything("ff")],
        share: ShareHead { index, count, block_count: 0, blocks: Vec::new() },
        picture: PictureHead::new(film, &finish()),
        scene: String::new(),
    }
}

const OPEN: Guard<'static> =
    Guard { is_kept: &|_| false, may_replace: &|_| Ok(()), sweep: None, losses: Losses::Refused };

fn put(folder: &Path, name: &str, head: &Head, film: &Film) -> PathBuf {
    let path = folder.join(name);
    save(&path, head, film, &json!({ "a": 1 }), &OPEN, (&CancelToken::new(), Durability::Process))
        .expect("saved");
    path
}

fn opened(path: &Path) -> Result<PartFile, PartError> {
    PartFile::open(path, &CancelToken::new())
}

/// The parts of a picture in a folder.
fn parts(folder: &Path, count: u32) -> Vec<PathBuf> {
    let part = |index| {
        let film = film(index, count);
        put(folder, &format!("{index}.part"), &head(index, count, &film), &film)
    };
    (1..=count).map(part).collect()
}

fn merged(paths: &[PathBuf]) -> Result<Merged, PartError> {
    let parts = paths.iter().map(|path| opened(path)).collect::<Result<Vec<_>, _>>()?;
    merge(&parts, false, &CancelToken::new(), |_, _| ())
}

#[test]
fn parts_in_any_order_are_the_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = film(1, 1);
    for count in [1, 2, 4, 9] {
        let mut paths = parts(folder.path(), count);
        paths.reverse();
        let film = merged(&paths).expect("they fit").film;
        assert_eq!(film.radiance().pixels, whole.radiance().pixels, "{count} parts");
        assert_eq!(film.mean_luminance_error(), whole.mean_luminance_error());
        let part = opened(&paths[0]).expect("a part");
        assert_eq!(part.head.picture.finish(), Some(finish()));
        assert_eq!(part.state, json!({ "a": 1 }));
    }
}

#[test]
fn what_does_not_belong_together_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let paths = parts(folder.path(), 3);
    let said = |paths: &[PathBuf]| merged(paths).expect_err("refused").to_string();
    let lacking = said(&paths[..2]);
    assert!(lacking.starts_with("1 of 3 parts are missing: 3/3;"), "{lacking}");
    let doubled = said(&[&paths[..], &paths[1..2]].concat());
    assert!(doubled.contains("both are part 2/3"), "{doubled}");
    // Another seed, another mesh, another scene, another number of parts.
    let film = film(2, 3);
    let other = |change: &dyn Fn(&mut Head)| {
        let mut head = head(2, 3, &film);
        change(&mut head);
        let path = put(folder.path(), "other.part", &head, &film);
        said(&[paths[0].clone(), path, paths[2].clone()])
    };
    for (change, words) in [
        (
            &(|head: &mut Head| head.identity[0].value = "8".into()) as &dyn Fn(&mut Head),
            "seed is 8 here and 7 there",
        ),
        (&|head: &mut Head| head.identity[1].value = "cd".into(), "knot.obj has another content"),
        (&|head: &mut Head| head.identity[2].value = "00".into(), "shapes, materials, lights or camera"),
        (&|head: &mut Head| head.share.count = 4, "one of 4 parts here and of 3 there"),
        (&|head: &mut Head| head.picture.bit_depth = 8, "finished in another way"),
        (&|head: &mut Head| head.kind = Kind::Checkpoint, "it is a checkpoint, not a part"),
    ] {
        let said = other(change);
        assert!(said.contains("other.part: ") && said.contains(words), "{said}");
    }
    // A part that says to be another one has tiles of its neighbour.
    let stolen = put(folder.path(), "3.part", &head(3, 3, &film), &film);
    assert!(said(&[paths[0].clone(), paths[1].clone(), stolen]).contains("as does"));
}

#[test]
fn other_files_are_told_from_parts() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = parts(folder.path(), 1).remove(0);
    assert!(is_part(&path));
    let bytes = fs::read(&path).expect("a part");
    let with = |change: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = bytes.clone();
        change(&mut bytes);
        let other = folder.path().join("other");
        fs::write(&other, bytes).expect("written");
        opened(&other).expect_err("refused")
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
fn heads_with_impossible_numbers_are_damaged() {
    let folder = tempfile::tempdir().expect("a folder");
    let film = film(1, 2);
    let right = head(1, 2, &film);
    assert!(opened(&put(folder.path(), "right", &right, &film)).is_ok());
    let changes: [fn(&mut Head); 9] = [
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
        assert!(
            matches!(opened(&path), Err(PartError::Damaged { why, .. }) if why.contains("impossible")),
            "{number}"
        );
    }
}

#[test]
fn too_many_open_files_are_told_from_other_errors() {
    let of = |number| PartError::Unreadable {
        path: "a".into(),
        source: std::io::Error::from_raw_os_error(number),
    };
    use nix::errno::Errno;
    for number in [Errno::EMFILE, Errno::ENFILE] {
        assert!(of(number as i32).is_out_of_files(), "{number}");
    }
    assert!(!of(Errno::ENOENT as i32).is_out_of_files());
    assert!(!PartError::Foreign { path: "a".into() }.is_out_of_files());
}

#[test]
fn what_two_images_say_of_themselves_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let part = |index, scene: &str| {
        let film = film(index, 2);
        let mut head = head(index, 2, &film);
        head.picture.metadata = vec![("glimt:scene".to_owned(), scene.to_owned())];
        opened(&put(folder.path(), scene, &head, &film)).expect("a part")
    };
    let parts = [part(1, "a.toml"), part(2, "b.toml")];
    let said = merge::check(&parts).expect_err("two scenes").to_string();
    assert!(said.contains("its scene is b.toml here and a.toml there"), "{said}");
}

#[test]
fn parts_of_two_builds_do_not_fit() {
    let of = |build: &str| vec![Trait::setting("glimt", build), Trait::setting("width", "4")];
    let [one, other] = ["0.1.0 (build 1)", "0.1.0 (build 2)"].map(of);
    assert_eq!(differences(&one, &one, ("here", "there")), [""; 0]);
    assert_eq!(
        differences(&one, &other, ("here", "there")),
        ["glimt 0.1.0 (build 1) rendered it here and glimt 0.1.0 (build 2) there; use the same build"]
    );
}

/// Whole records may not be left out or changed for those of another file either.
#[test]
fn records_are_bound_to_their_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = parts(folder.path(), 2).remove(0);
    let part = opened(&path).expect("a part");
    let bytes = fs::read(&path).expect("a part");
    let (_, place, length) = part.tiles[1];
    let record = place as usize - 8..place as usize + length as usize + 16;
    let without = [&bytes[..record.start], &bytes[record.end..]].concat();
    fs::write(&path, without).expect("written");
    assert!(matches!(opened(&path), Err(PartError::Damaged { why, .. }) if why.contains("missing")));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn a_flipped_bit_or_a_cut_is_found(place in 0.0..1.0_f64, bit in 0_u8..8, cuts in any::<bool>()) {
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
