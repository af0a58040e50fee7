//! Random mutations of a file.

use std::ops::Range;

use glimt::math::random::TestRandom;

/// Maximum length of the result. Longer files only take more time.
const MAX_BYTES: usize = 1 << 20;

/// Words that may break careless parsers.
const WORDS: &[&str] = &[
    "0",
    "-1",
    "1",
    "nan",
    "inf",
    "-inf",
    "-0.0",
    "1e999",
    "-1e999",
    "1e-999",
    "1e38",
    "3.5e38",
    "1e20",
    "1e308",
    "-1e308",
    "2147483647",
    "2147483648",
    "-2147483648",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "9223372036854775808",
    "18446744073709551615",
    "99999999999999999999999999",
    "1_000",
    "0x7fffffff",
    "0b1",
    "1.0.0",
    "1e",
    "+",
    "-",
    ".",
    "''",
    "\"\"",
    "\"",
    "'''",
    "\"\"\"",
    "#",
    "\\",
    "/",
    "//",
    "1//1",
    "1/1/1",
    "-1/-1/-1",
    "0/0/0",
    "[",
    "]",
    "[[",
    "]]",
    "{",
    "}",
    "[]",
    "{}",
    "[[]]",
    "=",
    ",",
    "\n",
    "\r",
    "\t",
    "true",
    "false",
    "1979-05-27T07:32:00Z",
    "\u{feff}",
    "\u{202e}",
    "\u{1b}[2J",
    "\u{0}",
    "../../..",
    "/",
    "/dev/zero",
    "/dev/tty",
    ".",
    "case.obj",
    "f",
    "v",
    "vt",
    "vn",
    "usemtl",
    "mtllib case.mtl",
    "mtllib case.obj",
    "element",
    "property list uchar int",
    "end_header",
    "OFF",
    "STCN4OFF",
    "BINARY",
    "[[instance]]",
    "group = \"things\"",
    "group = \"pair\"",
];

/// Numbers at the limits of their types.
const EDGES: &[u64] = &[
    0,
    1,
    0x7f,
    0x80,
    0xff,
    0x100,
    0x7fff,
    0x8000,
    0xffff,
    0x10000,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x1_0000_0000,
    0x7fff_ffff_ffff_ffff,
    0xffff_ffff_ffff_ffff,
];

/// Applies one to five mutations in sequence.
pub(super) fn changed(bytes: &[u8], other: &[u8], random: &mut TestRandom) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=random.below(5) {
        change(&mut bytes, other, random);
        bytes.truncate(MAX_BYTES);
    }
    bytes
}

type FileChange = fn(&mut Vec<u8>, &[u8], &mut TestRandom);

const CHANGES: &[FileChange] = &[
    flip_bits,
    set_bytes,
    set_number,
    cut,
    delete_line,
    repeat_line,
    swap_lines,
    swap_words,
    replace_word,
    replace_word,
    grow_number,
    insert_word,
    insert_bytes,
    nest,
    repeat_part,
    delete_part,
    splice,
];

fn change(bytes: &mut Vec<u8>, other: &[u8], random: &mut TestRandom) {
    if bytes.is_empty() {
        bytes.extend_from_slice(other);
    }
    if !bytes.is_empty() {
        random.pick(CHANGES)(bytes, other, random);
    }
}

/// A random position, biased toward the start, where headers are.
fn place(bytes: &[u8], random: &mut TestRandom) -> usize {
    let within = if random.below(2) == 0 { bytes.len().min(256) } else { bytes.len() };
    random.below(within)
}

#[expect(clippy::ptr_arg, reason = "one signature for all changes")]
fn flip_bits(bytes: &mut Vec<u8>, _: &[u8], random: &mut TestRandom) {
    for _ in 0..=random.below(8) {
        let at = place(bytes, random);
        bytes[at] ^= 1 << random.below(8);
    }
}

#[expect(clippy::ptr_arg, reason = "one signature for all changes")]
fn set_bytes(bytes: &mut Vec<u8>, _: &[u8], random: &mut TestRandom) {
    for _ in 0..=random.below(8) {
        let at = place(bytes, random);
        bytes[at] = random.bits() as u8;
    }
}

/// Writes a 1-, 2-, 4- or 8-byte number in either byte order.
#[expect(clippy::ptr_arg, reason = "one signature for all changes")]
fn set_number(bytes: &mut Vec<u8>, _: &[u8], random: &mut TestRandom) {
    let (at, length) = (place(bytes, random), 1 << random.below(4));
    let number = *random.pick(EDGES);
    let mut number = number.to_le_bytes()[..length].to_vec();
    if random.below(2) == 0 {
        number.reverse();
    }
    bytes.iter_mut().skip(at).zip(number).for_each(|(byte, new)| *byte = new);
}

fn cut(bytes: &mut Vec<u8>, _: &[u8], random: &mut TestRandom) {
    bytes.truncate(random.below(bytes.len()));
}

/// Splits a byte string at each byte that satisfies `is_gap`. Returns at least one piece.
fn pieces(bytes: &[u8], is_gap: fn(u8) -> bool) -> Vec<Range<usize>> {
    let mut pieces = Vec::new();
    let mut start = 0;
    for (at, _) in bytes.iter().enumerate().filter(|(_, byte)| is_gap(**byte)) {
        if at > start {
            pieces.push(start..at);
        }
        start = at + 1;
    }
    if start < bytes.len() || pieces.is_empty() {
        pieces.push(start.min(bytes.len())..bytes.len());
    }
    pieces
}

fn lines(bytes: &[u8]) -> Vec<Range<usize>> {
    pieces(bytes, |byte| byte == b'\n')
}

fn words(bytes: &[u8]) -> Vec<Range<usize>> {
    pieces(bytes, |byte| byte.is_ascii_whitespace() || b"[]{}=,\"/".contains(&byte))
}

fn delete_line(bytes: &mut Vec<u8>, _: &[u8], random: &mut TestRandom) {
    let line = random.pick(&lines(bytes)).clone();
    bytes.drain(line);
}

fn repeat_line(bytes: &mut Vec<u8>, _: &[u8], random: &mut TestRandom) {
    let line = random.pick(&lines(bytes)).clone();
    let text = [b"\n", &bytes[line.clone()]].concat();
    // Do not repeat long lines beyond the limit, because the worker's memory use is measured.
    let times = (1 << random.below(12)).min(MAX_BYTES / text.len() + 1);
    bytes.splice(line.end..line.end, text.repeat(times));
}

fn swap_lines(bytes: &mut Vec<u8>, _: &[u8], random: &mut TestRandom) {
    let lines = lines(bytes);
    swap(bytes, random.pick(&lines).clone(), random.pick(&lines).clone());
}

fn swap_words(bytes: &mut Vec<u8>, _: &[u8], random: &mut TestRandom) {
    let words = words(bytes);
    swap(bytes, random.pick(&words).clone(), random.pick(&words).clone());
}

fn swap(bytes: &mut Vec<u8>, one: Range<usize>, other: Range<usize>) {
    let (first, second) = if one.start <= other.start { (one, other) } else { (other, one) };
    if first.end <= second.start {
        let (before, behind) = (bytes[first.clone()].to_vec(), bytes[second.clone()].to_vec());
        bytes.splice(second, before);
        bytes.splice(first, behind);
    }
}

fn replace_word(bytes: &mut Vec<u8>, _: &[u8], random: &mut TestRandom) {
    let word = random.pick(&words(bytes)).clone();
    bytes.splice(word, random.pick(WORDS).bytes());
}

/// Adds digits, an exponent or a sign to a word that starts like a number.
fn grow_number(bytes: &mut Vec<u8>, _: &[u8], random: &mut TestRandom) {
    let mut numbers = words(bytes);
    numbers.retain(|word| bytes.get(word.start).is_some_and(|byte| byte.is_ascii_digit() || *byte == b'-'));
    if numbers.is_empty() {
        return;
    }
    let number = random.pick(&numbers).clone();
    match random.below(4) {
        0 => bytes.insert(number.start, b'-'),
        1 => drop(bytes.splice(number.end..number.end, "0".repeat(1 + random.below(40)).into_bytes())),
        2 => drop(bytes.splice(number.end..number.end, format!("e{}", random.below(400)).into_bytes())),
        _ => drop(bytes.splice(number.start..number.start, "9".repeat(1 + random.below(25)).into_bytes())),
    }
}

fn insert_word(bytes: &mut Vec<u8>, _: &[u8], random: &mut TestRandom) {
    let word = random.pick(&words(bytes)).clone();
    let text = format!(" {} ", random.pick(WORDS));
    bytes.splice(word.end..word.end, text.into_bytes());
}

/// Inserts bytes that are not valid UTF-8.
fn insert_bytes(bytes: &mut Vec<u8>, _: &[u8], random: &mut TestRandom) {
    let at = place(bytes, random);
    let new: Vec<u8> = (0..=random.below(16)).map(|_| random.bits() as u8 | 0x80).collect();
    bytes.splice(at..at, new);
}

fn nest(bytes: &mut Vec<u8>, _: &[u8], random: &mut TestRandom) {
    let word = random.pick(&words(bytes)).clone();
    let depth = 1 << random.below(18);
    let (open, close) =
        *random.pick(&[("[", "]"), ("{a=", "}"), ("[{a=", "}]"), ("a.", ""), ("[[", "]]"), ("(", ")")]);
    let tail = if random.below(2) == 0 { close.repeat(depth) } else { String::new() };
    bytes.splice(word.end..word.end, tail.into_bytes());
    bytes.splice(word.start..word.start, open.repeat(depth).into_bytes());
}

fn part(bytes: &[u8], random: &mut TestRandom) -> Range<usize> {
    let start = place(bytes, random);
    let most = 1 << random.below(12);
    let length = 1 + random.below((bytes.len() - start).min(most));
    start..start + length
}

fn repeat_part(bytes: &mut Vec<u8>, _: &[u8], random: &mut TestRandom) {
    let part = part(bytes, random);
    let text = bytes[part.clone()].repeat(1 << random.below(10));
    bytes.splice(part.end..part.end, text);
}

fn delete_part(bytes: &mut Vec<u8>, _: &[u8], random: &mut TestRandom) {
    let part = part(bytes, random);
    bytes.drain(part);
}

/// Joins the start of one file with the end of another.
fn splice(bytes: &mut Vec<u8>, other: &[u8], random: &mut TestRandom) {
    bytes.truncate(random.below(bytes.len()) + 1);
    if !other.is_empty() {
        bytes.extend_from_slice(&other[random.below(other.len())..]);
    }
}
