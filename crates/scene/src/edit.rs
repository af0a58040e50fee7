//! The camera put back into the text of a scene: numbers take the place of numbers, all else stays as it is.

use std::ops::Range;

use super::description::{Pose, Viewpoint, is_same_distance};
use super::document::{FOV_DEGREES, camera_of};
use super::source::Source;
use super::toml::{self, Entries, Item, KeyValue, Value};
use crate::math::DVec3;

/// The text of a scene file with this camera in place of its own.
///
/// # Errors
/// Why that cannot be.
pub(super) fn with_camera(text: &str, wanted: &Viewpoint) -> Result<String, String> {
    let (document, errors) = toml::parse(text);
    let found = document.root().get("camera").filter(|_| errors.is_empty());
    let Some(Item::Table(table)) = found.map(|found| found.value.item()) else {
        return Err("the scene file has no table [camera] that can be read".to_owned());
    };
    let mut edits = Edits { text, table, replaced: Vec::new(), added: Vec::new() };
    edits.camera(wanted);
    let new = edits.applied();
    let is_right = camera_of(&Source::file(new.as_str().into())).is_some_and(|new| new.is_nearly(wanted));
    is_right
        .then_some(new)
        .ok_or_else(|| "the table [camera] is written in a way that glimt cannot change".to_owned())
}

/// Edits of a table.
struct Edits<'t> {
    text: &'t str,
    table: Entries<'t>,
    replaced: Vec<(Range<usize>, String)>,
    /// Keys that are not there yet, with their values.
    added: Vec<String>,
}

impl Edits<'_> {
    fn camera(&mut self, wanted: &Viewpoint) {
        let Viewpoint { pose: Pose { position, look_at, up }, fov, aperture, focus } = *wanted;
        match self.table.get("orbiter") {
            Some(orbiter) => {
                let place = [("position", position), ("look_at", look_at)];
                let lines = place.map(|(name, vector)| format!("{name} = {}", array(vector)));
                let both = lines.join(&self.between(&orbiter));
                self.replaced.push((orbiter.span.start..orbiter.value.span().end, both));
            }
            None => {
                self.vector("position", position, None);
                self.vector("look_at", look_at, None);
            }
        }
        self.vector("up", up, Some(DVec3::Y));
        self.number("fov", fov, FOV_DEGREES);
        self.number("aperture", aperture, 0.0);
        match self.table.get("focus") {
            // The steps of a camera round its distance a little.
            Some(given) if wanted.is_focused_on_look_at() && is_near(&given.value, focus) => {}
            Some(_) | None => self.number("focus", focus, wanted.pose.distance()),
        }
    }

    fn number(&mut self, name: &str, wanted: f64, default: f64) {
        match self.table.get(name) {
            Some(found) => self.replace(&found.value, wanted),
            None if wanted != default => self.added.push(format!("{name} = {}", number(wanted))),
            None => {}
        }
    }

    fn vector(&mut self, name: &str, wanted: DVec3, default: Option<DVec3>) {
        match self.table.get(name) {
            Some(found) => match found.value.array() {
                Some(elements) if elements.len() == 3 => {
                    for (element, wanted) in elements.iter().zip(wanted.to_array()) {
                        self.replace(&element, wanted);
                    }
                }
                Some(_) | None => self.replaced.push((found.value.span(), array(wanted))),
            },
            None if Some(wanted) != default => self.added.push(format!("{name} = {}", array(wanted))),
            None => {}
        }
    }

    /// A number that is the same already stays as it is written.
    fn replace(&mut self, found: &Value<'_>, wanted: f64) {
        let is_same = match found.item() {
            Item::Integer { digits, radix: 10 } | Item::Float(digits) => digits.parse() == Ok(wanted),
            Item::Integer { .. }
            | Item::String(_)
            | Item::Boolean(_)
            | Item::Datetime
            | Item::Array(_)
            | Item::Table(_) => false,
        };
        if !is_same {
            self.replaced.push((found.span(), number(wanted)));
        }
    }

    /// Text before a key in its line.
    fn indent(&self, key: &KeyValue<'_>) -> &str {
        let line = self.text[..key.span.start].rfind('\n').map_or(0, |end| end + 1);
        &self.text[line..key.span.start]
    }

    /// Whether a key has a line of its own, also `camera.key`.
    fn has_line(&self, key: &KeyValue<'_>) -> bool {
        let indent = self.indent(key).trim();
        indent.is_empty() || indent.ends_with('.')
    }

    /// Text between a key with its value and the next key.
    fn between(&self, key: &KeyValue<'_>) -> String {
        if self.has_line(key) {
            format!("{}{}", self.line_end(key), self.indent(key))
        } else {
            ", ".to_owned()
        }
    }

    /// Line ending after this key; that of the line before, if this line is the last and has none.
    fn line_end(&self, key: &KeyValue<'_>) -> &'static str {
        let (before, after) = self.text.split_at(key.value.span().end);
        let (line, _) = after.split_once('\n').or_else(|| before.rsplit_once('\n')).unwrap_or_default();
        if line.ends_with('\r') { "\r\n" } else { "\n" }
    }

    fn applied(mut self) -> String {
        if let Some(last) = self.table.iter().max_by_key(|entry| entry.value.span().end)
            && !self.added.is_empty()
        {
            let between = self.between(&last);
            let end = last.value.span().end;
            // Behind the comment of the line.
            let line = self.text[end..].find('\n').map_or(self.text.len(), |at| end + at);
            let at = if self.has_line(&last) { self.text[..line].trim_end_matches('\r').len() } else { end };
            let added = self.added.iter().map(|one| format!("{between}{one}")).collect();
            self.replaced.push((at..at, added));
        }
        self.replaced.sort_by_key(|(range, _)| range.start);
        let (mut new, mut done) = (String::new(), 0);
        for (range, text) in &self.replaced {
            new.push_str(&self.text[done..range.start]);
            new.push_str(text);
            done = range.end;
        }
        new + &self.text[done..]
    }
}

/// Whether a value is a distance that rounding may make of this one.
fn is_near(value: &Value<'_>, distance: f64) -> bool {
    let given: Option<f64> = match value.item() {
        Item::Integer { digits, radix: 10 } | Item::Float(digits) => digits.parse().ok(),
        Item::Integer { .. }
        | Item::String(_)
        | Item::Boolean(_)
        | Item::Datetime
        | Item::Array(_)
        | Item::Table(_) => None,
    };
    given.is_some_and(|given| is_same_distance(given, distance))
}

fn array(vector: DVec3) -> String {
    format!("[{}]", vector.to_array().map(number).join(", "))
}

/// In digits alone; no zero has a sign.
fn number(number: f64) -> String {
    (number + 0.0).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(position: [f64; 3]) -> Viewpoint {
        let pose = Pose { position: DVec3::from_array(position), look_at: DVec3::Y, up: DVec3::Y };
        Viewpoint { pose, fov: 40.0, aperture: 0.0, focus: pose.distance() }
    }

    fn written(text: &str, wanted: &Viewpoint) -> String {
        with_camera(text, wanted).unwrap_or_else(|why| panic!("{why}\n{text}"))
    }

    #[test]
    fn only_the_numbers_change() {
        let text = "# a\n[camera] # eye\n\tposition = [ 0.0, 1, # up\n 4_0.0 ] # far\n\n  look_at=[0,1,0]\n[render]\nwidth=4\n";
        let expected = text.replace("0.0, 1,", "0.5, 1,").replace("4_0.0", "-3.25");
        assert_eq!(written(text, &view([0.5, 1.0, -3.25])), expected);
        assert_eq!(written(&expected, &view([0.5, 1.0, -3.25])), expected, "nothing to change");
    }

    #[test]
    fn what_is_not_there_is_added_behind_the_last_key() {
        let wanted = Viewpoint { fov: 35.5, focus: 2.5, ..view([0.0, 1.0, 4.0]) };
        let camera = "position = [0, 1, 4]\nlook_at = [0, 1, 0]";
        for (text, expected) in [
            (
                format!("[camera]\n{camera} # the middle\n\n# next\n[render]\n"),
                format!("[camera]\n{camera} # the middle\nfov = 35.5\nfocus = 2.5\n\n# next\n[render]\n"),
            ),
            (format!("[camera]\n{camera}"), format!("[camera]\n{camera}\nfov = 35.5\nfocus = 2.5")),
            (
                format!("[camera]\n{camera}\n").replace('\n', "\r\n"),
                format!("[camera]\n{camera}\nfov = 35.5\nfocus = 2.5\n").replace('\n', "\r\n"),
            ),
            (
                "camera = { position = [0, 1, 4], look_at = [0, 1, 0] } # one line\n".to_owned(),
                "camera = { position = [0, 1, 4], look_at = [0, 1, 0], fov = 35.5, focus = 2.5 } # one line\n".to_owned(),
            ),
            (
                "camera.position = [0, 1, 4]\ncamera.look_at = [0, 1, 0]\n".to_owned(),
                "camera.position = [0, 1, 4]\ncamera.look_at = [0, 1, 0]\ncamera.fov = 35.5\ncamera.focus = 2.5\n"
                    .to_owned(),
            ),
        ] {
            assert_eq!(written(&text, &wanted), expected);
        }
    }

    #[test]
    fn an_added_key_ends_its_line_as_its_neighbour_does() {
        let wanted = Viewpoint { fov: 35.5, ..view([0.0, 1.0, 4.0]) };
        // One line of the file ends otherwise than the camera's.
        for (first, end) in [("\r\n", "\n"), ("\n", "\r\n")] {
            let text = format!("# a{first}[camera]{end}position = [0, 1, 4]{end}look_at = [0, 1, 0]");
            assert_eq!(written(&text, &wanted), format!("{text}{end}fov = 35.5"), "at the end of the file");
            let text = format!("{text}{end}[render]{first}");
            let expected = text.replace("[0, 1, 0]", &format!("[0, 1, 0]{end}fov = 35.5"));
            assert_eq!(written(&text, &wanted), expected);
        }
    }

    #[test]
    fn a_distance_that_rounding_changes_stays_as_it_is_written() {
        let text = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\nfocus = 4\n";
        let orbited = view([2.8283, 1.0, 2.8285]);
        assert!(orbited.focus != 4.0 && (orbited.focus - 4.0).abs() < 1e-3);
        assert_eq!(written(text, &orbited), text.replace("[0, 1, 4]", "[2.8283, 1, 2.8285]"));
        let nearer = view([0.0, 1.0, 3.8]);
        assert!(written(text, &nearer).contains("focus = 3.8"), "a step towards it is no rounding");
    }

    #[test]
    fn an_orbiter_becomes_vectors() {
        let wanted = Viewpoint { aperture: 0.1, focus: 3.0, ..view([0.0, 1.0, 4.0]) };
        let text = "[camera]\n  aperture = 0.1\n  orbiter = \"a.txt\" # from gKit\n  focus = 3.0\n";
        let expected = text.replace("orbiter = \"a.txt\"", "position = [0, 1, 4]\n  look_at = [0, 1, 0]");
        assert_eq!(written(text, &wanted), expected);
        let inline = "camera = { orbiter = \"a.txt\" }\n";
        let upright = Viewpoint { fov: 45.0, ..view([0.0, 1.0, 4.0]) };
        assert_eq!(
            written(inline, &upright),
            "camera = { position = [0, 1, 4], look_at = [0, 1, 0], fov = 45 }\n"
        );
    }

    #[test]
    fn what_cannot_be_changed_is_refused() {
        for text in ["", "[render]\nwidth = 4\n", "[camera]\nposition = [0, 1, 4\n", "camera = 3\n"] {
            assert!(with_camera(text, &view([0.0, 1.0, 4.0])).is_err(), "{text}");
        }
    }

    /// Comments and empty lines, written for persons, with the number of lines with keys between them.
    fn words(text: &str) -> Vec<String> {
        let comment = |line: &str| line.split_once('#').map(|(_, words)| words.to_owned());
        text.lines()
            .filter(|line| line.trim().is_empty() || line.contains('#'))
            .map(|line| comment(line).unwrap_or_default())
            .collect()
    }

    #[test]
    fn every_bundled_scene_keeps_its_words() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
        let paths: Vec<_> =
            std::fs::read_dir(folder).expect("scenes").map(|entry| entry.expect("a file").path()).collect();
        assert!(paths.len() > 15);
        for path in paths.iter().filter(|path| path.extension().is_some_and(|ending| ending == "toml")) {
            let text = std::fs::read_to_string(path).expect("a scene");
            let wanted = Viewpoint { fov: 33.3, focus: 2.25, ..view([0.125, -2.0, 3.5]) };
            let new = written(&text, &wanted);
            assert_eq!(words(&new), words(&text), "{}", path.display());
            let is_camera = |line: &str| {
                let key = line.split('=').next().unwrap_or_default().trim();
                ["position", "look_at", "up", "fov", "aperture", "focus", "orbiter"].contains(&key)
            };
            let others = |text: &str| -> Vec<String> {
                text.lines().filter(|line| !is_camera(line)).map(str::to_owned).collect()
            };
            // Those of lights and others have such keys too: the camera's alone may differ.
            assert_eq!(others(&new), others(&text), "{}", path.display());
            let changed = text.lines().filter(|line| !new.lines().any(|other| other == *line)).count();
            assert!(changed <= 6, "{}: {changed} lines", path.display());
            assert_eq!(written(&new, &wanted), new);
        }
    }
}
