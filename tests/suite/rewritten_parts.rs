//! Parts and checkpoints with valid digests whose header or render state was changed: by another build of
//! glimt, or by hand.

use std::path::Path;

use glimt::control::CancelToken;
use glimt::output::AttributeLossPolicy;
use glimt::output::part::{self, PartFile, PartHeader};
use glimt::output::write::{Durability, ExistingFilePolicy};
use glimt::pipeline::BUILD;
use serde_json::{Value, json};

use crate::parts::room_dir;
use crate::test_dir::{TestDir, assert_mentions};

/// Rewrites a part or checkpoint with a changed header or render state.
fn rewrite(path: &Path, change: impl FnOnce(&mut PartHeader, &mut Value)) {
    let token = CancelToken::new();
    let file = PartFile::open_and_validate(path, &token).expect("a part or checkpoint");
    let film = file.head.picture.create_film().expect("memory");
    file.restore_into_film(&film).expect("valid tiles");
    let (mut head, mut state) = (file.head, file.state);
    change(&mut head, &mut state);
    let guard = ExistingFilePolicy {
        is_kept: &|_| false,
        may_replace: &|_| Ok(()),
        sweep: None,
        losses: AttributeLossPolicy::Refuse,
    };
    part::save(path, &head, &film, &state, &guard, &token, Durability::Process).expect("written");
}

/// Changes the build that is recorded in a part or checkpoint.
#[track_caller]
fn replace_build(path: &Path, from: &str, to: &str) {
    rewrite(path, |head, _| {
        let builds = head.identity.iter_mut().filter(|input| input.value == from);
        let changed = builds.map(|build| to.clone_into(&mut build.value)).count();
        assert_eq!(changed, 1, "{}", path.display());
    });
}

/// Another build of the same version.
fn other_build() -> String {
    BUILD.replace("(build ", "(build 0")
}

/// Runs glimt and checks the exit code. Returns stderr with line breaks removed.
#[track_caller]
fn stderr_of(dir: &TestDir, line: &str, code: i32) -> String {
    dir.expect(line, code).split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn merge_refuses_parts_of_another_build() {
    let dir = room_dir();
    for index in [1, 2] {
        dir.expect(&format!("room.toml --once --progress none -o {index}.part --shard {index}/2"), 0);
    }
    let (second, other) = (dir.path("2.part"), other_build());
    dir.write("out.png", "the image before");
    replace_build(&second, BUILD, &other);
    for options in ["", "--watch", "--partial"] {
        let stderr = stderr_of(&dir, &format!("merge out.png 1.part 2.part --progress none {options}"), 2);
        assert_mentions(&stderr, &["2.part", BUILD, &other]);
        assert_eq!(dir.bytes("out.png"), b"the image before", "{options}");
    }
    // Only the build made the difference.
    replace_build(&second, &other, BUILD);
    dir.expect("merge out.png 1.part 2.part --progress none", 0);
    // All parts are from the same build, even if this program is another build.
    for name in ["1.part", "2.part"] {
        replace_build(&dir.path(name), BUILD, &other);
    }
    dir.expect("merge other.png 1.part 2.part --progress none", 0);
    assert_eq!(dir.bytes("other.png"), dir.bytes("out.png"));
}

const RENDER: &str = "room.toml --once --progress none -o out.exr";

#[test]
fn resume_refuses_checkpoints_of_another_build() {
    let dir = room_dir();
    dir.expect(&format!("{RENDER} --keep-checkpoint"), 0);
    let (image, path, other) = (dir.bytes("out.exr"), dir.path("out.exr.checkpoint"), other_build());
    replace_build(&path, BUILD, &other);
    let checkpoint = dir.bytes("out.exr.checkpoint");
    let refusal = stderr_of(&dir, &format!("{RENDER} --resume --samples 5"), 2);
    assert_mentions(&refusal, &["out.exr.checkpoint", BUILD, &other]);
    assert!(dir.bytes("out.exr") == image && dir.bytes("out.exr.checkpoint") == checkpoint);
    replace_build(&path, &other, BUILD);
    dir.expect(&format!("{RENDER} --resume --samples 5"), 0);
}

#[test]
fn implausible_render_times_do_not_hang() {
    let dir = room_dir();
    dir.expect(&format!("{RENDER} --keep-checkpoint"), 0);
    let (image, checkpoint) = (dir.bytes("out.exr"), dir.bytes("out.exr.checkpoint"));
    for key in ["seconds", "processor_seconds"] {
        for seconds in [-1e300, 1e300] {
            dir.write("out.exr.checkpoint", &checkpoint);
            rewrite(&dir.path("out.exr.checkpoint"), |_, state| {
                assert!(state[key].is_f64(), "{key}: {state}");
                state[key] = json!(seconds);
            });
            let refusal = stderr_of(&dir, &format!("{RENDER} --resume --samples 5 --time 1000"), 2);
            assert_mentions(&refusal, &["out.exr.checkpoint", "state"]);
            assert!(dir.bytes("out.exr") == image, "{key}: {seconds}");
            // A new render replaces the checkpoint.
            dir.expect(&format!("{RENDER} --keep-checkpoint"), 0);
        }
    }
}
