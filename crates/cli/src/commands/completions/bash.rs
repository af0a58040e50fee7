//! Bash completion with quoted candidates.
//!
//! Bash inserts candidates as they are, and `clap_complete`'s adapter does not quote them. A name such as
//! `$(…)` would then be executed when the command runs. This adapter receives the entire line, splits it into
//! words like bash but without expansions, and quotes the candidates.

use std::ffi::OsString;
use std::io::{Error, Write};
use std::path::Path;

use clap_complete::engine::complete;
use clap_complete::env::EnvCompleter;

use crate::args::candidates::store_command_line;

/// The script. Candidates replace `$2`, the text between the cursor and the last space, `=`, `:` or open
/// quote.
const SCRIPT: &str = r#"_glimt_complete() {
    local answer line space=true
    compopt +o nospace 2> /dev/null && space=false
    COMPREPLY=()
    answer=$(GLIMT_COMPLETE=bash "glimt" -- "${COMP_LINE:0:COMP_POINT}" "$2") || return
    # Candidates are quoted, one per line.
    while IFS= read -r line; do
        [[ -n $line ]] && COMPREPLY+=("$line")
    done <<< "$answer"
    if [[ $space == false && "${COMPREPLY-}" =~ [=/:]$ ]]; then
        compopt -o nospace
    fi
}
if [[ "${BASH_VERSINFO[0]}" -eq 4 && "${BASH_VERSINFO[1]}" -ge 4 || "${BASH_VERSINFO[0]}" -gt 4 ]]; then
    complete -o nospace -o bashdefault -o nosort -F _glimt_complete glimt
else
    complete -o nospace -o bashdefault -F _glimt_complete glimt
fi
"#;

/// The bash adapter. The script passes the line up to the cursor and, as a separate argument, the trailing
/// part that candidates replace.
pub(super) struct BashCompletionAdapter;

impl EnvCompleter for BashCompletionAdapter {
    fn name(&self) -> &'static str {
        "bash"
    }

    fn is(&self, name: &str) -> bool {
        name == "bash"
    }

    fn write_registration(
        &self,
        _variable: &str,
        _name: &str,
        _bin: &str,
        _completer: &str,
        out: &mut dyn Write,
    ) -> Result<(), Error> {
        out.write_all(SCRIPT.as_bytes())
    }

    fn write_complete(
        &self,
        command: &mut clap::Command,
        args: Vec<OsString>,
        folder: Option<&Path>,
        out: &mut dyn Write,
    ) -> Result<(), Error> {
        let text = |at: usize| args.get(at).and_then(|arg| arg.to_str());
        let (Some(line), Some(replaced)) = (text(0), text(1)) else { return Ok(()) };
        let Some(before) = line.strip_suffix(replaced) else { return Ok(()) };
        // Split the line and determine the quoting at the cursor.
        let words: Vec<OsString> = split_command_line(line).words.into_iter().map(OsString::from).collect();
        let kept = split_command_line(before);
        let begun = if before.ends_with(is_blank) && kept.quote == OpenQuote::None {
            ""
        } else {
            kept.words.last().map_or("", String::as_str)
        };
        let keeps_home = kept.quote == OpenQuote::None && replaced.starts_with("~/");
        store_command_line(&words);
        let last = words.len().saturating_sub(1);
        for candidate in complete(command, words, last, folder)? {
            let rest = candidate.get_value().to_str().and_then(|value| value.strip_prefix(begun));
            if let Some(quoted) = rest.and_then(|rest| quote_text_for_bash(rest, kept.quote, keeps_home)) {
                writeln!(out, "{quoted}")?;
            }
        }
        Ok(())
    }
}

/// The quote that is still open at the end of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum OpenQuote {
    None,
    Single,
    Double,
}

/// The unquoted words of a line, and the quote that is still open at its end. The last word is empty if the
/// line ends with a space.
struct CommandLine {
    words: Vec<String>,
    quote: OpenQuote,
}

fn is_blank(character: char) -> bool {
    matches!(character, ' ' | '\t' | '\n')
}

/// Splits a line like bash, but without expansions.
fn split_command_line(line: &str) -> CommandLine {
    let mut words = vec![String::new()];
    let mut quote = OpenQuote::None;
    let mut characters = line.trim_start_matches(is_blank).chars().peekable();
    while let Some(character) = characters.next() {
        let mut taken = Some(character);
        match (quote, character) {
            (OpenQuote::None, blank) if is_blank(blank) => {
                while characters.next_if(|next| is_blank(*next)).is_some() {}
                words.push(String::new());
                taken = None;
            }
            (OpenQuote::None, '\\') => taken = characters.next(),
            (OpenQuote::None, '\'') => (quote, taken) = (OpenQuote::Single, None),
            (OpenQuote::None, '"') => (quote, taken) = (OpenQuote::Double, None),
            (OpenQuote::Single, '\'') | (OpenQuote::Double, '"') => (quote, taken) = (OpenQuote::None, None),
            (OpenQuote::Double, '\\') => {
                taken = Some(characters.next_if(|next| "$`\"\\".contains(*next)).unwrap_or('\\'));
            }
            (OpenQuote::None | OpenQuote::Single | OpenQuote::Double, _) => {}
        }
        if let (Some(word), Some(taken)) = (words.last_mut(), taken) {
            word.push(taken);
        }
    }
    CommandLine { words, quote }
}

/// Quotes a candidate that is inserted after the open quote `quote`, or returns `None` if it cannot be
/// quoted.
fn quote_text_for_bash(text: &str, quote: OpenQuote, keeps_home: bool) -> Option<String> {
    let is_plain = |c: char| c.is_alphanumeric() || "_./,:=@%+-".contains(c);
    if text.chars().any(char::is_control) {
        // Control characters cannot be written inside quotes.
        return (quote == OpenQuote::None)
            .then(|| format!("$'{}'", text.chars().map(escape_char_for_dollar_quotes).collect::<String>()));
    }
    let mut out = String::new();
    for (at, character) in text.chars().enumerate() {
        match quote {
            OpenQuote::None if is_plain(character) || (keeps_home && at == 0 && character == '~') => {}
            OpenQuote::None => out.push('\\'),
            OpenQuote::Single if character == '\'' => {
                out.push_str(r"'\''");
                continue;
            }
            OpenQuote::Single => {}
            // Bash would keep a backslash before `!`.
            OpenQuote::Double if character == '!' => {
                out.push_str(r#""\!""#);
                continue;
            }
            OpenQuote::Double if "$`\"\\".contains(character) => out.push('\\'),
            OpenQuote::Double => {}
        }
        out.push(character);
    }
    Some(out)
}

/// Escapes a character for `$'…'`.
fn escape_char_for_dollar_quotes(character: char) -> String {
    match character {
        '\'' | '\\' => format!("\\{character}"),
        // Write all three octal digits, because the next character may be a digit.
        control if control.is_ascii_control() => format!("\\{:03o}", u32::from(control)),
        control if control.is_control() => format!("\\u{:04x}", u32::from(control)),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bash reads every quoted name back as one word.
    #[test]
    fn bash_reads_quoted_names_unchanged() {
        let names = [
            "plain.toml",
            "my scene.toml",
            "$(touch x)",
            "`touch x`",
            "a;b&c|d>e<f",
            "it's",
            "say \"hi\"",
            "back\\slash",
            "k*?[a]",
            "~tilde",
            "#hash",
            "a!b",
            "{a,b}",
            "é 😀",
            "new\nline",
            "esc\u{1b}]0;x\u{7}1",
            "c1\u{9b}5",
            "tab\there",
            "a=b:c",
        ];
        for (open, close, quote) in
            [("", "", OpenQuote::None), ("'", "'", OpenQuote::Single), ("\"", "\"", OpenQuote::Double)]
        {
            for name in names {
                let Some(text) = quote_text_for_bash(name, quote, false) else {
                    assert!(quote != OpenQuote::None && name.chars().any(char::is_control), "{name:?}");
                    continue;
                };
                let line = format!("printf '%s\\0' {open}{text}{close}");
                let mut bash = std::process::Command::new("bash");
                let output =
                    bash.args(["--norc", "-c", &line]).env("LC_ALL", "C.UTF-8").output().expect("bash");
                assert_eq!(String::from_utf8(output.stdout).expect("UTF-8"), format!("{name}\0"), "{line}");
                if !name.chars().any(char::is_control) {
                    assert_eq!(
                        split_command_line(&line).words.last().map(String::as_str),
                        Some(name),
                        "{line}"
                    );
                }
            }
        }
    }

    #[test]
    fn lines_are_split_as_in_bash() {
        let line = split_command_line("glimt  --set a=\"b c\"\\ d 'e\\' \"f\\$\\g ");
        assert_eq!(line.words, ["glimt", "--set", "a=b c d", "e\\", "f$\\g "]);
        assert_eq!(line.quote, OpenQuote::Double);
        assert_eq!(split_command_line("glimt ").words, ["glimt", ""]);
        assert_eq!(split_command_line("glimt 'x").quote, OpenQuote::Single);
        assert_eq!(quote_text_for_bash("~/a b", OpenQuote::None, true).as_deref(), Some("~/a\\ b"));
    }
}
