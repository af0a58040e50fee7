//! The words beside a picture of the strip: as much of what changed as there is room for, and in any case the new value.

use unicode_width::UnicodeWidthStr;

use super::text::shortened;

/// Words beside a picture.
pub(super) struct Words {
    /// The mark and the number, with a blank behind them.
    pub(super) head: String,
    /// Changes since the picture before.
    pub(super) changes: Vec<String>,
}

/// Parts of a change to tell, from most to fewest.
#[derive(Clone, Copy)]
enum Form {
    /// The key with its old and its new value.
    Full,
    /// The key with its new value.
    New,
    /// The last two names of the key, with its new value.
    Short,
    /// The same of so many changes.
    First(usize),
    /// The first change, with the key in one line.
    Cut,
}

/// Lines of a width: in the first number of rows if that is enough, else in the second. The last line has what is too much.
pub(super) fn fitting(words: &Words, width: usize, rows: [usize; 2]) -> Vec<String> {
    let [few, most] = rows;
    let all = [Form::Full, Form::New, Form::Short];
    let count = words.changes.iter().map(|change| apart(change).len()).sum();
    let fewer = (1..count).rev().map(Form::First).chain([Form::Cut]);
    let in_few = all.map(|form| (form, few));
    let in_most = all.into_iter().chain(fewer).map(|form| (form, most));
    let lines = |form| filled(&words.head, &pieces(words, form, width), width);
    let is_lone =
        |lines: &[String]| lines.first().is_some_and(|line| line.trim_end() == words.head.trim_end());
    let fits = |(form, rows): (Form, usize)| {
        let lines = lines(form);
        let is_whole = lines.iter().all(|line| line.width() <= width);
        (lines.len() <= rows && is_whole && !is_lone(&lines)).then_some(lines)
    };
    let mut lines = in_few.into_iter().chain(in_most).find_map(fits).unwrap_or_else(|| lines(Form::Cut));
    if lines.len() > most {
        let rest = lines.split_off(most.saturating_sub(1)).join(" ");
        lines.push(rest);
    }
    lines
}

/// Pieces of the changes that stay whole if they fit into a line.
fn pieces(words: &Words, form: Form, width: usize) -> Vec<String> {
    let changes: Vec<&str> = words.changes.iter().flat_map(|change| apart(change)).collect();
    let told = match form {
        Form::Full | Form::New | Form::Short => changes.len(),
        Form::First(told) => told,
        Form::Cut => 1,
    };
    let mut pieces = Vec::new();
    for (number, change) in (1..).zip(changes.iter().take(told)) {
        pieces.extend(of_change(change, form, width.saturating_sub(words.head.width())));
        let end = if number < told { ";" } else { "" };
        if let Some(last) = pieces.last_mut() {
            *last += end;
        }
    }
    if told < changes.len() {
        pieces.push("…".to_owned());
    }
    pieces
}

/// Pieces of one change: the key, its values; or single words.
fn of_change(change: &str, form: Form, beside_head: usize) -> Vec<String> {
    let values = change.rsplit_once(" → ").filter(|_| !change.starts_with("line "));
    let key = values.and_then(|(before, new)| Some((before.split_once(' ')?, new)));
    let Some(((key, old), new)) = key else { return change.split(' ').map(str::to_owned).collect() };
    let new = format!("→ {new}");
    match form {
        Form::Full => vec![key.to_owned(), old.to_owned(), new],
        Form::New => vec![key.to_owned(), new],
        Form::Short | Form::First(_) => vec![last_names(key).to_owned(), new],
        Form::Cut => vec![shortened(last_names(key), u16::try_from(beside_head).unwrap_or(u16::MAX)), new],
    }
}

/// The last two names of a key: `lamp.emission` of `materials.lamp.emission`.
fn last_names(key: &str) -> &str {
    key.rmatch_indices('.').nth(1).map_or(key, |(at, _)| &key[at + 1..])
}

/// Changes that stand in one text, behind commas that are in no value.
fn apart(changes: &str) -> Vec<&str> {
    let (mut parts, mut start, mut depth, mut is_quoted) = (Vec::new(), 0, 0_u32, false);
    for (at, c) in changes.char_indices() {
        match c {
            '"' => is_quoted = !is_quoted,
            '[' | '{' => depth += 1,
            ']' | '}' => depth = depth.saturating_sub(1),
            // A value that is cut.
            '…' => (depth, is_quoted) = (0, false),
            ',' if depth == 0 && !is_quoted && changes[at..].starts_with(", ") => {
                parts.push(&changes[start..at]);
                start = at + 2;
            }
            _ => {}
        }
    }
    parts.push(&changes[start..]);
    parts
}

/// Puts pieces into lines behind a head. Pieces that are too long for a line are broken: keys behind a point, all else between
/// words.
fn filled(head: &str, pieces: &[String], width: usize) -> Vec<String> {
    let mut lines = vec![head.to_owned()];
    let mut is_behind_head = true;
    for piece in pieces {
        let room = if is_behind_head { width.saturating_sub(head.width()) } else { width };
        let is_value = piece.starts_with(['→', '[', '{', '"']) || piece.contains(' ');
        let parts: Vec<&str> = match piece.width() > room {
            true if is_value => piece.split(' ').collect(),
            true => piece.split_inclusive('.').collect(),
            false => vec![piece.as_str()],
        };
        for (number, part) in parts.into_iter().enumerate() {
            let Some(line) = lines.last_mut() else { return lines };
            let gap = if is_behind_head || number > 0 && !is_value { "" } else { " " };
            if line.width() + gap.len() + part.width() <= width {
                *line += gap;
                *line += part;
            } else {
                lines.push(part.to_owned());
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
        fitting(&Words { head: format!("{number} "), changes }, width, [3, 4])
    }

    #[test]
    fn the_number_stands_beside_the_key_and_the_new_value_is_whole() {
        let emission = "materials.lamp.emission [14, 13, 11] → [20, 13, 5]";
        assert_eq!(lines("▸4", &[emission], 13), ["▸4 materials.", "lamp.emission", "→ [20, 13, 5]"]);
        assert_eq!(lines("▸4", &[emission], 12), ["▸4 lamp.", "emission →", "[20, 13, 5]"]);
        let diffuse = "materials.board.diffuse [0.8, 0.02, 0.02] → [0.02, 0.8, 0.02]";
        assert_eq!(lines(" 3", &[diffuse], 14), [" 3 materials.", "board.diffuse", "→ [0.02, 0.8,", "0.02]"]);
        assert_eq!(lines(" 2", &["camera.fov 40 → 30"], 14), [" 2 camera.fov", "40 → 30"]);
        let long = "materials.a_very_long_name.diffuse [0.123456, 0.234567, 0.3…→ [0.1, 0.2, 0.3]";
        let long = long.replace("…→", "… →");
        assert_eq!(lines("12", &[&long], 13), ["12 a_very_lo…", "→ [0.1, 0.2,", "0.3]"]);
    }

    #[test]
    fn a_mark_breaks_no_line() {
        let changes = ["unfinished", "shadows hard", "back to the scene's view, camera"];
        for width in 10..30 {
            let [with, without] = ["▸7", " 7"].map(|number| lines(number, &changes, width));
            assert_eq!(with[1..], without[1..], "{width}");
            assert_eq!(with[0][3..].trim(), without[0][1..].trim(), "{width}");
        }
    }

    #[test]
    fn several_changes_are_told_as_far_as_there_is_room() {
        let changes =
            ["camera.fov 40 → 30, materials.lamp.emission [14, 13, 11] → [20, 13, 5]", "shadows hard"];
        let wide = lines("▸4", &changes, 40).join("|");
        let words =
            "▸4 camera.fov 40 → 30; |materials.lamp.emission [14, 13, 11]|→ [20, 13, 5]; shadows hard";
        assert_eq!(wide, words.replace(" |", "|"));
        assert_eq!(lines("▸4", &changes, 14), ["▸4 camera.fov", "→ 30 …"]);
        let moved = "camera.position [0, 0, 4] → [0, 0, 3.8], camera.focus 4.0 → 3.8";
        assert_eq!(lines("▸3", &[moved], 14), ["▸3 camera.", "position", "→ [0, 0, 3.8]", "…"]);
    }

    #[test]
    fn as_many_changes_are_told_as_there_is_room_for() {
        let changes = "camera.fov 40 → 25.0, render.samples 64 → 16";
        assert_eq!(lines(" –", &["unfinished", changes], 14), [" – unfinished;", "camera.fov", "→ 25.0 …"]);
        let six = "+ render.shadows = \"off\", camera.position [0, 1, 4] → [-0.3773, 0.9512, 3.5904], \
            camera.fov 40 → 25 and 3 more";
        let [few, most] = [24, 26].map(|width| lines("10", &[six], width));
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
