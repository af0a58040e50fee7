//! History of recent renders, with bounded memory use.

use std::cell::OnceCell;
use std::collections::{HashMap, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::film::Srgb8Image;
use crate::messages;
use crate::pipeline::protocol::PreviewUpdate;
use crate::rescale::resized;
use crate::state::ImageProvenance;

/// Memory limit for all images and scene texts, in bytes.
const MAX_BYTES: usize = 16 << 20;
/// Maximum width and height of a thumbnail in pixels, which is about what octants can show in the strip.
const SMALL: f32 = 32.0;

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
    open: Option<(usize, PreviewUpdate)>,
}

#[derive(Debug)]
struct HistoryEntry {
    shown: PreviewUpdate,
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
        past.prefix_if_stopped(words)
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
    pub(super) fn record_shown_image(
        &mut self,
        shown: PreviewUpdate,
        time: Instant,
        origin: ImageProvenance,
    ) {
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
                self.replace_entry_image(at, shown, time, origin);
                self.merge_if_same_as_previous(at);
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
        shown: PreviewUpdate,
        time: Instant,
        origin: ImageProvenance,
    ) {
        let Some(past) = self.past.get_mut(at) else { return };
        let has_other_image = past.shown.picture != shown.picture;
        if has_other_image {
            past.small = OnceCell::new();
        }
        if past.origin.is_unfinished && (has_other_image || !origin.is_unfinished) {
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
    fn merge_if_same_as_previous(&mut self, at: usize) {
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
        let is_displayed = |past: &HistoryEntry| past.shown.generation == generation && past.run.is_none();
        if let Some(at) = self.past.iter().position(is_displayed) {
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
    pub(super) fn newest_is_from_request(&self, generation: u64) -> bool {
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
    pub(super) fn newest_while_viewing_older(&self) -> Option<PreviewUpdate> {
        self.open.as_ref().map(|(_, newest)| newest.clone())
    }

    /// Stores a new image. Returns whether it stays hidden because an older one is being viewed.
    pub(super) fn store_newest_if_viewing_older(&mut self, shown: &PreviewUpdate) -> bool {
        if let Some((_, newest)) = &mut self.open {
            *newest = shown.clone();
        }
        self.is_viewing_older()
    }

    /// Moves back by `back` entries, or forward if `back` is negative.
    pub(super) fn step_back_by(&mut self, back: isize, newest: PreviewUpdate) -> Option<PreviewUpdate> {
        let at = self.open.as_ref().map_or(self.past.len().checked_sub(1)?, |(at, _)| *at);
        let next = at.checked_add_signed(-back).filter(|next| *next < self.past.len())?;
        self.open_entry(next, newest)
    }

    /// Whether moving `back` entries back (forward if negative) reaches the newest one.
    pub(super) fn step_reaches_newest(&self, back: isize) -> bool {
        let place = self.open.as_ref().and_then(|(at, _)| at.checked_add_signed(-back));
        place.is_some_and(|place| place + 1 >= self.past.len())
    }

    /// Opens the last render made before the last edit that changed the image.
    pub(super) fn open_render_before_edit(&mut self, newest: PreviewUpdate) -> Option<PreviewUpdate> {
        let last = self.past.back()?.edits;
        let at = self.past.iter().rposition(|past| past.edits < last)?;
        self.open_entry(at, newest)
    }

    /// Number of history entries.
    pub(super) fn len(&self) -> usize {
        self.past.len()
    }

    /// Image of the newest entry.
    pub(super) fn last_image(&self) -> Option<&Arc<Srgb8Image>> {
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
    pub(super) fn open_entry(&mut self, at: usize, newest: PreviewUpdate) -> Option<PreviewUpdate> {
        let shown = self.past.get(at)?.shown.clone();
        self.open = Some((at, newest));
        Some(shown)
    }

    /// Returns to the newest image.
    pub(super) fn return_to_newest(&mut self) -> Option<PreviewUpdate> {
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
    fn holds_same_image(&self, shown: &PreviewUpdate, origin: &ImageProvenance) -> bool {
        let is_of_image =
            self.shown.shows_same_image(shown) && (self.origin.is_unfinished || !origin.is_unfinished);
        // An unfinished image may look the same at first and change later.
        let may_change = origin.is_unfinished && !self.origin.is_unfinished;
        is_of_image || self.shown.picture == shown.picture && !may_change
    }

    /// Prefixes `words` with a label if the render was stopped.
    fn prefix_if_stopped(&self, words: String) -> String {
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
mod tests;
