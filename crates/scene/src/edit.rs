//! Writes a camera into a scene's source text without changing comments or formatting.

use std::ops::Range;

use super::description::{Camera, Pose, ResolvedCamera, is_same_distance};
use super::document::parse_camera;
use super::source::SceneText;
use super::toml::{self, Entries, KeyValue, Number, Value};
use crate::choice::Choice;
use crate::math::DVec3;

/// Returns a scene's source text with the camera replaced by `wanted`.
///
/// # Errors
/// Returns the reason why the `[camera]` table cannot be edited.
pub(super) fn replace_camera(text: &str, wanted: &ResolvedCamera) -> Result<String, String> {
    let (document, errors) = toml::parse(text);
    let found = document.root().get("camera").filter(|_| errors.is_empty());
    let Some(table) = found.and_then(|found| found.value.as_table()) else {
        return Err("the scene file has no readable [camera] table".to_owned());
    };
    let mut edits = CameraEdits { text, table, replaced: Vec::new(), added: Vec::new() };
    edits.set_camera(wanted);
    let new = edits.apply();
    let is_right = parse_camera(&SceneText::from_file_text(new.as_str().into()))
        .is_some_and(|new| new.is_nearly_equal_to_view(wanted));
    is_right.then_some(new).ok_or_else(|| "glimt cannot edit the [camera] table in this form".to_owned())
}

/// Pending edits to the `[camera]` table.
struct CameraEdits<'t> {
    text: &'t str,
    table: Entries<'t>,
    replaced: Vec<(Range<usize>, String)>,
    /// New `key = value` lines.
    added: Vec<String>,
}

impl CameraEdits<'_> {
    fn set_camera(&mut self, wanted: &ResolvedCamera) {
        let ResolvedCamera { pose: Pose { position, look_at, up }, projection, window, aperture, focus } =
            *wanted;
        // Read the defaults from the definitions of the keys. The required keys have arbitrary values.
        let with_defaults = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]";
        let default = match parse_camera(&SceneText::from_file_text(with_defaults.into())) {
            Some(Camera::LookAt { up, projection, window, aperture, .. }) => {
                (up, projection, window, aperture)
            }
            Some(Camera::Orbiter { .. }) | None => return,
        };
        match self.table.get("orbiter") {
            Some(orbiter) => {
                let place = [("position", position), ("look_at", look_at)];
                let lines =
                    place.map(|(name, vector)| format!("{name} = {}", format_numbers(&vector.to_array())));
                let both = lines.join(&self.separator_after(&orbiter));
                self.replaced.push((orbiter.span.start..orbiter.value.span().end, both));
            }
            None => {
                self.set_vector("position", position, None);
                self.set_vector("look_at", look_at, None);
            }
        }
        self.set_vector("up", up, Some(default.0));
        self.set_word("projection", projection.kind().name(), default.1.kind().name());
        if let Some(fov) = projection.fov() {
            self.set_number("fov", fov, default.1.fov());
        }
        if let Some(height) = projection.view_height() {
            self.set_number("view_height", height, None);
        }
        self.set_numbers("shift", &window.shift.to_array(), Some(&default.2.shift.to_array()));
        self.set_flag("mirror", window.mirror, default.2.mirror);
        self.set_number("aperture", aperture, Some(default.3));
        match self.table.get("focus") {
            // Ignore rounding errors in the distance while orbiting.
            Some(given)
                if wanted.is_focused_on_look_at() && is_nearly_equal_distance(&given.value, focus) => {}
            Some(_) | None => self.set_number("focus", focus, Some(wanted.pose.distance())),
        }
    }

    fn set_number(&mut self, name: &str, wanted: f64, default: Option<f64>) {
        match self.table.get(name) {
            Some(found) => self.replace_number(&found.value, wanted),
            None if Some(wanted) != default => self.added.push(format!("{name} = {}", format_number(wanted))),
            None => {}
        }
    }

    fn set_word(&mut self, name: &str, wanted: &str, default: &str) {
        match self.table.get(name).map(|found| (found.value.as_str(), found.value.span())) {
            Some((Some(word), _)) if word == wanted => {}
            Some((_, span)) => self.replaced.push((span, format!("\"{wanted}\""))),
            None if wanted != default => self.added.push(format!("{name} = \"{wanted}\"")),
            None => {}
        }
    }

    fn set_flag(&mut self, name: &str, wanted: bool, default: bool) {
        match self.table.get(name) {
            Some(found) => self.replaced.push((found.value.span(), wanted.to_string())),
            None if wanted != default => self.added.push(format!("{name} = {wanted}")),
            None => {}
        }
    }

    fn set_vector(&mut self, name: &str, wanted: DVec3, default: Option<DVec3>) {
        self.set_numbers(
            name,
            &wanted.to_array(),
            default.map(|it| it.to_array()).as_ref().map(|it| &it[..]),
        );
    }

    fn set_numbers(&mut self, name: &str, wanted: &[f64], default: Option<&[f64]>) {
        match self.table.get(name) {
            Some(found) => match found.value.as_array() {
                Some(elements) if elements.len() == wanted.len() => {
                    for (element, wanted) in elements.iter().zip(wanted) {
                        self.replace_number(&element, *wanted);
                    }
                }
                Some(_) | None => self.replaced.push((found.value.span(), format_numbers(wanted))),
            },
            None if Some(wanted) != default => {
                self.added.push(format!("{name} = {}", format_numbers(wanted)));
            }
            None => {}
        }
    }

    /// Replaces a number unless it already equals `wanted`.
    fn replace_number(&mut self, found: &Value<'_>, wanted: f64) {
        if found.as_number().and_then(Number::to_f64) != Some(wanted) {
            self.replaced.push((found.span(), format_number(wanted)));
        }
    }

    /// Returns the text before a key on the same line.
    fn text_before_key_on_line(&self, key: &KeyValue<'_>) -> &str {
        let line = self.text[..key.span.start].rfind('\n').map_or(0, |end| end + 1);
        &self.text[line..key.span.start]
    }

    /// Whether a key is the first on its line, possibly in the form `camera.key`.
    fn is_first_key_on_line(&self, key: &KeyValue<'_>) -> bool {
        let indent = self.text_before_key_on_line(key).trim();
        indent.is_empty() || indent.ends_with('.')
    }

    /// Returns the separator between this entry and the next one.
    fn separator_after(&self, key: &KeyValue<'_>) -> String {
        if self.is_first_key_on_line(key) {
            format!("{}{}", self.line_ending_after(key), self.text_before_key_on_line(key))
        } else {
            ", ".to_owned()
        }
    }

    /// Returns the line ending after this entry. If the entry is on an unterminated last line, returns the
    /// line ending of the previous line.
    fn line_ending_after(&self, key: &KeyValue<'_>) -> &'static str {
        let (before, after) = self.text.split_at(key.value.span().end);
        let (line, _) = after.split_once('\n').or_else(|| before.rsplit_once('\n')).unwrap_or_default();
        if line.ends_with('\r') { "\r\n" } else { "\n" }
    }

    fn apply(mut self) -> String {
        if let Some(last) = self.table.iter().max_by_key(|entry| entry.value.span().end)
            && !self.added.is_empty()
        {
            let between = self.separator_after(&last);
            let end = last.value.span().end;
            // Insert after the line's comment.
            let line = self.text[end..].find('\n').map_or(self.text.len(), |at| end + at);
            let at = if self.is_first_key_on_line(&last) {
                self.text[..line].trim_end_matches('\r').len()
            } else {
                end
            };
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

/// Whether a value equals `distance` up to rounding.
fn is_nearly_equal_distance(value: &Value<'_>, distance: f64) -> bool {
    value.as_number().and_then(Number::to_f64).is_some_and(|given| is_same_distance(given, distance))
}

fn format_numbers(numbers: &[f64]) -> String {
    format!("[{}]", numbers.iter().copied().map(format_number).collect::<Vec<_>>().join(", "))
}

/// Formats a number as TOML: decimal digits without an exponent, and 0 instead of -0.
fn format_number(number: f64) -> String {
    (number + 0.0).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::description::{ImageShiftAndMirror, Projection};
    use crate::math::DVec2;

    fn view(position: [f64; 3]) -> ResolvedCamera {
        let pose = Pose { position: DVec3::from_array(position), look_at: DVec3::Y, up: DVec3::Y };
        ResolvedCamera {
            pose,
            projection: Projection::Perspective { fov: 40.0 },
            window: ImageShiftAndMirror::default(),
            aperture: 0.0,
            focus: pose.distance(),
        }
    }

    fn written(text: &str, wanted: &ResolvedCamera) -> String {
        replace_camera(text, wanted).unwrap_or_else(|why| panic!("{why}\n{text}"))
    }

    #[test]
    fn only_numbers_change() {
        let text = "# a\n[camera] # eye\n\tposition = [ 0.0, 1, # up\n 4_0.0 ] # far\n\n  look_at=[0,1,0]\n[render]\nwidth=4\n";
        let expected = text.replace("0.0, 1,", "0.5, 1,").replace("4_0.0", "-3.25");
        assert_eq!(written(text, &view([0.5, 1.0, -3.25])), expected);
        assert_eq!(written(&expected, &view([0.5, 1.0, -3.25])), expected, "camera unchanged");
    }

    #[test]
    fn missing_keys_are_added_after_the_last_key() {
        let wanted = ResolvedCamera {
            projection: Projection::Perspective { fov: 35.5 },
            focus: 2.5,
            ..view([0.0, 1.0, 4.0])
        };
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
    fn added_keys_use_the_same_line_ending() {
        let wanted =
            ResolvedCamera { projection: Projection::Perspective { fov: 35.5 }, ..view([0.0, 1.0, 4.0]) };
        // The first line and the lines of the camera table have different line endings.
        for (first, end) in [("\r\n", "\n"), ("\n", "\r\n")] {
            let text = format!("# a{first}[camera]{end}position = [0, 1, 4]{end}look_at = [0, 1, 0]");
            assert_eq!(written(&text, &wanted), format!("{text}{end}fov = 35.5"), "at the end of the file");
            let text = format!("{text}{end}[render]{first}");
            let expected = text.replace("[0, 1, 0]", &format!("[0, 1, 0]{end}fov = 35.5"));
            assert_eq!(written(&text, &wanted), expected);
        }
    }

    #[test]
    fn orbiting_does_not_change_the_focus() {
        let text = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\nfocus = 4\n";
        let orbited = view([2.8283, 1.0, 2.8285]);
        assert!(orbited.focus != 4.0 && (orbited.focus - 4.0).abs() < 1e-3);
        assert_eq!(written(text, &orbited), text.replace("[0, 1, 4]", "[2.8283, 1, 2.8285]"));
        let nearer = view([0.0, 1.0, 3.8]);
        assert!(written(text, &nearer).contains("focus = 3.8"), "moving closer changes the focus");
    }

    #[test]
    fn orbiter_is_replaced_by_vectors() {
        let wanted = ResolvedCamera { aperture: 0.1, focus: 3.0, ..view([0.0, 1.0, 4.0]) };
        let text = "[camera]\n  aperture = 0.1\n  orbiter = \"a.txt\" # from gKit\n  focus = 3.0\n";
        let expected = text.replace("orbiter = \"a.txt\"", "position = [0, 1, 4]\n  look_at = [0, 1, 0]");
        assert_eq!(written(text, &wanted), expected);
        let inline = "camera = { orbiter = \"a.txt\" }\n";
        let upright =
            ResolvedCamera { projection: Projection::Perspective { fov: 45.0 }, ..view([0.0, 1.0, 4.0]) };
        assert_eq!(
            written(inline, &upright),
            "camera = { position = [0, 1, 4], look_at = [0, 1, 0], fov = 45 }\n"
        );
    }

    #[test]
    fn projections_are_written() {
        let window = ImageShiftAndMirror { shift: DVec2::new(0.25, 0.0), mirror: true };
        let projection = Projection::Orthographic { view_height: 2.5 };
        let wanted = ResolvedCamera { projection, window, ..view([0.0, 1.0, 4.0]) };
        let text = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n";
        let more = "projection = \"orthographic\"\nview_height = 2.5\nshift = [0.25, 0]\nmirror = true\n";
        let new = written(text, &wanted);
        assert_eq!(new, format!("{text}{more}"));
        let wider = Projection::Orthographic { view_height: 3.0 };
        let wider = ResolvedCamera { projection: wider, ..wanted };
        assert_eq!(written(&new, &wider), new.replace("2.5", "3"));
        // A `fov` left in the file would conflict with the projection.
        assert!(replace_camera(&format!("{text}fov = 30\n"), &wanted).is_err());
        let round =
            ResolvedCamera { projection: Projection::Fisheye { fov: 200.0 }, ..view([0.0, 1.0, 4.0]) };
        assert_eq!(written(text, &round), format!("{text}projection = \"fisheye\"\nfov = 200\n"));
    }

    #[test]
    fn uneditable_cameras_are_rejected() {
        for text in ["", "[render]\nwidth = 4\n", "[camera]\nposition = [0, 1, 4\n", "camera = 3\n"] {
            assert!(replace_camera(text, &view([0.0, 1.0, 4.0])).is_err(), "{text}");
        }
    }

    /// Returns the comments in a text, and an empty string for each blank line.
    fn comments(text: &str) -> Vec<String> {
        let comment = |line: &str| line.split_once('#').map(|(_, words)| words.to_owned());
        text.lines()
            .filter(|line| line.trim().is_empty() || line.contains('#'))
            .map(|line| comment(line).unwrap_or_default())
            .collect()
    }

    #[test]
    fn bundled_scenes_keep_their_comments() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
        let paths: Vec<_> =
            std::fs::read_dir(folder).expect("scenes").map(|entry| entry.expect("a file").path()).collect();
        assert!(paths.len() > 15);
        for path in paths.iter().filter(|path| path.extension().is_some_and(|ending| ending == "toml")) {
            let text = std::fs::read_to_string(path).expect("a scene");
            let wanted = ResolvedCamera {
                projection: Projection::Perspective { fov: 33.3 },
                focus: 2.25,
                ..view([0.125, -2.0, 3.5])
            };
            let new = written(&text, &wanted);
            assert_eq!(comments(&new), comments(&text), "{}", path.display());
            let is_camera = |line: &str| {
                let key = line.split('=').next().unwrap_or_default().trim();
                ["position", "look_at", "up", "fov", "aperture", "focus", "orbiter"].contains(&key)
            };
            let others = |text: &str| -> Vec<String> {
                text.lines().filter(|line| !is_camera(line)).map(str::to_owned).collect()
            };
            // Only camera lines may differ. Lights and shapes have keys with the same names, which are not
            // compared.
            assert_eq!(others(&new), others(&text), "{}", path.display());
            let changed = text.lines().filter(|line| !new.lines().any(|other| other == *line)).count();
            assert!(changed <= 6, "{}: {changed} lines", path.display());
            assert_eq!(written(&new, &wanted), new);
        }
    }
}
