//! Tags in the text of an XML file: where names are, and whether a tag has too many attributes to be parsed.

use std::ops::Range;

use roxmltree::Node;

/// Maximum number of attributes of an element. The parser compares each with all others.
pub(super) const MAX_ATTRIBUTES: usize = 200;

/// Returns the name of the first element with more than [`MAX_ATTRIBUTES`] attributes. Malformed text is left
/// to the parser.
pub(super) fn find_overfull_tag(text: &str) -> Option<Range<usize>> {
    let mut position = 0;
    loop {
        let start = position + text[position..].find('<')?;
        let rest = &text[start..];
        let end_of = |mark: &str| rest.find(mark).map(|at| start + at + mark.len());
        let skipped = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>")];
        position = match skipped.iter().find(|(open, _)| rest.starts_with(open)) {
            Some((_, close)) => end_of(close)?,
            None => match end_of_tag(rest.as_bytes())? {
                TagEndOrOverflow::At(end) => start + end,
                TagEndOrOverflow::Overfull => {
                    let name = rest[1..].find(|c: char| c.is_whitespace()).unwrap_or_default();
                    return Some(start + 1..start + 1 + name);
                }
            },
        };
    }
}

/// The end of a tag.
enum TagEndOrOverflow {
    /// Offset after the tag.
    At(usize),
    /// The tag has too many attributes.
    Overfull,
}

/// Finds the end of a tag, which `>` marks outside of quotes.
fn end_of_tag(tag: &[u8]) -> Option<TagEndOrOverflow> {
    let (mut position, mut count) = (1, 0);
    loop {
        let at = position + tag[position..].iter().position(|byte| b">\"'".contains(byte))?;
        if tag[at] == b'>' {
            return Some(TagEndOrOverflow::At(at + 1));
        }
        count += 1;
        if count > MAX_ATTRIBUTES {
            return Some(TagEndOrOverflow::Overfull);
        }
        position = at + 2 + tag[at + 1..].iter().position(|byte| *byte == tag[at])?;
    }
}

/// Span of the element's name in its start tag.
pub(super) fn element_name_span(text: &str, node: &Node<'_, '_>, start: usize) -> Range<usize> {
    let range = node.range();
    let after = (range.start + 1).min(range.end);
    let name = text.get(after..range.end).unwrap_or_default();
    let length = name.find(|c: char| c.is_whitespace() || c == '>' || c == '/').unwrap_or(name.len());
    start + after..start + after + length
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_are_counted_per_tag() {
        let attributes = |count: usize| (0..count).map(|index| format!(" a{index}='>'")).collect::<String>();
        let full = format!("<ä{}/>", attributes(MAX_ATTRIBUTES));
        let overfull = format!("<ä{}/>", attributes(MAX_ATTRIBUTES + 1));
        assert_eq!(find_overfull_tag(&full.repeat(3)), None);
        assert_eq!(find_overfull_tag(&format!("{full}{overfull}")), Some(full.len() + 1..full.len() + 3));
        for hidden in
            [format!("<!--{overfull}-->"), format!("<![CDATA[{overfull}]]>"), format!("<?{overfull}?>")]
        {
            assert_eq!(find_overfull_tag(&format!("{hidden}<a/>")), None, "{hidden}");
        }
        for cut in ["", "<", "<a", "<a b='", "<!--", "a>b", "<a b='c'"] {
            assert_eq!(find_overfull_tag(cut), None, "{cut}");
        }
    }
}
