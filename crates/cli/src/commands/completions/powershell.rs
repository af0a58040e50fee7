//! PowerShell completion with quoted candidates.

use std::ffi::OsString;
use std::io::{Error, Write};
use std::path::Path;

use clap_complete::engine::complete;
use clap_complete::env::EnvCompleter;

use crate::args::candidates::store_command_line;

/// The script. It does not evaluate the line, unlike `clap_complete`'s script, which executes `$(…)` on
/// completion. The last word is prefixed with `+` because some PowerShell versions do not pass empty
/// arguments.
const SCRIPT: &str = r#"Register-ArgumentCompleter -Native -CommandName glimt -ScriptBlock {
    param($wordToComplete, $commandAst, $cursorPosition)
    $words = @()
    $last = ''
    foreach ($element in $commandAst.CommandElements) {
        if ($element.Extent.StartOffset -ge $cursorPosition) { break }
        $text = $element.Extent.Text
        if ($element -is [System.Management.Automation.Language.StringConstantExpressionAst]) { $text = $element.Value }
        if ($element.Extent.EndOffset -ge $cursorPosition) {
            $last = $text
        } else {
            $words += $text
        }
    }
    $words += "+$last"
    $before = $env:GLIMT_COMPLETE
    $env:GLIMT_COMPLETE = 'powershell'
    try {
        $answer = & glimt '--' $words
    } finally {
        $env:GLIMT_COMPLETE = $before
    }
    $answer | Where-Object { $_ } | ForEach-Object {
        $parts = $_.Split("`t")
        [System.Management.Automation.CompletionResult]::new($parts[0], $parts[1], 'ParameterValue', $parts[2])
    }
}
"#;

/// The PowerShell adapter. Prints one line per candidate, with three tab-separated fields: the quoted
/// candidate, the unquoted candidate and the description.
pub(super) struct PowershellCompleter;

impl EnvCompleter for PowershellCompleter {
    fn name(&self) -> &'static str {
        "powershell"
    }

    fn is(&self, name: &str) -> bool {
        matches!(name, "pwsh" | "powershell" | "powershell_ise")
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
        mut args: Vec<OsString>,
        folder: Option<&Path>,
        out: &mut dyn Write,
    ) -> Result<(), Error> {
        let Some(last) = args.pop().and_then(|marked| marked.to_str()?.strip_prefix('+').map(OsString::from))
        else {
            return Ok(());
        };
        args.push(last);
        store_command_line(&args);
        let index = args.len() - 1;
        for candidate in complete(command, args, index, folder)? {
            let Some(value) =
                candidate.get_value().to_str().filter(|value| !value.contains(char::is_control))
            else {
                continue;
            };
            let help = candidate.get_help().map(ToString::to_string).unwrap_or_default();
            let help = help.lines().next().filter(|line| !line.is_empty()).unwrap_or(value);
            writeln!(out, "{}\t{value}\t{}", quote_word(value), help.replace('\t', " "))?;
        }
        Ok(())
    }
}

/// Quotes a word for PowerShell.
fn quote_word(text: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "_./\\:=+-".contains(c);
    if text.chars().all(is_plain) {
        return text.to_owned();
    }
    // PowerShell treats typographic quotes as quotes.
    let doubled = |c: char| if "'‘’‚‛".contains(c) { format!("{c}{c}") } else { c.to_string() };
    format!("'{}'", text.chars().map(doubled).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn special_characters_are_quoted() {
        assert_eq!(quote_word("render.integrator=path"), "render.integrator=path");
        assert_eq!(quote_word("x$(touch y).toml"), "'x$(touch y).toml'");
        assert_eq!(quote_word("it's"), "'it''s'");
        assert!(!SCRIPT.contains("Invoke-Expression"));
    }
}
