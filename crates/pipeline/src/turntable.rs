//! Turntables: frames from a camera orbiting `look_at`, written as numbered files or as an animation.

use std::collections::HashSet;
use std::ffi::OsString;
use std::ops::Range;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::{Path, PathBuf};

use crate::math::DVec3;
use crate::math::transform::sin_cos_degrees;
use crate::output::AnimationFormat;
use crate::scene::description::Pose;

/// Maximum number of frames.
pub const MAX_FRAMES: u32 = 10_000;

/// Placeholder for a digit in a file name.
const DIGIT: u8 = b'#';

/// One frame of a turntable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TurntableFrame {
    /// 0-based frame index.
    pub number: u32,
    /// Number of frames, at least 1.
    pub of: u32,
}

impl TurntableFrame {
    /// Whether this is the last frame.
    pub fn is_last(self) -> bool {
        self.number + 1 == self.of
    }

    /// Returns the camera for this frame: the first camera rotated counterclockwise, as seen from above,
    /// about the axis through `look_at` in direction `up`.
    pub(super) fn pose(self, first: &Pose) -> Pose {
        if self.number == 0 {
            return *first;
        }
        let angle = 360.0 * f64::from(self.number) / f64::from(self.of);
        let (axis, arm) = (first.up.normalize_or(DVec3::Y), first.position - first.look_at);
        // Apply Rodrigues' rotation formula.
        let (sin, cos) = sin_cos_degrees(angle);
        let turned = arm * cos + axis.cross(arm) * sin + axis * (axis.dot(arm) * (1.0 - cos));
        Pose { position: first.look_at + turned, ..*first }
    }

    /// Returns the vector from `look_at` to the camera for each frame.
    pub(super) fn camera_offsets_of_all_frames(
        of: u32,
        arm: DVec3,
        up: DVec3,
    ) -> impl Iterator<Item = DVec3> {
        let first = Pose { position: arm, look_at: DVec3::ZERO, up };
        (0..of.max(1)).map(move |number| Self { number, of: of.max(1) }.pose(&first).position)
    }
}

/// Checks that all frames can be written to an output.
///
/// # Errors
/// Returns a message with a suggestion.
pub fn check_turntable_output(path: &Path) -> Result<(), String> {
    if AnimationFormat::from_path(path).is_some() || split_placeholder(path).is_some() {
        return Ok(());
    }
    let name = path.display();
    let example = add_frame_placeholder(path);
    let example = example.display();
    Err(format!(
        "{name} can store only one frame of the turntable; use {example} for numbered files, or a .gif or .apng file"
    ))
}

/// Whether a file name contains a placeholder for the frame number.
pub fn has_frame_placeholder(path: &Path) -> bool {
    split_placeholder(path).is_some()
}

/// Adds a frame number placeholder to a still image's file name: `a.png` becomes `a_####.png`.
pub fn add_frame_placeholder(path: &Path) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push("_####");
    if let Some(ending) = path.extension() {
        name.push(".");
        name.push(ending);
    }
    path.with_file_name(name)
}

/// Returns the file name for a frame. Replaces the last run of `#` with the 1-based frame number. Returns
/// `None` if there is no `#`.
pub(super) fn frame_path(path: &Path, turn: TurntableFrame) -> Option<PathBuf> {
    let (before, digits, after) = split_placeholder(path)?;
    Some(path.with_file_name(insert_frame_number(before, turn.number + 1, digits, after)))
}

/// Inserts a number, zero-padded to `digits` digits. Does not use format strings, because they do not support
/// widths above 65,535.
fn insert_frame_number(before: &[u8], number: u32, digits: usize, after: &[u8]) -> OsString {
    let number = number.to_string();
    let zeros = vec![b'0'; digits.saturating_sub(number.len())];
    OsString::from_vec([before, &zeros, number.as_bytes(), after].concat())
}

/// Returns the first file that two frames would share, or `None` if each frame has its own file.
pub fn first_file_shared_by_frames(outputs: &[PathBuf], of: u32) -> Option<PathBuf> {
    let mut seen = HashSet::new();
    let all = |number| outputs.iter().filter_map(move |path| frame_path(path, TurntableFrame { number, of }));
    (0..of).flat_map(all).find(|path| !seen.insert(path.clone()))
}

/// Returns existing files numbered beyond the last frame, which were left behind by a longer turntable.
pub fn leftover_frames(last: &Path, turn: TurntableFrame) -> Vec<PathBuf> {
    let name = last.file_name().unwrap_or_default().as_bytes();
    // Find the frame number: the last run of digits with this value.
    let ends_run = |at: usize| at + 1 == name.len() || !name[at + 1].is_ascii_digit();
    let is_end = |at: &usize| name[*at].is_ascii_digit() && ends_run(*at);
    let run = |end: usize| name[..end].iter().rposition(|byte| !byte.is_ascii_digit()).map_or(0, |at| at + 1);
    let runs = (0..name.len()).rev().filter(is_end).map(|end| run(end)..end + 1);
    let number = |run: &Range<usize>| std::str::from_utf8(&name[run.clone()]).ok()?.parse::<u32>().ok();
    let Some(run) = runs.into_iter().find(|run| number(run) == Some(turn.number + 1)) else {
        return Vec::new();
    };
    let file = |next: u32| {
        last.with_file_name(insert_frame_number(&name[..run.start], next, run.len(), &name[run.end..]))
    };
    (turn.number + 2..=MAX_FRAMES).map(file).take_while(|path| path.symlink_metadata().is_ok()).collect()
}

/// Splits a file name into the bytes before its last run of `#`, the length of the run, and the bytes after
/// it.
fn split_placeholder(path: &Path) -> Option<(&[u8], usize, &[u8])> {
    let name = path.file_name()?.as_bytes();
    let end = name.iter().rposition(|byte| *byte == DIGIT)? + 1;
    let start = name[..end].iter().rposition(|byte| *byte != DIGIT).map_or(0, |at| at + 1);
    Some((&name[..start], end - start, &name[end..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leftover_frames_are_found() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        for name in ["w_3.png", "a2_003.png", "a2_004.png", "a2_006.png", "v1_2_2.png", "v1_3_2.png"] {
            std::fs::write(path(name), "").expect("written");
        }
        let last = TurntableFrame { number: 1, of: 2 };
        let found = |name: &str| leftover_frames(&path(name), last);
        assert_eq!(found("a2_002.png"), [path("a2_003.png"), path("a2_004.png")]);
        assert_eq!(found("w_2.png"), [path("w_3.png")]);
        let raw = |bytes: &[u8]| folder.path().join(OsString::from_vec(bytes.to_vec()));
        std::fs::write(raw(b"\xff_3.png"), "").expect("written");
        assert_eq!(leftover_frames(&raw(b"\xff_2.png"), last), [raw(b"\xff_3.png")]);
        assert_eq!((found("w_02.png"), found("w.png")), (Vec::new(), Vec::new()));
    }

    #[test]
    fn camera_orbits_at_constant_distance() {
        let first = Pose {
            position: DVec3::new(1.0, 3.0, 4.0),
            look_at: DVec3::new(1.0, 1.0, 0.0),
            up: DVec3::new(0.0, 2.0, 0.0),
        };
        let at = |number| TurntableFrame { number, of: 4 }.pose(&first);
        assert_eq!(at(0), first);
        for (number, expected) in [(1, [5.0, 3.0, 0.0]), (2, [1.0, 3.0, -4.0]), (3, [-3.0, 3.0, 0.0])] {
            let pose = at(number);
            assert!(pose.position.distance(DVec3::from(expected)) < 1e-12, "{number}: {pose:?}");
            assert_eq!((pose.look_at, pose.up), (first.look_at, first.up));
        }
    }

    #[test]
    fn files_are_numbered_by_frame() {
        let name = |path: &str, number| frame_path(Path::new(path), TurntableFrame { number, of: 100 });
        assert_eq!(name("out/a_####.png", 6), Some("out/a_0007.png".into()));
        assert_eq!(
            name("a#.exr", 99),
            Some("a100.exr".into()),
            "numbers may exceed the placeholder's length"
        );
        assert_eq!(name("#1_##_b.png", 0), Some("#1_01_b.png".into()));
        assert_eq!(name("##/a.png", 0), None, "folders are ignored");
        assert_eq!(name("##a##_###", 4), Some("##a##_005".into()));
        let endless =
            frame_path(Path::new(&"#".repeat(65_536)), TurntableFrame { number: 6, of: 9 }).expect("a name");
        let endless = endless.into_os_string().into_string().expect("digits");
        assert!(endless.len() == 65_536 && endless.ends_with("007"));
        let raw = |bytes: &[u8]| PathBuf::from(OsString::from_vec(bytes.to_vec()));
        let of_raw = frame_path(&raw(b"\xff_##\xfe.png"), TurntableFrame { number: 6, of: 9 });
        assert_eq!(of_raw, Some(raw(b"\xff_07\xfe.png")), "non-UTF-8 names should be supported");
        assert_eq!(check_turntable_output(&raw(b"\xff_##\xfe.png")), Ok(()));
        assert_eq!(add_frame_placeholder(Path::new("x/a.b.png")), Path::new("x/a.b_####.png"));
    }

    #[test]
    fn colliding_names_are_found() {
        let twin = |names: [&str; 2], of| first_file_shared_by_frames(&names.map(PathBuf::from), of);
        assert_eq!(twin(["a_#.png", "a_1#.png"], 10), None);
        assert_eq!(twin(["a_#.png", "a_1#.png"], 11), Some("a_11.png".into()));
        assert_eq!(twin(["a_#.png", "a_##.png"], 9), None);
        assert_eq!(twin(["a_#.png", "a_##.png"], 10), Some("a_10.png".into()));
        assert_eq!(twin(["a.gif", "a.apng"], 100), None, "animations have no numbers");
    }

    #[test]
    fn still_image_file_is_rejected_with_suggestion() {
        let message = check_turntable_output(Path::new("x/a.png")).expect_err("one file");
        assert!(message.contains("x/a_####.png"), "{message}");
        for right in ["a_####.png", "a.gif", "a.APNG", "a#.exr"] {
            assert_eq!(check_turntable_output(Path::new(right)), Ok(()), "{right}");
        }
    }
}
