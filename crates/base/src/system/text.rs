//! Characters that terminals print unchanged.

/// Whether a terminal prints this character unchanged: it is not a control character, is visible, and does
/// not change the writing direction.
pub fn is_terminal_safe_char(c: char) -> bool {
    !matches!(c,
        '\0'..='\u{1f}'
        | '\u{7f}'..='\u{9f}'           // DEL and C1
        | '\u{ad}'                      // soft hyphen
        | '\u{61c}'                     // Arabic letter mark
        | '\u{115f}' | '\u{1160}'       // Hangul fillers
        | '\u{180e}'                    // Mongolian vowel separator
        | '\u{200b}'..='\u{200f}'       // zero width, direction marks
        | '\u{2028}'..='\u{202e}'       // line and paragraph separators, embeddings, overrides
        | '\u{2060}'..='\u{206f}'       // word joiner, isolates, deprecated marks
        | '\u{3164}' | '\u{ffa0}'       // more fillers
        | '\u{feff}'                    // byte order mark
        | '\u{fff9}'..='\u{fffb}'       // interlinear annotations
        | '\u{e0000}'..='\u{e0fff}'     // tags, variation selectors
    )
}
