//! Changes of an edit in the text of a scene, in a few words: keys with their values before and after, else lines.

mod keys;

use super::sanitize::shortened;

/// Bytes of the longest text that is looked at: the answer is for a person who edits it.
pub const MOST_COMPARED_BYTES: usize = 4 << 20;

/// Characters of a line that are shown at most.
const MOST: usize = 40;

/// The changes between two texts, each in a form such as `sphere.ball.radius 0.5 → 0.7`, with the key as `--set` takes it. If no key
/// differs, or a text is not TOML, the result names the changed lines. Empty if the texts are the same or too long.
pub fn changes(before: &str, after: &str) -> Vec<String> {
    if before == after || before.len().max(after.len()) > MOST_COMPARED_BYTES {
        return Vec::new();
    }
    match keys::changes(before, after) {
        keys if keys.is_empty() => lines(before, after).into_iter().collect(),
        keys => keys,
    }
}

/// The difference in lines.
fn lines(before: &str, after: &str) -> Option<String> {
    let (before, after): (Vec<&str>, Vec<&str>) = (before.lines().collect(), after.lines().collect());
    // Leave out what both begin and end with.
    let same = |a: &[&str], b: &[&str]| a.iter().zip(b).take_while(|(a, b)| a == b).count();
    let start = same(&before, &after);
    let (before, after) = (&before[start..], &after[start..]);
    let end = before.iter().rev().zip(after.iter().rev()).take_while(|(a, b)| a == b).count();
    let (before, after) = (&before[..before.len() - end], &after[..after.len() - end]);
    // Say what is left.
    let line = start + 1;
    let lines = |count: usize| if count == 1 { "a line".to_owned() } else { format!("{count} lines") };
    match (before, after) {
        ([], []) => None,
        ([old], [new]) => Some(format!("line {line}: {}", one_line(old, new))),
        ([], [new]) => Some(format!("line {line}: + {}", shortened(new.trim(), MOST))),
        ([old], []) => Some(format!("line {line}: − {}", shortened(old.trim(), MOST))),
        ([], new) => Some(format!("{} more from line {line} on", lines(new.len()))),
        (old, []) => Some(format!("{} fewer from line {line} on", lines(old.len()))),
        (_, new) => Some(format!("lines {line} to {}", start + new.len())),
    }
}

/// A key is named once.
fn one_line(old: &str, new: &str) -> String {
    let parts = |line: &'_ str| {
        line.split_once('=').map(|(key, value)| (key.trim().to_owned(), value.trim().to_owned()))
    };
    match (parts(old), parts(new)) {
        (Some((key, old)), Some((same, new))) if key == same => {
            let of = |value: &str| shortened(value, MOST / 2);
            format!("{} {} → {}", shortened(&key, MOST / 2), of(&old), of(&new))
        }
        _ => format!("{} → {}", shortened(old.trim(), MOST / 2), shortened(new.trim(), MOST / 2)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edit_outside_of_keys_is_said_by_its_lines() {
        let text = "[sphere]\nradius = 0.5 # half\n# one\ncolor = 1\nlast = 2\n";
        let said = |from: &str, to: &str| changes(text, &text.replace(from, to)).pop();
        assert_eq!(said("x", "y"), None);
        assert_eq!(said("# one", "# two").as_deref(), Some("line 3: # one → # two"));
        assert_eq!(said("# one\n", "").as_deref(), Some("line 3: − # one"));
        assert_eq!(said("# one", "# one\n# new").as_deref(), Some("line 4: + # new"));
        assert_eq!(said("# one", "# one\n#\n#").as_deref(), Some("2 lines more from line 4 on"));
        assert_eq!(said("# half\n# one", "# 1\n# 2").as_deref(), Some("lines 2 to 3"));
        assert_eq!(said("0.5", "").as_deref(), Some("line 2: radius 0.5 # half → # half"), "no TOML");
        let evil = said("# one", "# \u{1b}[2J\u{202e}").expect("a change");
        assert!(!evil.chars().any(char::is_control) && !evil.contains('\u{202e}'), "{evil}");
    }
}
