//! The text of a history entry. It shows as many changes as fit. New values are never shortened.

use unicode_width::UnicodeWidthStr;

use crate::messages;
use crate::scene::{shortened_key, split_at_unquoted_space, split_dotted_key};

/// Text of a history entry.
pub(super) struct EntryNumberAndChanges {
    /// The entry's mark and number, followed by a space.
    pub(super) head: String,
    /// Changes since the previous entry.
    pub(super) changes: Vec<String>,
}

/// How much of a change to show, from most to least.
#[derive(Clone, Copy)]
enum ChangeDetail {
    /// The key with its old and new values.
    Full,
    /// The key with its new value.
    New,
    /// The new value and the last parts of the key, which identify an object and its property.
    Short,
    /// Like `Short`, but with only this many changes.
    First(usize),
    /// The first change, with the property shortened to one line.
    Cut,
}

/// Formats the text as lines of `width` columns. Tries to fit it into `rows[0]` rows, then into `rows[1]`. If
/// it fits into neither, the excess is appended to the last line.
pub(super) fn wrap_entry_text(words: &EntryNumberAndChanges, width: usize, rows: [usize; 2]) -> Vec<String> {
    let [few, most] = rows;
    let all = [ChangeDetail::Full, ChangeDetail::New, ChangeDetail::Short];
    let count = words.changes.len();
    let fewer = (1..count).rev().map(ChangeDetail::First).chain([ChangeDetail::Cut]);
    let in_few = all.map(|form| (form, few));
    let in_most = all.into_iter().chain(fewer).map(|form| (form, most));
    let lines = |form| wrap_pieces(&words.head, &split_changes_into_pieces(words, form, width), width);
    let is_lone =
        |lines: &[String]| lines.first().is_some_and(|line| line.trim_end() == words.head.trim_end());
    let fits = |(form, rows): (ChangeDetail, usize)| {
        let lines = lines(form);
        let is_whole = lines.iter().all(|line| line.width() <= width);
        (lines.len() <= rows && is_whole && !is_lone(&lines)).then_some(lines)
    };
    let mut lines =
        in_few.into_iter().chain(in_most).find_map(fits).unwrap_or_else(|| lines(ChangeDetail::Cut));
    if lines.len() > most {
        let rest = lines.split_off(most.saturating_sub(1)).join(" ");
        lines.push(rest);
    }
    lines
}

/// Splits all displayed changes into pieces.
fn split_changes_into_pieces(
    words: &EntryNumberAndChanges,
    form: ChangeDetail,
    width: usize,
) -> Vec<UnbreakablePiece> {
    let changes = &words.changes;
    let listed = match form {
        ChangeDetail::Full | ChangeDetail::New | ChangeDetail::Short => changes.len(),
        ChangeDetail::First(listed) => listed,
        ChangeDetail::Cut => 1,
    };
    let mut pieces = Vec::new();
    for (number, change) in (1..).zip(changes.iter().take(listed)) {
        pieces.extend(change_pieces(change, form, width.saturating_sub(words.head.width())));
        let end = match () {
            () if number == listed => "",
            () if change == messages::STOPPED => ":",
            () => ";",
        };
        if let Some(UnbreakablePiece { text, .. }) = pieces.last_mut() {
            *text += end;
        }
    }
    if listed < changes.len() {
        pieces.push(UnbreakablePiece::from_text("…"));
    }
    pieces
}

/// Text that is kept on one line if possible.
struct UnbreakablePiece {
    text: String,
    is_key: bool,
}

impl UnbreakablePiece {
    fn from_text(text: impl Into<String>) -> Self {
        Self { text: text.into(), is_key: false }
    }

    /// Splits the text where a line may be broken: after parts of the key, or between words.
    fn breakable_parts(&self) -> Vec<String> {
        if !self.is_key {
            return self.text.split(' ').map(str::to_owned).collect();
        }
        let mut parts: Vec<String> =
            split_dotted_key(&self.text).iter().map(|part| format!("{part}.")).collect();
        if let Some(last) = parts.last_mut() {
            last.pop();
        }
        parts
    }
}

/// Splits a change into pieces: the key and its values, or single words.
fn change_pieces(change: &str, form: ChangeDetail, beside_head: usize) -> Vec<UnbreakablePiece> {
    let words = |text: &str| text.split(' ').map(UnbreakablePiece::from_text).collect::<Vec<_>>();
    let key = |key: &str| UnbreakablePiece { text: format_changed_key(key, form, beside_head), is_key: true };
    if let Some((sign @ ("+" | "−"), rest)) = change.split_once(' ') {
        let (name, value) = split_at_unquoted_space(rest).unwrap_or((rest, ""));
        let value = if value.is_empty() { Vec::new() } else { words(value) };
        return [UnbreakablePiece::from_text(sign), key(name)].into_iter().chain(value).collect();
    }
    let of_key = split_at_unquoted_space(change).filter(|_| !change.starts_with("line "));
    let Some((name, old, new)) = of_key.and_then(|(name, values)| {
        let (old, new) = values.rsplit_once(" → ")?;
        Some((name, old, new))
    }) else {
        return words(change);
    };
    let new = UnbreakablePiece::from_text(format!("→ {new}"));
    match form {
        ChangeDetail::Full => vec![key(name), UnbreakablePiece::from_text(old), new],
        ChangeDetail::New | ChangeDetail::Short | ChangeDetail::First(_) | ChangeDetail::Cut => {
            vec![key(name), new]
        }
    }
}

fn format_changed_key(key: &str, form: ChangeDetail, beside_head: usize) -> String {
    match form {
        ChangeDetail::Full | ChangeDetail::New => key.to_owned(),
        ChangeDetail::Short | ChangeDetail::First(_) => last_key_parts(key),
        ChangeDetail::Cut => shortened_key(&last_key_parts(key), beside_head),
    }
}

/// Returns the last parts of a key, which identify an object and its property: `lamp.emission` for
/// `materials.lamp.emission`, but all of `light.1.direction`.
fn last_key_parts(key: &str) -> String {
    let parts = split_dotted_key(key);
    let first = parts.len().saturating_sub(2);
    let is_number = parts[first].parse::<u64>().is_ok();
    parts[first.saturating_sub(usize::from(is_number))..].join(".")
}

/// Fills lines with pieces. The first line starts with `head`. Pieces that are too long are broken. Keys are
/// broken after a dot, and other pieces between words.
fn wrap_pieces(head: &str, pieces: &[UnbreakablePiece], width: usize) -> Vec<String> {
    let mut lines = vec![head.to_owned()];
    let mut is_behind_head = true;
    for piece in pieces {
        let room = if is_behind_head { width.saturating_sub(head.width()) } else { width };
        let is_whole = piece.text.width() <= room;
        let parts = if is_whole { vec![piece.text.clone()] } else { piece.breakable_parts() };
        for (number, part) in parts.iter().enumerate() {
            let Some(line) = lines.last_mut() else { return lines };
            let gap = if is_behind_head || number > 0 && piece.is_key { "" } else { " " };
            if line.width() + gap.len() + part.width() <= width {
                *line += gap;
                *line += part;
            } else {
                lines.push(part.clone());
            }
            is_behind_head = false;
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(number: &str, changes: &[&str], width: usize) -> Vec<String> {
        let changes = changes.iter().map(|change| (*change).to_owned()).collect();
        wrap_entry_text(&EntryNumberAndChanges { head: format!("{number} "), changes }, width, [3, 4])
    }

    #[test]
    fn number_comes_first_and_new_value_is_complete() {
        let emission = "materials.lamp.emission [14, 13, 11] → [20, 13, 5]";
        assert_eq!(lines("▸4", &[emission], 13), ["▸4 materials.", "lamp.emission", "→ [20, 13, 5]"]);
        assert_eq!(lines("▸4", &[emission], 12), ["▸4 lamp.", "emission →", "[20, 13, 5]"]);
        let diffuse = "materials.board.diffuse [0.8, 0.02, 0.02] → [0.02, 0.8, 0.02]";
        assert_eq!(lines(" 3", &[diffuse], 14), [" 3 materials.", "board.diffuse", "→ [0.02, 0.8,", "0.02]"]);
        assert_eq!(lines(" 2", &["camera.fov 40 → 30"], 14), [" 2 camera.fov", "40 → 30"]);
        let long = "materials.a_very_long_name.diffuse [0.123456, 0.234567, 0.3…→ [0.1, 0.2, 0.3]";
        let long = long.replace("…→", "… →");
        assert_eq!(lines("12", &[&long], 13), ["12 …diffuse →", "[0.1, 0.2,", "0.3]"]);
    }

    #[test]
    fn property_name_is_always_shown() {
        let quoted = "materials.\"copper ball\".roughness 0.1 → 0.4";
        let light = "light.1.direction [0, -1, 0] → [0.25, -1, 0.5]";
        let comes = "+ materials.\"copper ball\".roughness = 0.4";
        let dotted = "textures.\"a.b → c\".repeat [1, 1] → [2, 2]";
        for (change, property) in
            [(quoted, "roughness"), (light, "direction"), (comes, "roughness"), (dotted, "repeat")]
        {
            for width in 13..60 {
                let lines = lines("▸4", &[change], width);
                assert!(lines.join("").contains(property), "{width}: {lines:?}");
                assert!(lines.iter().all(|line| line.width() <= width), "{width}: {lines:?}");
                assert!(!lines.iter().any(|line| line.contains(" 1.direction")), "{width}: {lines:?}");
            }
        }
        assert_eq!(lines("▸4", &[quoted], 26), ["▸4 materials.", "\"copper ball\".roughness", "0.1 → 0.4"]);
        assert_eq!(lines("▸4", &[quoted], 40).join("|"), "▸4 materials.\"copper ball\".roughness 0.1|→ 0.4");
    }

    #[test]
    fn settings_reset_together_form_one_change() {
        assert_eq!(lines(" 4", &["integrator and view reset"], 60), [" 4 integrator and view reset"]);
    }

    #[test]
    fn mark_does_not_affect_line_breaks() {
        let changes = [messages::STOPPED, "shadows hard", "view and camera reset"];
        for width in 10..30 {
            let [with, without] = ["▸7", " 7"].map(|number| lines(number, &changes, width));
            assert_eq!(with[1..], without[1..], "{width}");
            assert_eq!(with[0][3..].trim(), without[0][1..].trim(), "{width}");
        }
    }

    #[test]
    fn changes_are_shortened_to_fit() {
        let changes =
            ["camera.fov 40 → 30", "materials.lamp.emission [14, 13, 11] → [20, 13, 5]", "shadows hard"];
        let wide = lines("▸4", &changes, 40).join("|");
        let words =
            "▸4 camera.fov 40 → 30; |materials.lamp.emission [14, 13, 11]|→ [20, 13, 5]; shadows hard";
        assert_eq!(wide, words.replace(" |", "|"));
        assert_eq!(lines("▸4", &changes, 14), ["▸4 camera.fov", "→ 30 …"]);
        let moved = ["camera.position [0, 0, 4] → [0, 0, 3.8]", "camera.focus 4.0 → 3.8"];
        assert_eq!(lines("▸3", &moved, 14), ["▸3 camera.", "position", "→ [0, 0, 3.8]", "…"]);
    }

    #[test]
    fn as_many_changes_as_possible_are_shown() {
        let changes = [messages::STOPPED, "camera.fov 40 → 25.0", "render.samples 64 → 16"];
        assert_eq!(lines(" –", &changes, 14), [" – stopped:", "camera.fov", "→ 25.0 …"]);
        let six = [
            "+ render.shadows = \"off\"",
            "camera.position [0, 1, 4] → [-0.3773, 0.9512, 3.5904]",
            "camera.fov 40 → 25 and 3 more",
        ];
        let [few, most] = [24, 26].map(|width| lines("10", &six, width));
        assert_eq!(
            few,
            ["10 + render.shadows =", "\"off\"; camera.position →", "[-0.3773, 0.9512,", "3.5904] …"]
        );
        let all = [
            "10 + render.shadows =",
            "\"off\"; camera.position →",
            "[-0.3773, 0.9512, 3.5904];",
            "camera.fov → 25 and 3 more",
        ];
        assert_eq!(most, all);
    }
}
