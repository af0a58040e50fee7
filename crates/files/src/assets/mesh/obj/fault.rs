//! The place of a fault in an OBJ.

use super::super::text::{Cursor, shown};
use super::super::{AssetError, Source};

/// `tobj` finds that something is wrong, but not where: look for the first line that it refuses.
pub(super) fn first_fault(source: &Source<'_>) -> Option<AssetError> {
    let mut counts = [0_i64; 3];
    let mut cursor = Cursor::new(source.bytes, 0);
    while cursor.skip_blank() {
        let at = cursor.at();
        let reason = match cursor.word() {
            b"v" => counted(&mut cursor, &mut counts[0], 3, "coordinates"),
            b"vt" => counted(&mut cursor, &mut counts[1], 2, "texture coordinates"),
            b"vn" => counted(&mut cursor, &mut counts[2], 3, "normal coordinates"),
            b"f" => face_fault(&mut cursor, counts),
            _ => None,
        };
        if let Some(reason) = reason {
            return Some(source.wrong_at(at, reason));
        }
        cursor.end_line();
    }
    None
}

fn counted(cursor: &mut Cursor<'_>, count: &mut i64, wanted: usize, what: &str) -> Option<String> {
    *count += 1;
    let mut found = 0;
    let mut last = 1.0;
    let mut all_finite = true;
    while skip_in_statement(cursor) {
        let mut start = *cursor;
        let Some(number) = cursor.float() else {
            return Some(format!("expected {wanted} {what}, found {}", shown(start.word())));
        };
        last = number;
        all_finite &= found < wanted || number.is_finite();
        found += 1;
    }
    match found {
        4 if what == "coordinates" && last == 0.0 => Some("the weight of a vertex is 0".to_owned()),
        4 if wanted == 3 => None,
        6 if what == "coordinates" && !all_finite => {
            Some("the colours of a vertex are finite numbers".to_owned())
        }
        5 if what == "coordinates" => {
            Some("coordinates are followed by one weight or three colours".to_owned())
        }
        // A single coordinate is allowed; v is then 0.
        1 if what == "texture coordinates" => None,
        _ if found < wanted => Some(format!("expected {wanted} {what}, found {found}")),
        _ => None,
    }
}

/// Goes to the next word of this statement, which continues behind a backslash at the end of a line.
fn skip_in_statement(cursor: &mut Cursor<'_>) -> bool {
    while cursor.skip_in_line() {
        let mut ahead = *cursor;
        if ahead.word() != b"\\" || ahead.skip_in_line() {
            return true;
        }
        ahead.end_line();
        *cursor = ahead;
    }
    false
}

fn face_fault(cursor: &mut Cursor<'_>, counts: [i64; 3]) -> Option<String> {
    while skip_in_statement(cursor) {
        let word = cursor.word();
        let parts: Vec<&[u8]> = word.split(|&byte| byte == b'/').collect();
        if parts.len() > 3 {
            return Some(format!("expected a corner like 1/2/3, found {}", shown(word)));
        }
        for (part, (count, what)) in
            parts.iter().zip(counts.iter().zip(["vertex", "texture coordinate", "normal"]))
        {
            if part.is_empty() && what != "vertex" {
                continue;
            }
            match Cursor::new(part, 0).integer() {
                None => return Some(format!("expected a corner like 1/2/3, found {}", shown(word))),
                Some(index) if index == 0 || index > *count || index < -count => {
                    return Some(format!("{what} {index} is out of range: there are {count}, from 1"));
                }
                Some(_) => {}
            }
        }
    }
    None
}
