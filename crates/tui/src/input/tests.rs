use std::time::{Duration, Instant};

use crossterm::event::{KeyCode, KeyModifiers};
use proptest::prelude::*;

use super::*;
use crate::event::{MouseEvent, MouseEventKind};
use crate::graphics::ImageProtocol;
use crate::terminal_replies::TerminalReply;
use crate::terminals::{TerminalBrand, TerminalId};

/// A decoder with a simulated clock.
struct DecoderBench {
    decoder: Decoder,
    now: Instant,
}

impl DecoderBench {
    fn new() -> Self {
        Self { decoder: Decoder::default(), now: Instant::now() }
    }

    fn read(&mut self, bytes: &[u8]) -> Vec<DecodedInput> {
        self.decoder.decode(bytes, self.now)
    }

    /// Simulates silence, waking up at each deadline.
    fn wait(&mut self, milliseconds: u64) -> Vec<DecodedInput> {
        let end = self.now + Duration::from_millis(milliseconds);
        let mut inputs = Vec::new();
        while let Some(deadline) = self.decoder.deadline().filter(|deadline| *deadline <= end) {
            self.now = deadline;
            inputs.extend(self.decoder.expire(deadline));
        }
        self.now = end;
        inputs
    }
}

fn read(bytes: &[u8]) -> Vec<DecodedInput> {
    DecoderBench::new().read(bytes)
}

fn plain(character: char) -> DecodedInput {
    DecodedInput::Key(KeyPress::plain(character))
}

fn special(code: KeyCode) -> DecodedInput {
    DecodedInput::Key(KeyPress::special(code))
}

fn with(modifiers: KeyModifiers, code: KeyCode) -> DecodedInput {
    DecodedInput::Key(KeyPress { code, modifiers })
}

const READY: DecodedInput = DecodedInput::TerminalReply(TerminalReply::Ready);
const ESC: DecodedInput = DecodedInput::Key(KeyPress::special(KeyCode::Esc));

#[test]
fn xterm_key_encodings_are_decoded() {
    use KeyModifiers as With;
    for (bytes, input) in [
        (&b"q"[..], plain('q')),
        ("é".as_bytes(), plain('é')),
        (b" ", plain(' ')),
        (b"\x7f", special(KeyCode::Backspace)),
        (b"\r", special(KeyCode::Enter)),
        (b"\t", special(KeyCode::Tab)),
        (b"\x03", DecodedInput::Key(KeyPress::ctrl('c'))),
        (b"\x1a", DecodedInput::Key(KeyPress::ctrl('z'))),
        (b"\0", DecodedInput::Key(KeyPress::ctrl(' '))),
        (b"\x1c", DecodedInput::Key(KeyPress::ctrl('4'))),
        (b"\x1b[A", special(KeyCode::Up)),
        (b"\x1bOB", special(KeyCode::Down)),
        (b"\x1b[1;5C", with(With::CONTROL, KeyCode::Right)),
        (b"\x1b[1;4D", with(With::SHIFT.union(With::ALT), KeyCode::Left)),
        (b"\x1b[Z", with(With::SHIFT, KeyCode::BackTab)),
        (b"\x1b[H", special(KeyCode::Home)),
        (b"\x1b[4~", special(KeyCode::End)),
        (b"\x1b[5~", special(KeyCode::PageUp)),
        (b"\x1b[6;5~", with(With::CONTROL, KeyCode::PageDown)),
        (b"\x1b[3~", special(KeyCode::Delete)),
        (b"\x1bOP", special(KeyCode::F(1))),
        (b"\x1b[[B", special(KeyCode::F(2))),
        (b"\x1b[15~", special(KeyCode::F(5))),
        (b"\x1b[17~", special(KeyCode::F(6))),
        (b"\x1b[24~", special(KeyCode::F(12))),
        (b"\x1b[R", special(KeyCode::F(3))),
    ] {
        assert_eq!(read(bytes), [input], "{:?}", String::from_utf8_lossy(bytes));
    }
}

#[test]
fn replies_are_not_keys() {
    for (bytes, answer) in [
        (&b"\x1b[0n"[..], TerminalReply::Ready),
        (b"\x1b[?62;1;2;22c", TerminalReply::Attributes),
        (b"\x1b[?6c", TerminalReply::Attributes),
        (b"\x1b[>0;276;0c", TerminalReply::Other),
        (b"\x1b[12;40R", TerminalReply::Other),
        (b"\x1b[?2026;2$y", TerminalReply::Synchronized { is_known: true }),
        (b"\x1b[?2026;0$y", TerminalReply::Synchronized { is_known: false }),
        (b"\x1b[?7;1$y", TerminalReply::Other),
        (b"\x1b]11;rgb:ffff/ffff/ffff\x07", TerminalReply::Background([255; 3])),
        (b"\x1b]11;?\x07", TerminalReply::Other),
        (b"\x1b]4;12;rgb:5c5c/5c5c/ffff\x1b\\", TerminalReply::Ink { index: 12, rgb: [92, 92, 255] }),
        (b"\x1bP1+r524742=38\x1b\\", TerminalReply::TrueColor),
        (b"\x1bP0+r524742\x1b\\", TerminalReply::Other),
        (
            b"\x1bP>|foot(1.20.2)\x1b\\",
            TerminalReply::Name(TerminalId { brand: TerminalBrand::Foot, version: [1, 20] }),
        ),
        (b"\x1bP>|tmux 3.4\x1b\\", TerminalReply::Other),
        (b"\x1b[I", TerminalReply::Focus { is_here: true }),
        (b"\x1b[O", TerminalReply::Focus { is_here: false }),
        (b"\x1b[<2;10;20M", TerminalReply::Other),
        (b"\x1b[<35;10;20M", TerminalReply::Other),
        (b"\x1b[?997;1n", TerminalReply::Other),
        (b"\x1b_Gi=4211;OK\x1b\\", TerminalReply::Images(ImageProtocol::Kitty)),
        (b"\x1b_Gi=4211;ENOTSUPPORTED\x1b\\", TerminalReply::Other),
        (b"\x1b_Gi=31;OK\x1b\\", TerminalReply::Other),
    ] {
        let name = String::from_utf8_lossy(bytes).into_owned();
        assert_eq!(read(bytes), [DecodedInput::TerminalReply(answer)], "{name:?}");
        let mut bench = DecoderBench::new();
        let mut inputs = Vec::new();
        for byte in bytes {
            inputs.extend(bench.read(&[*byte]));
            inputs.extend(bench.wait(40));
        }
        assert_eq!(inputs, [DecodedInput::TerminalReply(answer)], "{name:?} byte by byte");
    }
}

#[test]
fn left_button_and_wheel_are_decoded() {
    use MouseEventKind::{Drag, Press, Release, WheelDown, WheelUp};
    for (bytes, kind) in [
        (&b"\x1b[<0;10;20M"[..], Press),
        (b"\x1b[<20;10;20M", Press),
        (b"\x1b[<32;10;20M", Drag),
        (b"\x1b[<0;10;20m", Release),
        (b"\x1b[<64;10;20M", WheelUp),
        (b"\x1b[<65;10;20M", WheelDown),
    ] {
        let expected = DecodedInput::Mouse(MouseEvent { kind, column: 9, row: 19 });
        assert_eq!(read(bytes), [expected], "{bytes:?}");
        let mut bench = DecoderBench::new();
        let inputs: Vec<DecodedInput> = bytes.iter().flat_map(|byte| bench.read(&[*byte])).collect();
        assert_eq!(inputs, [expected], "{bytes:?} byte by byte");
    }
}

#[test]
fn original_mouse_reports_produce_no_keys() {
    assert_eq!(read(b"\x1b[M q!q"), [plain('q')]);
}

#[test]
fn lone_escape_is_a_key() {
    let mut bench = DecoderBench::new();
    assert_eq!(bench.read(b"\x1b"), []);
    assert_eq!(bench.wait(49), []);
    assert_eq!(bench.wait(1), [ESC]);
    assert_eq!(bench.read(b"q"), [plain('q')]);
    assert_eq!(read(b"\x1b\x1b[A"), [ESC, special(KeyCode::Up)]);
    assert_eq!(read(b"\x1b\x03q"), [ESC, DecodedInput::Key(KeyPress::ctrl('c')), plain('q')]);
    assert_eq!(read("\x1béq".as_bytes()), [ESC, plain('é'), plain('q')]);
}

#[test]
fn sixel_support_is_read_from_attributes() {
    let answers = [TerminalReply::Images(ImageProtocol::Sixel), TerminalReply::Attributes]
        .map(DecodedInput::TerminalReply);
    assert_eq!(read(b"\x1b[?62;4;22c"), answers);
    assert_eq!(read(b"\x1b[?1;2;4c"), answers);
    assert_eq!(read(b"\x1b[?44;14c"), [DecodedInput::TerminalReply(TerminalReply::Attributes)]);
}

#[test]
fn image_replies_do_not_swallow_keys() {
    let keys = b"q\x1b_Gi=4211;OK\x1b\\s";
    assert_eq!(
        read(keys),
        [plain('q'), DecodedInput::TerminalReply(TerminalReply::Images(ImageProtocol::Kitty)), plain('s')]
    );
    // The end of the reply arrives late.
    let mut bench = DecoderBench::new();
    assert_eq!(
        bench.read(b"\x1b_Gi=4211;OK\x1b"),
        [DecodedInput::TerminalReply(TerminalReply::Images(ImageProtocol::Kitty))]
    );
    assert_eq!(bench.wait(300), []);
    assert_eq!(bench.read(b"\\s"), [plain('s')]);
}

/// No key binding uses alt, so a character right after an escape character is a separate key press.
#[test]
fn escape_and_immediate_key_are_two_keys() {
    for key in (b' '..0x7f).filter(|byte| !b"[]OPX^_\\".contains(byte)) {
        let key = char::from(key);
        let bytes = [b"\x1b".as_slice(), key.to_string().as_bytes(), b"q"].concat();
        assert_eq!(read(&bytes), [ESC, plain(key), plain('q')], "{key}");
        let mut bench = DecoderBench::new();
        assert_eq!(bench.read(b"\x1b"), []);
        bench.wait(20);
        assert_eq!(bench.read(&bytes[1..2]), [ESC, plain(key)], "{key}");
    }
    assert_eq!(read(b"\x1b\x1bs"), [ESC, ESC, plain('s')]);
    assert_eq!(read(b"\x1b]s"), [ESC, plain(']'), plain('s')]);
    assert_eq!(read(b"\x1b]]"), [ESC, plain(']'), plain(']')]);
    assert_eq!(read(b"\x1b[s"), [ESC, plain('['), plain('s')]);
    assert_eq!(read(b"\x1bPp"), [ESC, plain('P'), plain('p')]);
    assert_eq!(read(b"\x1b[As\x1bs"), [special(KeyCode::Up), plain('s'), ESC, plain('s')]);
    // Incomplete sequences expire as two key presses.
    for key in ['[', ']', 'P', 'O', 'X', '_'] {
        let mut bench = DecoderBench::new();
        assert_eq!(bench.read(format!("\x1b{key}").as_bytes()), []);
        assert_eq!(bench.wait(1000), [ESC, plain(key)]);
        assert_eq!(bench.read(b"q"), [plain('q')]);
    }
}

#[test]
fn late_bytes_still_continue_a_sequence() {
    for (rest, input) in [
        (&b"[0n"[..], READY),
        (b"[A", special(KeyCode::Up)),
        (b"[?62;22c", DecodedInput::TerminalReply(TerminalReply::Attributes)),
        (b"[?2026;2$y", DecodedInput::TerminalReply(TerminalReply::Synchronized { is_known: true })),
        (b"[24;80R", DecodedInput::TerminalReply(TerminalReply::Other)),
    ] {
        let mut bench = DecoderBench::new();
        bench.read(b"\x1b");
        assert_eq!(bench.wait(400), [ESC]);
        let mut inputs = Vec::new();
        for byte in rest {
            inputs.extend(bench.read(&[*byte]));
            inputs.extend(bench.wait(250));
        }
        assert_eq!(inputs, [input]);
    }
}

#[test]
fn bracket_after_escape_is_a_key() {
    let after_escape = || {
        let mut bench = DecoderBench::new();
        bench.read(b"\x1b");
        assert_eq!(bench.wait(400), [ESC]);
        bench
    };
    assert_eq!(after_escape().read(b"[q"), [plain('['), plain('q')]);
    assert_eq!(after_escape().read(b"[0q"), [plain('['), plain('0'), plain('q')]);
    let mut bench = after_escape();
    assert_eq!(bench.read(b"["), []);
    assert_eq!(bench.wait(300), [plain('[')]);
    assert_eq!(bench.read(b"[q"), [plain('['), plain('q')]);
    let mut bench = after_escape();
    bench.wait(2000);
    assert_eq!(bench.read(b"["), [plain('[')]);
    let long = [&b"["[..], &[b'1'; 40]].concat();
    let keys = after_escape().read(&long);
    assert_eq!((keys.len(), keys[0], keys[40]), (41, plain('['), plain('1')));
}

#[test]
fn paste_is_a_single_event() {
    assert_eq!(read(b"a\x1b[200~q\x1b[20\x1b[201~b"), [plain('a'), DecodedInput::Paste, plain('b')]);
    let mut bench = DecoderBench::new();
    for byte in b"\x1b[200~quit\x1b[A\x03" {
        assert_eq!(bench.read(&[*byte]), []);
        assert_eq!(bench.wait(45), []);
    }
    assert_eq!(bench.read(b"\x1b[201~q"), [DecodedInput::Paste, plain('q')]);
}

#[test]
fn silence_ends_an_unterminated_paste() {
    let mut bench = DecoderBench::new();
    bench.read(b"\x1b[200~qqq");
    assert_eq!(bench.wait(999), []);
    assert_eq!(bench.wait(1), [DecodedInput::Paste]);
    assert_eq!(bench.read(b"q\x1b[201~"), [plain('q')], "a late end marker is ignored");

    bench.read(b"\x1b[200~");
    let keys = (0..30).flat_map(|_| {
        let mut inputs = bench.read(b"q");
        inputs.extend(bench.wait(500));
        inputs
    });
    let keys: Vec<DecodedInput> = keys.collect();
    assert_eq!((keys[0], keys[1]), (DecodedInput::Paste, plain('q')), "the paste ends despite repeated keys");

    let long = [&b"\x1b[200~"[..], &vec![b'q'; (1 << 20) + 3]].concat();
    let mut bench = DecoderBench::new();
    assert_eq!(bench.read(&long), []);
    assert_eq!(bench.wait(199), []);
    assert_eq!(bench.wait(1), [DecodedInput::Paste], "a short silence ends a long paste");
    assert_eq!(bench.read(b"q"), [plain('q')]);
}

#[test]
fn long_paste_produces_no_keys() {
    let mut bench = DecoderBench::new();
    assert_eq!(bench.read(b"\x1b[200~"), []);
    for _ in 0..3000 {
        assert_eq!(bench.read(&[b'q'; 1000]), []);
        assert_eq!(bench.wait(5), []);
    }
    assert_eq!(bench.read(b"q\x1b[201~c"), [DecodedInput::Paste, plain('c')], "3 MB in 15 s");

    let mut bench = DecoderBench::new();
    assert_eq!(bench.read(b"\x1b[200~"), []);
    for _ in 0..150 {
        assert_eq!(bench.read(b"q"), []);
        assert_eq!(bench.wait(100), []);
    }
    assert_eq!(bench.read(b"q\x1b[201~c"), [DecodedInput::Paste, plain('c')], "over a slow connection");
}

#[test]
fn delayed_text_belongs_to_the_paste() {
    let mut bench = DecoderBench::new();
    assert_eq!(bench.read(b"\x1b[200~q"), []);
    // Nothing was read in between, so no silence was observed.
    bench.now += Duration::from_secs(60);
    assert_eq!(bench.read(b"q\x1b[201~"), [DecodedInput::Paste]);
}

#[test]
fn replies_do_not_extend_a_paste() {
    let mut bench = DecoderBench::new();
    assert_eq!(bench.read(b"\x1b[200~q"), []);
    let mut found = Vec::new();
    for _ in 0..10 {
        found.extend(bench.read(b"\x1b[0n"));
        found.extend(bench.wait(150));
    }
    assert_eq!(found[0], DecodedInput::Paste, "the paste ends one second after its last text");
    assert_eq!(bench.read(b"q"), [plain('q')]);
}

#[test]
fn unterminated_sequence_is_dropped() {
    for begun in [&b"\x1b]0;t"[..], b"\x1bP1", b"\x1b[1;", b"\x1bXx", b"\x1b[M"] {
        let mut bench = DecoderBench::new();
        assert_eq!(bench.read(begun), []);
        assert_eq!(bench.wait(1000), []);
        assert_eq!(bench.read(b"q"), [plain('q')], "{:?}", String::from_utf8_lossy(begun));
    }
    let mut bench = DecoderBench::new();
    bench.read(b"\x1b]");
    let mut keys = Vec::new();
    for _ in 0..10 {
        keys.extend(bench.read(b"q"));
        bench.wait(300);
    }
    assert!(!keys.is_empty(), "repeated key presses end the sequence");
    let long = [&b"\x1bP"[..], &vec![b'q'; 5000]].concat();
    assert!(read(&long).contains(&plain('q')), "strings have a maximum length");
}

#[test]
fn invalid_text_does_not_swallow_keys() {
    for broken in [&b"\xc3"[..], b"\xe2\x96", b"\xf0\x90\x80", b"\xff", b"\x80", b"\xe2\x1b[A"] {
        let inputs = read(&[broken, b"q"].concat());
        assert_eq!(inputs.last(), Some(&plain('q')), "{broken:?}");
    }
}

proptest! {
    /// The decoded input does not depend on where the bytes are split.
    #[test]
    fn splits_do_not_matter(parts in prop::collection::vec(0..10_usize, 0..40), cuts in prop::collection::vec(1..5_usize, 200)) {
        let words: [&[u8]; 10] =
            [b"q", b"\x1b[A", b"\x1b[0n", b"\x1b[?62;22c", "é".as_bytes(), b"\x1bOP", b"\x1b[5~", b"\x03", b"\x1b[200~q\x1b[201~", b"\x1b[3;4R"];
        let text: Vec<u8> = parts.iter().flat_map(|part| words[*part]).copied().collect();
        let whole = read(&text);
        prop_assert_eq!(whole.len(), parts.len());
        let mut bench = DecoderBench::new();
        let (mut rest, mut split) = (&text[..], Vec::new());
        for cut in cuts {
            let (now, later) = rest.split_at(cut.min(rest.len()));
            split.extend(bench.read(now));
            split.extend(bench.wait(30));
            rest = later;
        }
        split.extend(bench.read(rest));
        prop_assert_eq!(split, whole);
    }

    /// A key press is recognized after any bytes followed by a pause.
    #[test]
    fn no_input_blocks_the_keyboard(bytes in prop::collection::vec(prop_oneof![Just(0x1b_u8), Just(b'['), Just(b']'), Just(b'P'), any::<u8>()], 0..300)) {
        let mut bench = DecoderBench::new();
        bench.read(&bytes);
        bench.wait(12_000);
        prop_assert_eq!(bench.decoder.deadline(), None);
        let inputs = bench.read(b"q");
        prop_assert_eq!(inputs.last(), Some(&plain('q')));
    }
}
