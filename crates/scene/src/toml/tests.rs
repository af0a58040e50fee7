//! Compares values, spans, errors and recovery with the `toml` crate.

use ::toml::de::{DeTable, DeValue};
use proptest::prelude::*;

use super::*;

/// Formats errors as the `toml` crate does.
fn errors(errors: &[SyntaxError]) -> Vec<(std::ops::Range<usize>, String)> {
    let message = |error: &SyntaxError| match &error.expected {
        Some(expected) => format!("{}, expected {expected}", error.what),
        None => error.what.clone(),
    };
    errors.iter().map(|error| (error.span.clone(), message(error))).collect()
}

#[track_caller]
fn assert_same_table(text: &str, ours: Entries<'_>, theirs: &DeTable<'_>) {
    let our_keys: Vec<_> = ours.iter().map(|one| (one.key.to_owned(), one.span)).collect();
    let their_keys: Vec<_> =
        theirs.iter().map(|(key, _)| (key.get_ref().clone().into_owned(), key.span())).collect();
    assert_eq!(our_keys, their_keys, "keys in {text:?}");
    for (one, (key, value)) in ours.iter().zip(theirs) {
        assert_eq!(ours.get(one.key).map(|found| found.value.span()), Some(one.value.span()), "{text:?}");
        assert_eq!(one.value.span(), value.span(), "{key:?} in {text:?}");
        assert_same_value(text, one.value, value.get_ref());
    }
}

#[track_caller]
fn assert_same_value(text: &str, ours: Value<'_>, theirs: &DeValue<'_>) {
    match (ours.decode(), theirs) {
        (TomlValue::String(ours), DeValue::String(theirs)) => assert_eq!(ours, theirs, "{text:?}"),
        (TomlValue::Number(Number::Integer { digits, radix }), DeValue::Integer(theirs)) => {
            assert_eq!((digits, radix), (theirs.as_str(), theirs.radix()), "{text:?}");
        }
        (TomlValue::Number(Number::Float(ours)), DeValue::Float(theirs)) => {
            assert_eq!(ours, theirs.as_str(), "{text:?}");
        }
        (TomlValue::Boolean(ours), DeValue::Boolean(theirs)) => assert_eq!(ours, *theirs, "{text:?}"),
        (TomlValue::Datetime, DeValue::Datetime(_)) => {}
        (TomlValue::Array(ours), DeValue::Array(theirs)) => {
            assert_eq!(ours.len(), theirs.len(), "{text:?}");
            for (one, other) in ours.iter().zip(theirs) {
                assert_eq!(one.span(), other.span(), "{text:?}");
                assert_same_value(text, one, other.get_ref());
            }
        }
        (TomlValue::Table(ours), DeValue::Table(theirs)) => assert_same_table(text, ours, theirs),
        (ours, theirs) => panic!("got {ours:?}, expected {theirs:?} in {text:?}"),
    }
}

/// Parses a text and compares the result with the `toml` crate. Returns whether the text is valid.
#[track_caller]
fn assert_same(text: &str) -> bool {
    let (theirs, their_errors) = DeTable::parse_recoverable(text);
    let (ours, our_errors) = parse(text);
    let their_errors: Vec<_> = their_errors
        .iter()
        .map(|error| (error.span().unwrap_or_default(), error.message().to_owned()))
        .collect();
    let our_found = errors(&our_errors).into_iter().map(|(span, message)| {
        // The crate reports no span for keys with too many parts.
        let is_placed = message != "recursion limit" || their_errors.iter().any(|(other, _)| *other == span);
        (if is_placed { span } else { 0..0 }, message)
    });
    assert_eq!(our_found.collect::<Vec<_>>(), their_errors, "{text:?}");
    assert_same_table(text, ours.root(), theirs.get_ref());
    our_errors.is_empty()
}

const VALUES: [&str; 60] = [
    "1",
    "-1",
    "+0",
    "-0.0",
    "0.5",
    "5.",
    ".5",
    "1e3",
    "1E-3",
    "1e+30",
    "1e",
    "1_000",
    "1__0",
    "_1",
    "0x1F",
    "0xg",
    "0o17",
    "0b101",
    "0X1",
    "-0x1",
    "00",
    "01.5",
    "1e999",
    "9999999999999999999999",
    "inf",
    "-inf",
    "nan",
    "+nan",
    "Inf",
    "true",
    "false",
    "True",
    "tru",
    "word",
    "\"text\"",
    "\"\"",
    "\"\"\"\"",
    "\"\\u00e9\\n\\\"\"",
    "\"\\q\"",
    "\"open",
    "'raw\\'",
    "''",
    "'''\nlines\r\n'''",
    "\"\"\"\nlines \\\n   joined\"\"\"",
    "\"tab\t\"",
    "\"\u{7f}\"",
    "\"木\"",
    "1979-05-27",
    "1979-05-27T07:32:00Z",
    "1979-05-27 07:32:00.5+01:00",
    "07:32:00",
    "1979-13-45",
    "[]",
    "[1, 2.5, \"a\", 'b', true]",
    "[1 2]",
    "[1,]",
    "[,]",
    "{}",
    "{ a = 1, b.c = 2 }",
    "",
];

const LINES: [&str; 47] = [
    "",
    "   ",
    "# comment",
    "# 木\t\u{1b}",
    "[a]",
    "[a.b]",
    "[a.b.c]",
    "[[a]]",
    "[[a.b]]",
    "[b]",
    "[[b]]",
    "[ a . b ]",
    "['a'.\"b\"]",
    "[a",
    "[[a]",
    "[a]]",
    "[]",
    "[.a]",
    "[a.]",
    "[a] # comment",
    "[a] b",
    "a",
    "a =",
    "= 1",
    "a = = 1",
    "a == 1",
    "a.b",
    "a..b = 1",
    ".a = 1",
    "a. = 1",
    "a = [1,\n2,\n3]",
    "a = [\n[1], # one\n[2]\n]",
    "a = [",
    "]",
    "}",
    "{",
    ",",
    "a = { b = 1,\n c = 2 }",
    "a = { b",
    "a = { b = }",
    "a = { [ { ] }",
    "a = { { } b = 1 }",
    "a = [ } ]",
    "a = [ { ] } ]",
    "a = 1 [",
    "\u{feff}a = 1",
    "\r",
];

const KEYS: [&str; 14] = [
    "a",
    "b",
    "a.b",
    "a.b.c",
    "b.a",
    "a . b",
    "\"a\"",
    "'b'",
    "\"\\u0061\"",
    "\"\"\"a\"\"\"",
    "a-b_1",
    "ä",
    "1",
    "a.\"b.c\"",
];

/// Generates random lines, which may conflict with each other.
fn line() -> impl Strategy<Value = String> {
    let value = prop::sample::select(&VALUES[..]);
    let key = prop::sample::select(&KEYS[..]);
    let inner = prop::collection::vec((key.clone(), value.clone()), 0..4).prop_map(|entries| {
        let entries: Vec<_> = entries.iter().map(|(key, value)| format!("{key} = {value}")).collect();
        format!("{{ {} }}", entries.join(", "))
    });
    let array =
        prop::collection::vec(value.clone(), 0..4).prop_map(|values| format!("[{}]", values.join(", ")));
    prop_oneof![
        3 => (key.clone(), value).prop_map(|(key, value)| format!("{key} = {value}")),
        1 => (key.clone(), inner).prop_map(|(key, value)| format!("{key} = {value}")),
        1 => (key, array).prop_map(|(key, value)| format!("{key}={value} # comment")),
        3 => prop::sample::select(&LINES[..]).prop_map(str::to_owned),
        1 => "[\\[\\]{}=,.#\"'\\\\\n\r\t 0-9a-c_-]{0,12}",
    ]
}

fn lines() -> impl Strategy<Value = String> {
    let end = prop::sample::select(vec!["\n", "\n", "\n", "\r\n", "\n\n", "\r"]);
    (any::<bool>(), prop::collection::vec((line(), end), 0..12)).prop_map(|(has_mark, lines)| {
        let text: String = lines.into_iter().map(|(line, end)| line + end).collect();
        if has_mark && text.len().is_multiple_of(5) { format!("{MARK}{text}") } else { text }
    })
}

#[test]
fn single_lines_and_pairs_match_the_crate() {
    let mut valid = 0;
    let all: Vec<String> = LINES
        .iter()
        .map(|line| (*line).to_owned())
        .chain(VALUES.iter().map(|value| format!("a = {value}")))
        .chain(KEYS.iter().map(|key| format!("{key} = 1")))
        .collect();
    for first in &all {
        valid += usize::from(assert_same(first));
        for second in &all {
            valid += usize::from(assert_same(&format!("{first}\n{second}\n")));
        }
    }
    assert!(valid > 1_000, "{valid}");
}

#[test]
fn brackets_in_any_order_match_the_crate() {
    // Insert every sequence of six of these parts into an expression. Other expressions follow it.
    let parts = ["[", "]", "{", "}", ",", "\n", "b=", "1 "];
    for number in 0..parts.len().pow(6) {
        let mut rest = number;
        let middle: String = (0..6)
            .map(|_| {
                let part = parts[rest % parts.len()];
                rest /= parts.len();
                part
            })
            .collect();
        assert_same(&format!("a = {middle}\nc = 2\n[d]\ne = 3\n"));
    }
}

#[test]
fn scenes_match_the_crate() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut count = 0;
    for part in ["../../scenes", "../../tests/broken", "src"] {
        for entry in std::fs::read_dir(folder.join(part)).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.extension().is_some_and(|ending| ending == "toml") {
                assert_same(&std::fs::read_to_string(&path).expect("text"));
                count += 1;
            }
        }
    }
    assert!(count > 40, "{count}");
}

#[test]
fn large_tables_match_the_crate() {
    let text: String =
        (0..100).map(|number| format!("[t.k{number}.\"x\\u0020y\"]\nv = {number}\n")).collect();
    let again: String = (0..100).map(|number| format!("[t.k{number}]\nw = {number}\n")).collect();
    let more: String = (0..50).map(|number| format!("\"a{number}\\u0062\" = 1\na{number}b = 2\n")).collect();
    assert!(assert_same(&format!("{text}{again}")));
    assert!(!assert_same(&format!("{text}{again}{again}[u]\n{more}")));
}

#[test]
fn overlong_keys_are_reported_with_their_span() {
    let text = |parts: usize| format!("\n[x]\n{}a = 1\n", "a.".repeat(parts - 1));
    assert!(assert_same(&text(80)));
    let long = text(81);
    let (_, errors) = parse(&long);
    let [SyntaxError { span, what, .. }] = errors.try_into().expect("one error");
    assert_eq!((&long[span], what.as_str()), (format!("{}a", "a.".repeat(80)).as_str(), "recursion limit"));
}

#[test]
fn spheres_take_at_most_200_bytes() {
    let sphere = "\n[[sphere]]\ncenter = [1.5, -2, 3e1] # somewhere\nradius = 0.5\nmaterial = \"red\"\n";
    let text = sphere.repeat(1_000);
    let (document, errors) = parse(&text);
    assert_eq!(errors, []);
    assert!(document.memory_bytes() <= 200 * 1_000, "{} bytes", document.memory_bytes());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4_000))]

    #[test]
    fn fuzzed_lines_match_the_crate(text in lines()) {
        assert_same(&text);
    }

    #[test]
    fn fuzzed_scenes_match_the_crate(
        changes in prop::collection::vec((any::<prop::sample::Index>(), 0_usize..12, line()), 1..5),
    ) {
        let mut text: Vec<char> = super::super::starter_scene().chars().collect();
        for (at, removed, inserted) in changes {
            let at = at.index(text.len() + 1);
            let end = (at + removed).min(text.len());
            text.splice(at..end, inserted.chars());
        }
        assert_same(&text.into_iter().collect::<String>());
    }
}
