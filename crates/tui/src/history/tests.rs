//! Tests of the history.

use super::*;
use crate::fixtures::uniform_picture;
use crate::pipeline::protocol::PreviewedImageState;
use crate::pipeline::settings::{CameraOverrides, ViewMode};
use crate::pipeline::{FileContentId, FilePathAndContentId};
use crate::scene::fingerprint::FingerprintHasher;
use crate::state::KeyboardOverrides;

fn shown_image(generation: u64, side: u32) -> PreviewUpdate {
    PreviewUpdate {
        generation,
        picture: uniform_picture(side, side, [1, 2, 3]),
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    }
}

#[test]
fn oldest_entries_are_dropped_at_the_limit() {
    let mut history = RenderHistory::default();
    for generation in 0..10 {
        let picture = uniform_picture(1000, 1000, [generation as u8, 0, 0]);
        history.record_shown_image(
            PreviewUpdate { picture, ..shown_image(generation, 1) },
            Instant::now(),
            ImageProvenance::default(),
        );
    }
    assert_eq!(history.past.len(), 5, "each image takes 3 MB");
    history.record_shown_image(shown_image(10, 10_000), Instant::now(), ImageProvenance::default());
    assert_eq!(history.past.len(), 1, "the last image is always kept");
}

#[test]
fn shared_scene_texts_are_counted_once() {
    let mut history = RenderHistory::default();
    let shared: Arc<str> = "x".repeat(3 << 20).into();
    let mut record = |generation: u64, text: Arc<str>| {
        let picture = uniform_picture(1, 1, [generation as u8, 0, 0]);
        let origin = ImageProvenance { text: Some(text), ..ImageProvenance::default() };
        history.record_shown_image(
            PreviewUpdate { picture, ..shown_image(generation, 1) },
            Instant::now(),
            origin,
        );
        history.past.len()
    };
    assert_eq!((0..8).map(|generation| record(generation, Arc::clone(&shared))).max(), Some(8));
    // Five edits of 3 MiB plus the shared text exceed the limit.
    assert_eq!((8..13).map(|generation| record(generation, "y".repeat(3 << 20).into())).max(), Some(12));
    assert_eq!(record(13, "z".into()), 6);
}

#[test]
fn equal_images_share_an_entry() {
    let mut history = RenderHistory::default();
    for generation in 0..3 {
        history.record_scene_edit();
        history.record_shown_image(shown_image(generation, 10), Instant::now(), ImageProvenance::default());
    }
    assert_eq!((history.past.len(), history.past[0].shown.generation), (1, 2));
}

/// A render that resumes from an image shows that image at first.
#[test]
fn unfinished_image_is_a_separate_entry() {
    let unfinished = ImageProvenance { is_unfinished: true, ..ImageProvenance::default() };
    let mut history = RenderHistory::default();
    history.record_shown_image(shown_image(1, 10), Instant::now(), ImageProvenance::default());
    history.record_shown_image(shown_image(2, 10), Instant::now(), unfinished.clone());
    let generations = |history: &RenderHistory| -> Vec<u64> {
        history.past.iter().map(|past| past.shown.generation).collect()
    };
    assert_eq!(generations(&history), [1, 2]);
    let better = PreviewUpdate { picture: uniform_picture(10, 10, [1, 2, 4]), ..shown_image(2, 10) };
    history.record_shown_image(better, Instant::now(), unfinished);
    assert_eq!(generations(&history), [1, 2]);
    // The finished image may be identical.
    history.record_shown_image(shown_image(2, 10), Instant::now(), ImageProvenance::default());
    assert_eq!(generations(&history), [2]);
}

#[test]
fn edits_without_visible_effect_are_skipped() {
    let mut history = RenderHistory::default();
    history.record_shown_image(shown_image(1, 10), Instant::now(), ImageProvenance::default());
    edit(&mut history);
    history.record_shown_image(shown_image(2, 20), Instant::now(), ImageProvenance::default());
    // Break the scene, then fix it.
    edit(&mut history);
    history.discard_edits_of_invalid_scene();
    edit(&mut history);
    history.record_shown_image(shown_image(4, 20), Instant::now(), ImageProvenance::default());
    let before = history.open_render_before_edit(shown_image(4, 20)).expect("a picture");
    assert_eq!(before.generation, 1);
    // Images rendered after a key press include the last edit.
    history.return_to_newest();
    history.record_shown_image(shown_image(5, 30), Instant::now(), ImageProvenance::default());
    let before = history.open_render_before_edit(shown_image(5, 30)).expect("a picture");
    assert_eq!(before.generation, 1);
}

#[test]
fn before_edit_ignores_broken_edits() {
    let mut history = RenderHistory::default();
    history.record_shown_image(shown_image(1, 10), Instant::now(), ImageProvenance::default());
    edit(&mut history);
    history.record_shown_image(shown_image(2, 20), Instant::now(), ImageProvenance::default());
    history.record_scene_edit();
    history.discard_edits_of_invalid_scene();
    history.record_shown_image(shown_image(3, 30), Instant::now(), ImageProvenance::default());
    assert_eq!(history.open_render_before_edit(shown_image(3, 30)).expect("a picture").generation, 1);
}

/// A preview of a finished or unfinished image, and the image's origin.
fn of_image(generation: u64, name: &str, is_finished: bool) -> (PreviewUpdate, ImageProvenance) {
    let source = Some(PreviewedImageState { image: FingerprintHasher::new(name).finish(), is_finished });
    // Make every preview different.
    let picture = uniform_picture(10, 10, [generation as u8, u8::from(is_finished), 0]);
    let origin = ImageProvenance { is_unfinished: !is_finished, ..ImageProvenance::default() };
    (PreviewUpdate { source, picture, ..shown_image(generation, 10) }, origin)
}

#[test]
fn interrupted_renders_share_one_entry() {
    let mut history = RenderHistory::default();
    let record = |history: &mut RenderHistory, generation, name, is_finished| {
        let (shown, origin) = of_image(generation, name, is_finished);
        history.record_shown_image(shown, Instant::now(), origin);
        history.len()
    };
    assert_eq!(record(&mut history, 1, "first", true), 1);
    // Editing a comment does not change the image.
    edit(&mut history);
    assert_eq!(record(&mut history, 2, "first", true), 1);
    // Render again, interrupt the render with a typo, then finish it from the existing samples.
    assert_eq!(record(&mut history, 3, "first", false), 2);
    assert_eq!(record(&mut history, 4, "first", false), 2);
    assert_eq!(record(&mut history, 5, "first", true), 1);
    assert_eq!(changes(&history), [messages::OPENED]);
    // An edit discards the samples. The unfinished image is listed once.
    edit(&mut history);
    assert_eq!(record(&mut history, 6, "second", false), 2);
    assert_eq!(record(&mut history, 7, "second", false), 2);
    edit(&mut history);
    assert_eq!(record(&mut history, 8, "third", true), 3);
    let stopped = format!("{}; {}", messages::STOPPED, messages::AGAIN);
    assert_eq!(changes(&history), [messages::OPENED, &stopped, messages::AGAIN]);
}

#[test]
fn entries_have_their_render_numbers() {
    let mut history = RenderHistory::default();
    for (generation, run) in [(1, Some(1)), (2, None), (3, Some(2))] {
        let (shown, origin) = of_image(generation, &generation.to_string(), run.is_some());
        history.record_shown_image(shown, Instant::now(), origin);
        assert!(history.newest_is_from_request(generation) && history.is_newest_unfinished());
        run.into_iter().for_each(|run| history.finish_newest(run));
    }
    assert_eq!([0, 1, 2].map(|at| history.render_number_at(at)), [Some(1), None, Some(2)]);
    // A later request produces the same image.
    let (shown, origin) = of_image(4, "3", true);
    history.record_shown_image(shown, Instant::now(), origin);
    assert!(!history.is_newest_unfinished());
    history.finish_newest(5);
    assert_eq!((history.len(), history.render_number_at(2)), (3, Some(5)));
}

fn edit(history: &mut RenderHistory) {
    history.record_scene_edit();
    history.record_scene_read();
}

#[test]
fn saving_the_camera_counts_as_an_edit() {
    let mut history = RenderHistory::default();
    history.record_shown_image(shown_image(1, 10), Instant::now(), ImageProvenance::default());
    history.record_shown_image(shown_image(2, 20), Instant::now(), ImageProvenance::default());
    history.record_shown_image(shown_image(3, 30), Instant::now(), ImageProvenance::default());
    history.record_camera_save_as_edit(2);
    let before = history.open_render_before_edit(shown_image(3, 30)).expect("a picture");
    assert_eq!(before.generation, 1, "expected the image before the camera moved");
}

#[test]
fn each_request_has_one_entry() {
    let mut history = RenderHistory::default();
    history.record_shown_image(shown_image(1, 10), Instant::now(), ImageProvenance::default());
    history.record_shown_image(shown_image(1, 20), Instant::now(), ImageProvenance::default());
    assert_eq!((history.past.len(), history.past[0].shown.picture.width), (1, 20));
}

/// Creates an image's origin from its scene text and view.
fn origin(text: &str, view: Option<ViewMode>) -> ImageProvenance {
    let toggles = KeyboardOverrides { view, ..KeyboardOverrides::default() };
    ImageProvenance { toggles, text: Some(text.into()), ..ImageProvenance::default() }
}

fn changes(history: &RenderHistory) -> Vec<String> {
    (0..history.len()).map(|at| history.describe_changes_since_previous(at, false).join("; ")).collect()
}

#[test]
fn entries_list_changes_since_the_previous_one() {
    let mut history = RenderHistory::default();
    let (wide, narrow) = ("camera.fov = 40", "camera.fov = 30");
    let seed = "camera.fov = 30\nseed = 1";
    history.record_shown_image(shown_image(1, 10), Instant::now(), origin(wide, None));
    // Save twice. Only the second version can be read.
    history.record_scene_edit();
    history.record_scene_edit();
    history.record_shown_image(shown_image(2, 20), Instant::now(), origin(narrow, None));
    history.record_shown_image(shown_image(3, 30), Instant::now(), origin(narrow, Some(ViewMode::Normal)));
    history.record_scene_edit();
    history.record_shown_image(shown_image(4, 40), Instant::now(), origin(seed, None));
    history.record_shown_image(shown_image(5, 50), Instant::now(), origin(seed, None));
    assert_eq!(
        changes(&history),
        [messages::OPENED, "camera.fov 40 → 30", "view normal", "+ seed = 1; view reset", messages::AGAIN]
    );
    assert_eq!((history.len(), history.shown_index()), (5, Some(4)));
}

#[test]
fn saved_camera_is_listed_once() {
    let mut history = RenderHistory::default();
    let camera = CameraOverrides { fov: Some(30.0), ..CameraOverrides::default() };
    let moved = KeyboardOverrides { camera, ..KeyboardOverrides::default() };
    history.record_shown_image(shown_image(1, 10), Instant::now(), origin("camera.fov = 40", None));
    let before = ImageProvenance { toggles: moved, ..origin("camera.fov = 40", None) };
    history.record_shown_image(shown_image(2, 20), Instant::now(), before.clone());
    history.record_shown_image(shown_image(3, 30), Instant::now(), origin("camera.fov = 30", None));
    history.record_shown_image(shown_image(4, 40), Instant::now(), before);
    history.record_shown_image(shown_image(5, 50), Instant::now(), origin("camera.fov = 40", None));
    let words = [
        messages::OPENED,
        "camera moved",
        "camera.fov 40 → 30",
        "camera.fov 30 → 40; camera moved",
        "camera reset",
    ];
    assert_eq!(changes(&history), words);
}

#[test]
fn ineffective_saves_are_not_listed() {
    let mut history = RenderHistory::default();
    let record = |history: &mut RenderHistory, generation, name, is_finished, text: &str, photons| {
        let (shown, origin) = of_image(generation, name, is_finished);
        let toggles = KeyboardOverrides { photons, ..KeyboardOverrides::default() };
        history.record_shown_image(
            shown,
            Instant::now(),
            ImageProvenance { toggles, text: Some(text.into()), ..origin },
        );
    };
    let (first, second) = ("render.samples = 64", "render.samples = 16");
    record(&mut history, 1, "on", true, first, None);
    record(&mut history, 2, "off", true, first, Some(false));
    record(&mut history, 3, "on", true, first, Some(true));
    let words = [messages::OPENED, "photons off", "photons on"];
    assert_eq!(changes(&history), words);
    // The command line overrides the number of samples, so the image stays the same.
    edit(&mut history);
    record(&mut history, 4, "on", true, second, Some(true));
    assert_eq!(changes(&history), words);
    record(&mut history, 5, "on", false, "render.samples = 8", Some(true));
    record(&mut history, 5, "on", true, "render.samples = 8", Some(true));
    assert_eq!(changes(&history), words);
    // The next image lists both changes.
    edit(&mut history);
    record(&mut history, 6, "radius", true, "render.samples = 8\nradius = 1", Some(true));
    assert_eq!(changes(&history)[3], "render.samples 64 → 8; + radius = 1");
    // If `c` wrote the camera to the scene, the change is listed as an edit, not as a camera movement.
    let camera = CameraOverrides { fov: Some(30.0), ..CameraOverrides::default() };
    let text = "render.samples = 8\nradius = 1\ncamera.fov = 30";
    let (shown, origin) = of_image(7, "fov", true);
    let moved = KeyboardOverrides { camera, photons: Some(true), ..KeyboardOverrides::default() };
    let before = "render.samples = 8\nradius = 1";
    history.record_shown_image(
        shown,
        Instant::now(),
        ImageProvenance { toggles: moved, text: Some(before.into()), ..origin },
    );
    assert_eq!(changes(&history)[4], "camera moved");
    record(&mut history, 8, "fov", true, text, Some(true));
    assert_eq!(changes(&history)[4], "+ camera");
}

#[test]
fn entry_keeps_its_original_changes() {
    let mut history = RenderHistory::default();
    let mut generation = 0;
    let mut record = |history: &mut RenderHistory, name: &str, toggles: KeyboardOverrides, text: &str| {
        generation += 1;
        // Record the image while it is in progress, when it is finished, and once more.
        for _ in 0..3 {
            let (shown, origin) = of_image(generation, name, true);
            history.record_shown_image(
                shown,
                Instant::now(),
                ImageProvenance { toggles, text: Some(text.into()), ..origin },
            );
        }
        edit(history);
        changes(history)
    };
    let keys = KeyboardOverrides::default();
    record(&mut history, "narrow", keys, "camera.fov = 40");
    record(&mut history, "wide", keys, "camera.fov = 44");
    let words = [messages::OPENED, "camera.fov 40 → 44"];
    let output = "camera.fov = 44\nrender.output = \"other.png\"";
    assert_eq!(record(&mut history, "wide", keys, output), words);
    let named = format!("{output}\nname = \"globe\"");
    assert_eq!(record(&mut history, "wide", keys, &named), words);
    // A camera moved with keys is listed as such unless it has been saved to the scene.
    let mut history = RenderHistory::default();
    let camera = CameraOverrides { fov: Some(30.0), ..CameraOverrides::default() };
    let moved = KeyboardOverrides { camera, ..KeyboardOverrides::default() };
    record(&mut history, "own", keys, "camera.fov = 44");
    for (toggles, text, words) in [
        (moved, "camera.fov = 44", "camera moved"),
        (moved, "camera.fov = 50", "camera moved"),
        (keys, "camera.fov = 30", "camera.fov 44 → 30"),
    ] {
        assert_eq!(record(&mut history, "moved", toggles, text), [messages::OPENED, words]);
    }
}

#[test]
fn changed_files_are_listed_by_name() {
    let file = |name: &str, hash: u8| FilePathAndContentId {
        path: name.into(),
        content: FileContentId::Hash([hash; 32]),
    };
    let files = |bricks, knot| -> Arc<[FilePathAndContentId]> {
        [file("textures/bricks.png", bricks), file("knot.obj", knot)].into()
    };
    let mut history = RenderHistory::default();
    for (number, (bricks, knot)) in (1..).zip([(1, 1), (2, 1), (2, 1), (3, 2)]) {
        let origin = ImageProvenance { files: files(bricks, knot), ..origin("camera.fov = 40", None) };
        history.record_shown_image(shown_image(number, 10 * number as u32), Instant::now(), origin);
    }
    let words =
        [messages::OPENED, "bricks.png changed", messages::AGAIN, "bricks.png changed; knot.obj changed"];
    assert_eq!(changes(&history), words);
}

#[test]
fn thumbnail_is_updated_with_its_image() {
    let mut history = RenderHistory::default();
    history.record_shown_image(shown_image(1, 1000), Instant::now(), ImageProvenance::default());
    let size = |history: &RenderHistory| history.thumbnail(0).map(|small| (small.width, small.pixels[0]));
    assert_eq!(size(&history), Some((32, [1, 2, 3])));
    let picture = uniform_picture(10, 10, [9, 8, 7]);
    history.record_shown_image(
        PreviewUpdate { picture, ..shown_image(1, 1) },
        Instant::now(),
        ImageProvenance::default(),
    );
    assert_eq!(size(&history), Some((10, [9, 8, 7])));
}

#[test]
fn ages_in_words() {
    for (seconds, words) in [(0, "0 s ago"), (119, "119 s ago"), (120, "2 min ago"), (7300, "2 h ago")] {
        assert_eq!(age_in_words(Duration::from_secs(seconds)), words);
    }
}
