//! History of recent renders, with bounded memory use.

use std::cell::OnceCell;
use std::collections::{HashMap, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::film::Srgb8Image;
use crate::messages;
use crate::pipeline::protocol::{NormalizedRect, PreviewedImageState};
use crate::rescale::resized;
use crate::state::ImageProvenance;

/// Memory limit for all images and scene texts, in bytes.
const MAX_BYTES: usize = 16 << 20;
/// Maximum width and height of a thumbnail in pixels, which is about what octants can show in the strip.
const SMALL: f32 = 32.0;

/// A displayed image and its request.
#[derive(Clone, Debug)]
pub(crate) struct ShownImage {
    pub generation: u64,
    pub picture: Arc<Srgb8Image>,
    /// Range of displayed values, for views that map values to colors.
    pub range: Option<[f32; 2]>,
    /// The section of the image shown at 1:1 scale, or `None` if the whole image is shown.
    pub section: Option<NormalizedRect>,
    /// Whether the image lacks the light from photons that are still being traced.
    pub lacks_photons: bool,
    /// The image that the preview belongs to, if known.
    pub source: Option<PreviewedImageState>,
}

impl ShownImage {
    /// Whether two previews show the same image, regardless of size and sample count.
    pub(crate) fn shows_same_image(&self, other: &Self) -> bool {
        let images = self.source.zip(other.source);
        images.is_some_and(|(own, other)| own.image == other.image)
    }

    /// Whether all samples are known to be included in the image.
    pub(crate) fn is_finished(&self) -> bool {
        self.source.is_some_and(|source| source.is_finished)
    }
}

/// Recent renders, including the one being viewed.
#[derive(Debug, Default)]
pub(super) struct RenderHistory {
    /// Recent renders, oldest first.
    past: VecDeque<HistoryEntry>,
    /// Number of scene edits so far.
    edits: u64,
    /// Number of the last edit that left the scene valid.
    read_edits: u64,
    /// The newest image and the index of the older render being viewed.
    open: Option<(usize, ShownImage)>,
}

#[derive(Debug)]
struct HistoryEntry {
    shown: ShownImage,
    /// Time when the render last improved the image.
    time: Instant,
    /// Number of the last edit included in the image.
    edits: u64,
    origin: ImageProvenance,
    /// Number of the render that finished the image, or `None` if the image is unfinished.
    run: Option<u64>,
    /// Changes since the previous entry: first the changes in files, then the changes made with keys. `None`
    /// for the first entry.
    changes: Option<[Vec<String>; 2]>,
    /// Thumbnail for the history strip, created on first use.
    small: OnceCell<Srgb8Image>,
}

impl RenderHistory {
    /// Records a scene edit. New entries include the edit once the scene has been read.
    pub(super) fn record_scene_edit(&mut self) {
        self.edits += 1;
    }

    /// Records that the scene has been read. New entries include the last edit.
    pub(super) fn record_scene_read(&mut self) {
        self.read_edits = self.edits;
    }

    /// Records that the scene turned out to be invalid. New entries still show its previous version.
    pub(super) fn discard_edits_of_invalid_scene(&mut self) {
        self.read_edits = self.past.back().map_or(self.read_edits, |newest| newest.edits);
    }

    /// Lists file changes between the render being viewed and the newest one.
    pub(super) fn describe_edits_since_viewed(&self) -> String {
        let open = self.open.as_ref().and_then(|(at, _)| self.past.get(*at));
        let edits = open
            .zip(self.past.back())
            .map(|(open, newest)| newest.origin.describe_file_changes(&open.origin));
        edits.unwrap_or_default().join("; ")
    }

    /// Describes in one line how the render being viewed differs from the previous one.
    pub(super) fn viewed_changes_text(&self) -> String {
        let Some((at, _)) = &self.open else { return String::new() };
        let Some(past) = self.past.get(*at) else { return String::new() };
        let words = match past.changes.as_ref().map(|changes| changes.concat()) {
            None => messages::OPENED.to_owned(),
            Some(changes) if changes.is_empty() => messages::AGAIN.to_owned(),
            Some(changes) => changes.join("; "),
        };
        past.with_stopped_prefix(words)
    }

    /// Records that the camera, which has been moved with keys since request `since`, was written to the
    /// scene. This counts as an edit that all entries since that request include.
    pub(super) fn record_camera_save_as_edit(&mut self, since: u64) {
        self.edits += 1;
        self.read_edits = self.edits;
        for past in self.past.iter_mut().filter(|past| past.shown.generation >= since) {
            past.edits = self.edits;
        }
    }

    /// Reassigns a request's entry to the next request, which shows the same image differently.
    pub(super) fn reassign_entry_to_next_request(&mut self, generation: u64) {
        for past in self.past.iter_mut().filter(|past| past.shown.generation == generation) {
            past.shown.generation = generation + 1;
        }
    }

    /// Adds an image, which replaces any earlier image from the same request, or the last entry's image if
    /// the two look the same.
    pub(super) fn record_shown_image(&mut self, shown: ShownImage, time: Instant, origin: ImageProvenance) {
        let known = self.past.iter().position(|past| past.shown.generation == shown.generation);
        let last = self.past.len().checked_sub(1);
        let is_last =
            |last: &usize| self.past.get(*last).is_some_and(|past| past.holds_same_image(&shown, &origin));
        match known.or_else(|| last.filter(is_last)) {
            Some(at) => {
                let past = &self.past[at];
                if known.is_none() {
                    // Edits since then had no visible effect.
                    self.read_edits = past.edits;
                }
                // Keep the origin if the image is the same.
                let is_same = known.is_none() || past.shown.shows_same_image(&shown);
                let origin = if is_same { past.origin.after_rerender_of_same_image(origin) } else { origin };
                self.replace_entry_image(at, (shown, time), origin);
                self.merge_with_previous(at);
            }
            None => {
                let edits = self.read_edits;
                let (run, changes, small) = (None, None, OnceCell::new());
                self.past.push_back(HistoryEntry { shown, time, edits, origin, run, changes, small });
                self.update_entry_changes(self.past.len() - 1);
            }
        }
        while self.past.len() > 1 && self.memory_bytes() > MAX_BYTES {
            self.remove(0);
        }
    }

    /// Replaces an entry's image with a newer version.
    fn replace_entry_image(
        &mut self,
        at: usize,
        (shown, time): (ShownImage, Instant),
        origin: ImageProvenance,
    ) {
        let Some(past) = self.past.get_mut(at) else { return };
        let is_other_picture = past.shown.picture != shown.picture;
        if is_other_picture {
            past.small = OnceCell::new();
        }
        if past.origin.is_unfinished && (is_other_picture || !origin.is_unfinished) {
            past.time = time;
        }
        let is_other = past.origin != origin;
        (past.shown, past.origin) = (shown, origin);
        if is_other {
            self.update_entry_changes(at);
            self.update_entry_changes(at + 1);
        }
    }

    /// Merges a finished entry with the previous one if both show the same image.
    fn merge_with_previous(&mut self, at: usize) {
        let Some(before) = at.checked_sub(1) else { return };
        let is_open = self.open.as_ref().is_some_and(|(open, _)| *open == before);
        let Some((earlier, past)) = self.past.get(before).zip(self.past.get(at)) else { return };
        if is_open || past.origin.is_unfinished || !earlier.holds_same_image(&past.shown, &past.origin) {
            return;
        }
        let (edits, run) = (earlier.edits, past.run.or(earlier.run));
        let origin = earlier.origin.after_rerender_of_same_image(past.origin.clone());
        self.remove(before);
        if let Some(past) = self.past.get_mut(before) {
            (past.edits, past.run, past.origin) = (edits, run, origin);
        }
        self.read_edits = edits;
        // The first entry has no changes.
        if before == 0
            && let Some(past) = self.past.get_mut(0)
        {
            past.changes = None;
        }
        self.update_entry_changes(before);
    }

    fn remove(&mut self, at: usize) {
        self.past.remove(at);
        if let Some((open, _)) = &mut self.open
            && *open > at
        {
            *open -= 1;
        }
    }

    /// Drops the unfinished entry for a request.
    pub(super) fn drop_unfinished_of_request(&mut self, generation: u64) {
        let is_it = |past: &HistoryEntry| past.shown.generation == generation && past.run.is_none();
        if let Some(at) = self.past.iter().position(is_it) {
            self.remove(at);
        }
    }

    /// Records that a render has finished the newest entry.
    pub(super) fn finish_newest(&mut self, run: u64) {
        if let Some(newest) = self.past.back_mut() {
            newest.run = Some(run);
        }
    }

    /// Whether the newest entry belongs to this request.
    pub(super) fn is_newest_from_request(&self, generation: u64) -> bool {
        self.past.back().is_some_and(|newest| newest.shown.generation == generation)
    }

    /// Whether the newest entry is unfinished.
    pub(super) fn is_newest_unfinished(&self) -> bool {
        self.past.back().is_some_and(|newest| newest.run.is_none())
    }

    /// Number of the render that finished an entry, or `None` if the entry is unfinished.
    pub(super) fn render_number_at(&self, at: usize) -> Option<u64> {
        self.past.get(at)?.run
    }

    /// Memory used by images and scene texts, in bytes. Entries with the same scene share the text.
    fn memory_bytes(&self) -> usize {
        let pictures: usize = self.past.iter().map(HistoryEntry::memory_bytes).sum();
        let texts = self.past.iter().filter_map(|past| past.origin.text.as_ref());
        let texts: HashMap<*const u8, usize> = texts.map(|text| (text.as_ptr(), text.len())).collect();
        pictures + texts.values().sum::<usize>()
    }

    /// Compares an entry's scene and settings with those of the previous entry.
    fn update_entry_changes(&mut self, at: usize) {
        let before = at.checked_sub(1).and_then(|before| self.past.get(before));
        let Some((before, past)) = before.zip(self.past.get(at)) else { return };
        let edits = past.origin.describe_file_changes(&before.origin);
        // If `c` wrote the camera to the scene, list the change as an edit, not as a camera movement.
        let is_written = edits.iter().any(|edit| edit.contains("camera."));
        let keys = past.origin.toggles.describe_changes_since(&before.origin.toggles, is_written);
        if let Some(past) = self.past.get_mut(at) {
            past.changes = Some([edits, keys]);
        }
    }

    /// Scene and settings of the older render being viewed, or `None` if the newest one is being viewed.
    pub(super) fn viewed_older_scene_and_settings(&self) -> Option<&ImageProvenance> {
        let (at, _) = self.open.as_ref()?;
        self.past.get(*at).map(|past| &past.origin)
    }

    /// Whether the oldest render is being viewed.
    pub(super) fn is_viewing_oldest(&self) -> bool {
        self.open.as_ref().is_some_and(|(at, _)| *at == 0)
    }

    /// Whether an older render is being viewed.
    pub(super) fn is_viewing_older(&self) -> bool {
        self.open.is_some()
    }

    /// The newest image, if an older one is being viewed.
    pub(super) fn newest_while_viewing_older(&self) -> Option<ShownImage> {
        self.open.as_ref().map(|(_, newest)| newest.clone())
    }

    /// Stores a new image. Returns whether it stays hidden because an older one is being viewed.
    pub(super) fn store_newest_if_viewing_older(&mut self, shown: &ShownImage) -> bool {
        if let Some((_, newest)) = &mut self.open {
            *newest = shown.clone();
        }
        self.is_viewing_older()
    }

    /// Moves back by `back` entries, or forward if `back` is negative.
    pub(super) fn step_back_by(&mut self, back: isize, newest: ShownImage) -> Option<ShownImage> {
        let at = self.open.as_ref().map_or(self.past.len().checked_sub(1)?, |(at, _)| *at);
        let next = at.checked_add_signed(-back).filter(|next| *next < self.past.len())?;
        self.open_entry(next, newest)
    }

    /// Whether moving `back` entries back (forward if negative) reaches the newest one.
    pub(super) fn returns_to_newest(&self, back: isize) -> bool {
        let place = self.open.as_ref().and_then(|(at, _)| at.checked_add_signed(-back));
        place.is_some_and(|place| place + 1 >= self.past.len())
    }

    /// Opens the last render made before the last edit that changed the image.
    pub(super) fn open_before_edit(&mut self, newest: ShownImage) -> Option<ShownImage> {
        let last = self.past.back()?.edits;
        let at = self.past.iter().rposition(|past| past.edits < last)?;
        self.open_entry(at, newest)
    }

    /// Number of history entries.
    pub(super) fn len(&self) -> usize {
        self.past.len()
    }

    /// Image of the newest entry.
    pub(super) fn last_picture(&self) -> Option<&Arc<Srgb8Image>> {
        self.past.back().map(|newest| &newest.shown.picture)
    }

    /// Index of the entry being viewed, which is the newest one unless an older one is open.
    pub(super) fn shown_index(&self) -> Option<usize> {
        self.open.as_ref().map(|(at, _)| *at).or_else(|| self.past.len().checked_sub(1))
    }

    /// The thumbnail of a history entry.
    pub(super) fn thumbnail(&self, at: usize) -> Option<&Srgb8Image> {
        let past = self.past.get(at)?;
        Some(past.small.get_or_init(|| thumbnail(&past.shown.picture)))
    }

    /// Whether an entry belongs to this request.
    pub(super) fn entry_belongs_to_request(&self, at: usize, generation: u64) -> bool {
        self.past.get(at).is_some_and(|past| past.shown.generation == generation)
    }

    /// Describes the changes since the previous entry: edits first, then keys. An entry still being rendered
    /// is not marked as stopped.
    pub(super) fn describe_changes_since_previous(&self, at: usize, is_under_way: bool) -> Vec<String> {
        let Some(past) = self.past.get(at) else { return Vec::new() };
        let words = match past.changes.as_ref().map(|changes| changes.concat()) {
            None => vec![messages::OPENED.to_owned()],
            Some(changes) if changes.is_empty() => vec![messages::AGAIN.to_owned()],
            Some(changes) => changes,
        };
        let unfinished = (past.origin.is_unfinished && !is_under_way).then(|| messages::STOPPED.to_owned());
        unfinished.into_iter().chain(words).collect()
    }

    /// Opens a history entry for viewing.
    pub(super) fn open_at(&mut self, at: usize, newest: ShownImage) -> Option<ShownImage> {
        self.open_entry(at, newest)
    }

    fn open_entry(&mut self, at: usize, newest: ShownImage) -> Option<ShownImage> {
        let shown = self.past.get(at)?.shown.clone();
        self.open = Some((at, newest));
        Some(shown)
    }

    /// Returns to the newest image.
    pub(super) fn return_to_newest(&mut self) -> Option<ShownImage> {
        self.open.take().map(|(_, newest)| newest)
    }

    /// Render number of the older entry being viewed, and the time when its image last improved.
    pub(super) fn viewed_render_number_and_time(&self) -> Option<(Option<u64>, Instant)> {
        let (at, _) = self.open.as_ref()?;
        self.past.get(*at).map(|past| (past.run, past.time))
    }
}

impl HistoryEntry {
    /// Whether the entry shows the same image as `shown`. An unfinished image is not considered the same as a
    /// finished one.
    fn holds_same_image(&self, shown: &ShownImage, origin: &ImageProvenance) -> bool {
        let is_of_image =
            self.shown.shows_same_image(shown) && (self.origin.is_unfinished || !origin.is_unfinished);
        // An unfinished image may look the same at first and change later.
        let may_change = origin.is_unfinished && !self.origin.is_unfinished;
        is_of_image || self.shown.picture == shown.picture && !may_change
    }

    /// Prefixes `words` with a label if the render was stopped.
    fn with_stopped_prefix(&self, words: String) -> String {
        if self.origin.is_unfinished { format!("{}: {words}", messages::STOPPED) } else { words }
    }

    fn memory_bytes(&self) -> usize {
        self.shown.picture.pixels.len() * size_of::<[u8; 3]>()
    }
}

/// Scales an image down to at most [`SMALL`] columns and rows.
fn thumbnail(picture: &Srgb8Image) -> Srgb8Image {
    let scale = (SMALL / picture.width.max(picture.height).max(1) as f32).min(1.0);
    let side = |length: u32| ((length as f32 * scale).round() as u32).max(1);
    resized(picture, side(picture.width), side(picture.height))
}

/// Formats the age of a render, such as `2 min ago`.
pub(super) fn age_in_words(time: Duration) -> String {
    match time.as_secs() {
        seconds @ ..120 => format!("{seconds} s ago"),
        seconds @ ..7200 => format!("{} min ago", seconds / 60),
        seconds => format!("{} h ago", seconds / 3600),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::uniform_picture;
    use crate::pipeline::settings::{CameraOverrides, ViewMode};
    use crate::pipeline::{FileContentId, FilePathAndContentId};
    use crate::scene::fingerprint::FingerprintHasher;
    use crate::state::KeyOverrides;

    fn shown_image(generation: u64, side: u32) -> ShownImage {
        ShownImage {
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
                ShownImage { picture, ..shown_image(generation, 1) },
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
                ShownImage { picture, ..shown_image(generation, 1) },
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
            history.record_shown_image(
                shown_image(generation, 10),
                Instant::now(),
                ImageProvenance::default(),
            );
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
        let better = ShownImage { picture: uniform_picture(10, 10, [1, 2, 4]), ..shown_image(2, 10) };
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
        let before = history.open_before_edit(shown_image(4, 20)).expect("a picture");
        assert_eq!(before.generation, 1);
        // Images rendered after a key press include the last edit.
        history.return_to_newest();
        history.record_shown_image(shown_image(5, 30), Instant::now(), ImageProvenance::default());
        let before = history.open_before_edit(shown_image(5, 30)).expect("a picture");
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
        assert_eq!(history.open_before_edit(shown_image(3, 30)).expect("a picture").generation, 1);
    }

    /// A preview of a finished or unfinished image, and the image's origin.
    fn of_image(generation: u64, name: &str, is_finished: bool) -> (ShownImage, ImageProvenance) {
        let source = Some(PreviewedImageState { image: FingerprintHasher::new(name).finish(), is_finished });
        // Make every preview different.
        let picture = uniform_picture(10, 10, [generation as u8, u8::from(is_finished), 0]);
        let origin = ImageProvenance { is_unfinished: !is_finished, ..ImageProvenance::default() };
        (ShownImage { source, picture, ..shown_image(generation, 10) }, origin)
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
            assert!(history.is_newest_from_request(generation) && history.is_newest_unfinished());
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
        let before = history.open_before_edit(shown_image(3, 30)).expect("a picture");
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
        let toggles = KeyOverrides { view, ..KeyOverrides::default() };
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
        history.record_shown_image(
            shown_image(3, 30),
            Instant::now(),
            origin(narrow, Some(ViewMode::Normal)),
        );
        history.record_scene_edit();
        history.record_shown_image(shown_image(4, 40), Instant::now(), origin(seed, None));
        history.record_shown_image(shown_image(5, 50), Instant::now(), origin(seed, None));
        assert_eq!(
            changes(&history),
            [
                messages::OPENED,
                "camera.fov 40 → 30",
                "view normal",
                "+ seed = 1; view reset",
                messages::AGAIN
            ]
        );
        assert_eq!((history.len(), history.shown_index()), (5, Some(4)));
    }

    #[test]
    fn saved_camera_is_listed_once() {
        let mut history = RenderHistory::default();
        let camera = CameraOverrides { fov: Some(30.0), ..CameraOverrides::default() };
        let moved = KeyOverrides { camera, ..KeyOverrides::default() };
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
            let toggles = KeyOverrides { photons, ..KeyOverrides::default() };
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
        let moved = KeyOverrides { camera, photons: Some(true), ..KeyOverrides::default() };
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
        let mut record = |history: &mut RenderHistory, name: &str, toggles: KeyOverrides, text: &str| {
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
        let keys = KeyOverrides::default();
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
        let moved = KeyOverrides { camera, ..KeyOverrides::default() };
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
            ShownImage { picture, ..shown_image(1, 1) },
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
}
