//! Summarizes scene edits as a list of changed keys with their old and new values, or as a list of changed
//! lines.

mod keys;

use super::sanitize::escape_and_truncate;

/// Maximum size of scenes to compare, in bytes. Larger scenes are not edited by hand.
pub const MAX_COMPARED_BYTES: usize = 4 << 20;

/// Maximum number of characters shown per line.
const MAX_LINE_CHARS: usize = 40;

/// Lists the differences between two versions of a scene, such as `sphere.ball.radius 0.5 → 0.7`. Keys have
/// the same syntax as in `--set`. If no key differs or a version is not valid TOML, lists the changed lines
/// instead. Returns an empty list if the versions are equal or too large.
pub fn list_changes(before: &str, after: &str) -> Vec<String> {
    if before == after || before.len().max(after.len()) > MAX_COMPARED_BYTES {
        return Vec::new();
    }
    match keys::key_changes(before, after) {
        keys if keys.is_empty() => summarize_line_changes(before, after).into_iter().collect(),
        keys => keys,
    }
}

/// Returns a summary of the changed lines, or `None` if all lines are equal.
fn summarize_line_changes(before: &str, after: &str) -> Option<String> {
    let (before, after): (Vec<&str>, Vec<&str>) = (before.lines().collect(), after.lines().collect());
    // Strip the common prefix and suffix.
    let same = |a: &[&str], b: &[&str]| a.iter().zip(b).take_while(|(a, b)| a == b).count();
    let start = same(&before, &after);
    let (before, after) = (&before[start..], &after[start..]);
    let end = before.iter().rev().zip(after.iter().rev()).take_while(|(a, b)| a == b).count();
    let (before, after) = (&before[..before.len() - end], &after[..after.len() - end]);
    // Describe the remaining lines.
    let line = start + 1;
    let lines = |count: usize| if count == 1 { "1 line".to_owned() } else { format!("{count} lines") };
    match (before, after) {
        ([], []) => None,
        ([old], [new]) => Some(format!("line {line}: {}", describe_replaced_line(old, new))),
        ([], [new]) => Some(format!("line {line}: + {}", escape_and_truncate(new.trim(), MAX_LINE_CHARS))),
        ([old], []) => Some(format!("line {line}: − {}", escape_and_truncate(old.trim(), MAX_LINE_CHARS))),
        ([], new) => Some(format!("{} added at line {line}", lines(new.len()))),
        (old, []) => Some(format!("{} removed at line {line}", lines(old.len()))),
        (_, new) => Some(format!("lines {line} to {}", start + new.len())),
    }
}

/// Describes a change to one line. Shows the key only once if the old and the new line assign to the same
/// key.
fn describe_replaced_line(old: &str, new: &str) -> String {
    let parts = |line: &'_ str| {
        line.split_once('=').map(|(key, value)| (key.trim().to_owned(), value.trim().to_owned()))
    };
    match (parts(old), parts(new)) {
        (Some((key, old)), Some((same, new))) if key == same => {
            let of = |value: &str| escape_and_truncate(value, MAX_LINE_CHARS / 2);
            format!("{} {} → {}", escape_and_truncate(&key, MAX_LINE_CHARS / 2), of(&old), of(&new))
        }
        _ => format!(
            "{} → {}",
            escape_and_truncate(old.trim(), MAX_LINE_CHARS / 2),
            escape_and_truncate(new.trim(), MAX_LINE_CHARS / 2)
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_outside_keys_are_listed_by_line() {
        let text = "[sphere]\nradius = 0.5 # half\n# one\ncolor = 1\nlast = 2\n";
        let changed = |from: &str, to: &str| list_changes(text, &text.replace(from, to)).pop();
        assert_eq!(changed("x", "y"), None);
        assert_eq!(changed("# one", "# two").as_deref(), Some("line 3: # one → # two"));
        assert_eq!(changed("# one\n", "").as_deref(), Some("line 3: − # one"));
        assert_eq!(changed("# one", "# one\n# new").as_deref(), Some("line 4: + # new"));
        assert_eq!(changed("# one", "# one\n#\n#").as_deref(), Some("2 lines added at line 4"));
        assert_eq!(changed("# half\n# one", "# 1\n# 2").as_deref(), Some("lines 2 to 3"));
        assert_eq!(changed("0.5", "").as_deref(), Some("line 2: radius 0.5 # half → # half"), "not TOML");
        let evil = changed("# one", "# \u{1b}[2J\u{202e}").expect("a change");
        assert!(!evil.chars().any(char::is_control) && !evil.contains('\u{202e}'), "{evil}");
    }
}
