//! `glimt lsp` as an editor uses it: a process with requests on stdin and replies on stdout.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdin, ChildStdout, Stdio};

use serde_json::{Value, json};

use crate::test_dir::{TestDir, assert_mentions, mentions};

const TEXT: &str = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n\n[textures.bricks]\nfile = \"bricks.png\"\n\n\
                    [materials.wall]\ntype = \"metal\"\ncolor = [1, 0.5, 0]\nroughness = { texture = \"bricks\" }\n\n\
                    [[sphere]]\ncenter = [0, 1, 0]\nradius = 0.5\nmaterial = \"wall\"\n\n[[light]]\n";

/// An editor with one open document.
struct Editor {
    child: Child,
    keys: ChildStdin,
    screen: BufReader<ChildStdout>,
    uri: String,
    next: u64,
    version: u64,
    dir: TestDir,
}

impl Editor {
    fn open(text: &str) -> Self {
        let dir = TestDir::new();
        dir.write("scene.toml", text);
        image::RgbImage::new(2, 2).save(dir.path("bricks.png")).expect("written");
        let mut process = dir.glimt("lsp");
        let mut child = process.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("it runs");
        let (keys, screen) = (child.stdin.take().expect("stdin"), child.stdout.take().expect("stdout"));
        let uri = format!("file://{}", dir.path("scene.toml").display());
        let mut editor = Self { child, keys, screen: BufReader::new(screen), uri, next: 0, version: 1, dir };
        let answer =
            editor.request("initialize", &json!({ "processId": null, "rootUri": null, "capabilities": {} }));
        assert_eq!(answer["serverInfo"]["name"], "glimt");
        assert_eq!(answer["capabilities"]["hoverProvider"], true);
        editor.notify("initialized", &json!({}));
        let document = json!({ "uri": editor.uri, "languageId": "toml", "version": 1, "text": text });
        editor.notify("textDocument/didOpen", &json!({ "textDocument": document }));
        editor
    }

    fn send(&mut self, message: &Value) {
        let text = message.to_string();
        write!(self.keys, "Content-Length: {}\r\n\r\n{text}", text.len()).expect("sent");
        self.keys.flush().expect("sent");
    }

    fn notify(&mut self, method: &str, params: &Value) {
        self.send(&json!({ "jsonrpc": "2.0", "method": method, "params": params }));
    }

    fn receive(&mut self) -> Value {
        let mut length = 0;
        loop {
            let mut line = String::new();
            assert!(self.screen.read_line(&mut line).expect("a line") > 0, "the server exited");
            match line.trim_end().split_once(": ") {
                Some(("Content-Length", number)) => length = number.parse().expect("a number"),
                Some(_) => {}
                None => break,
            }
        }
        let mut bytes = vec![0; length];
        self.screen.read_exact(&mut bytes).expect("a message");
        serde_json::from_slice(&bytes).expect("JSON")
    }

    /// Sends a request and returns its result.
    fn request(&mut self, method: &str, params: &Value) -> Value {
        self.next += 1;
        let id = self.next;
        self.send(&json!({ "jsonrpc": "2.0", "id": id, "method": method, "params": params }));
        loop {
            let mut message = self.receive();
            if message["id"] == id {
                assert_eq!(message.get("error"), None, "{message}");
                return message["result"].take();
            }
        }
    }

    /// The next diagnostics that satisfy `holds`.
    fn wait_for_diagnostics(&mut self, holds: impl Fn(&[Value]) -> bool) -> Vec<Value> {
        loop {
            let message = self.receive();
            if message["method"] == "textDocument/publishDiagnostics" {
                let list = message["params"]["diagnostics"].as_array().expect("a list").clone();
                if holds(&list) {
                    return list;
                }
            }
        }
    }

    fn change(&mut self, text: &str) {
        self.version += 1;
        let document = json!({ "uri": self.uri, "version": self.version });
        self.notify(
            "textDocument/didChange",
            &json!({ "textDocument": document, "contentChanges": [{ "text": text }] }),
        );
    }

    /// Changes the document to `text`, and sends a request at the position of `|`.
    fn request_at_cursor(&mut self, method: &str, text: &str) -> Value {
        let offset = text.find('|').expect("a cursor");
        self.change(&text.replacen('|', "", 1));
        let line = text[..offset].matches('\n').count();
        let character = text[..offset].rsplit('\n').next().expect("a line").encode_utf16().count();
        let position = json!({ "line": line, "character": character });
        self.request(method, &json!({ "textDocument": { "uri": self.uri }, "position": position }))
    }

    /// Labels of the completions at `|`, and the text inserted by the first completion.
    fn completions(&mut self, text: &str) -> (Vec<String>, String) {
        let answer = self.request_at_cursor("textDocument/completion", text);
        let items = answer.as_array().cloned().unwrap_or_default();
        let text = |item: &Value, name: &str| item[name].as_str().unwrap_or_default().to_owned();
        let first = items.first().map_or(String::new(), |item| text(item, "insertText"));
        (items.iter().map(|item| text(item, "label")).collect(), first)
    }
}

impl Drop for Editor {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn diagnostics_follow_edits_and_saves() {
    let mut editor = Editor::open(TEXT);
    assert_eq!(editor.wait_for_diagnostics(|_| true), [Value::Null; 0]);
    editor.change(&TEXT.replace("radius", "# ä\nraduis"));
    let list = editor.wait_for_diagnostics(|list| !list.is_empty());
    let unknown =
        list.iter().find(|one| one["message"].as_str().is_some_and(|text| text.contains("`raduis`")));
    let unknown = unknown.expect("the mistake");
    assert_eq!(
        unknown["range"],
        json!({ "start": { "line": 15, "character": 0 }, "end": { "line": 15, "character": 6 } })
    );
    assert_eq!((&unknown["severity"], &unknown["source"]), (&json!(1), &json!("glimt")));
    assert_mentions(unknown["message"].as_str().expect("text"), &["`radius`"]);
    // This file is not an image, which is detected only when the file is read.
    editor.dir.write("bricks.png", "no image");
    editor.change(TEXT);
    let uri = editor.uri.clone();
    editor.notify("textDocument/didSave", &json!({ "textDocument": { "uri": uri } }));
    let list = editor.wait_for_diagnostics(|list| {
        !list.is_empty() && !list[0]["message"].as_str().unwrap_or_default().contains("raduis")
    });
    assert!(list[0]["message"].as_str().is_some_and(|text| text.contains("bricks")), "{list:?}");
}

#[test]
fn completions_offer_keys_choices_and_names() {
    let mut editor = Editor::open(TEXT);
    let (keys, first) = editor.completions(&TEXT.replace("radius = 0.5", "r|"));
    assert_eq!(
        (keys.as_slice(), first.as_str()),
        (["radius", "name", "matrix"].map(str::to_owned).as_slice(), "radius = 0.5")
    );
    let (keys, _) = editor.completions(&TEXT.replace("color = [1, 0.5, 0]", "an|"));
    assert!(keys.contains(&"anisotropy".to_owned()) && !keys.contains(&"diffuse".to_owned()), "{keys:?}");
    let (types, first) = editor.completions(&TEXT.replace("\"metal\"", "|"));
    assert!(types.contains(&"glass".to_owned()) && first == "\"phong\"", "{types:?} {first}");
    assert_eq!(
        editor.completions(&TEXT.replace("\"wall\"", "\"|\"")),
        (vec!["wall".to_owned()], "wall".to_owned())
    );
    assert_eq!(editor.completions(&TEXT.replace("\"bricks\" }", "| }")).1, "\"bricks\"");
    let (heads, _) = editor.completions(&format!("{TEXT}\n[ren|"));
    assert!(heads.contains(&"[render]".to_owned()) && !heads.contains(&"[camera]".to_owned()), "{heads:?}");
    // A header completion replaces the typed text, including brackets closed by the editor.
    for (typed, label) in [("[ren|", "[render]"), ("[|]", "[render]"), ("[[sp|]]", "[[sphere]]")] {
        let items = editor.request_at_cursor("textDocument/completion", &format!("{TEXT}\n{typed}"));
        let items = items.as_array().expect("candidates");
        let item = items.iter().find(|item| item["label"] == label).expect(label);
        let range = &item["textEdit"]["range"];
        let length = typed.len() - 1;
        assert_eq!((&range["start"]["character"], &range["end"]["character"]), (&json!(0), &json!(length)));
        assert_eq!((&item["textEdit"]["newText"], &item["filterText"]), (&json!(label), &json!(label)));
    }
    assert_eq!(editor.completions(&TEXT.replace("0.5, 0]", "0.5, 0] # r|")).0, [""; 0]);
    // Lines within an array contain numbers, not keys.
    for typed in ["|", "1, 0,\n|\n]"] {
        let text = TEXT.replace("[[light]]", &format!("[[mesh]]\nmatrix = [\n{typed}"));
        assert_eq!(editor.completions(&text).0, [""; 0], "{text}");
    }
}

#[test]
fn hover_and_go_to_definition_work() {
    let mut editor = Editor::open(TEXT);
    let hover = editor.request_at_cursor("textDocument/hover", &TEXT.replace("roughness", "rough|ness"));
    let text = hover["contents"]["value"].as_str().expect("a text");
    assert!(["mirror", "`0.2`", "0 … 1"].iter().all(|fact| mentions(text, fact)), "{text}");
    assert_eq!(
        editor.request_at_cursor("textDocument/hover", &TEXT.replace("[[light]]", "|[[light]]")),
        Value::Null
    );
    let place = editor.request_at_cursor("textDocument/definition", &TEXT.replace("\"wall\"", "\"wa|ll\""));
    assert_eq!(place["uri"], editor.uri);
    assert_eq!(place["range"]["start"], json!({ "line": 7, "character": 11 }));
    let place =
        editor.request_at_cursor("textDocument/definition", &TEXT.replace("\"bricks\" }", "\"bri|cks\" }"));
    assert_eq!(place["range"]["start"], json!({ "line": 4, "character": 10 }));
    let text = format!("[[groups.stool.box]]\nmaterial = \"wa|ll\"\n[[instance]]\ngroup = \"stool\"\n{TEXT}");
    let place = editor.request_at_cursor("textDocument/definition", &text);
    assert_eq!(place["range"]["start"], json!({ "line": 11, "character": 11 }));
    let text = text.replace('|', "").replace("\"stool\"", "\"st|ool\"");
    let place = editor.request_at_cursor("textDocument/definition", &text);
    assert_eq!(place["range"]["start"], json!({ "line": 0, "character": 9 }));
}

#[test]
fn colors_are_shown_in_srgb_and_written_linear() {
    let text =
        TEXT.replace("[[light]]", "[[light]]\nintensity = \"tomato\"\n[[light]]\nintensity = \"#+12345\"");
    let mut editor = Editor::open(&text);
    let uri = editor.uri.clone();
    let colors = editor.request("textDocument/documentColor", &json!({ "textDocument": { "uri": uri } }));
    let [linear, named] = colors.as_array().expect("a list").as_slice() else { panic!("{colors}") };
    let parts =
        |color: &Value| ["red", "green", "blue"].map(|name| color["color"][name].as_f64().expect("a number"));
    // Linear 0.5 is 0.735 in sRGB (IEC 61966-2-1).
    let [red, green, blue] = parts(linear);
    assert!((red - 1.0).abs() < 1e-6 && (green - 0.7354).abs() < 1e-3 && blue == 0.0);
    assert_eq!(parts(named).map(|part| (part * 255.0).round()), [255.0, 99.0, 71.0]);
    let asked = json!({ "textDocument": { "uri": uri }, "range": linear["range"], "color": { "red": 1, "green": 0.5, "blue": 0, "alpha": 1 } });
    let texts = editor.request("textDocument/colorPresentation", &asked);
    assert_eq!(
        (&texts[0]["label"], &texts[1]["label"]),
        (&json!("\"#ff8000\""), &json!("[1.000, 0.216, 0.000]"))
    );
}

#[test]
fn server_exits_and_rejects_unknown_methods() {
    let mut editor = Editor::open(TEXT);
    assert_eq!(editor.request("shutdown", &Value::Null), Value::Null);
    editor.notify("exit", &Value::Null);
    assert!(editor.child.wait().expect("its end").success());
    let mut editor = Editor::open(TEXT);
    editor.next += 1;
    editor.send(&json!({ "jsonrpc": "2.0", "id": editor.next, "method": "workspace/symbol", "params": {} }));
    let unknown = loop {
        let message = editor.receive();
        if message["id"] == editor.next {
            break message;
        }
    };
    assert_eq!(unknown["error"]["code"], -32601);
}

/// Sends frames to a new server. Returns the exit code, stdout and stderr.
fn serve(frames: &[&str]) -> (Option<i32>, String, String) {
    let dir = TestDir::new();
    let mut process = dir.glimt("lsp");
    process.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = process.spawn().expect("it runs");
    let mut keys = child.stdin.take().expect("stdin");
    for frame in frames {
        let header = format!("Content-Length: {}\r\n\r\n", frame.len());
        let bytes = if frame.starts_with("Content-Length") { (*frame).to_owned() } else { header + frame };
        // The server may have exited before reading everything.
        let _ = keys.write_all(bytes.as_bytes());
    }
    drop(keys);
    let output = child.wait_with_output().expect("its end");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
    (output.status.code(), text(output.stdout), text(output.stderr))
}

const INITIALIZE: &str = r#"{"jsonrpc":"2.0","id":1,"method":"initialize","params":{"capabilities":{}}}"#;
const EXIT: &str = r#"{"jsonrpc":"2.0","method":"exit"}"#;
const SHUTDOWN: &str = r#"{"jsonrpc":"2.0","id":2,"method":"shutdown"}"#;
const HOVER: &str = r#"{"jsonrpc":"2.0","id":3,"method":"textDocument/hover","params":{}}"#;

#[test]
fn server_replies_to_malformed_messages() {
    let (code, said, _) =
        serve(&[INITIALIZE, "{no json", r#"{"jsonrpc":"2.0","id":"x"}"#, HOVER, SHUTDOWN, EXIT]);
    assert_eq!(code, Some(0), "{said}");
    for part in ["-32700", "-32600", r#""id":"x""#, r#""id":3,"result":null"#] {
        assert!(said.contains(part), "{part}: {said}");
    }
}

#[test]
fn server_exit_code_depends_on_shutdown() {
    let (code, said, _) = serve(&[INITIALIZE, SHUTDOWN, HOVER, EXIT]);
    assert!(code == Some(0) && said.contains("-32600") && said.contains(r#""id":3"#), "{said}");
    assert_eq!(serve(&[INITIALIZE, EXIT]).0, Some(1), "exit without shutdown must fail");
    assert!(serve(&[HOVER, EXIT]).1.contains("-32002"), "requests before initialize must fail");
}

#[test]
fn pipes_as_documents_do_not_block_the_server() {
    let dir = TestDir::new();
    let pipe = dir.path("pipe.toml");
    nix::unistd::mkfifo(&pipe, nix::sys::stat::Mode::S_IRWXU).expect("a pipe");
    let open = format!(
        r#"{{"jsonrpc":"2.0","method":"textDocument/didOpen","params":{{"textDocument":{{"uri":"file://{}","languageId":"toml","version":1,"text":""}}}}}}"#,
        pipe.display()
    );
    let (code, said, _) = serve(&[INITIALIZE, &open, SHUTDOWN, EXIT]);
    assert_eq!(code, Some(0), "{said}");
}

#[test]
fn excessive_content_length_is_an_error() {
    let (code, _, said) = serve(&[INITIALIZE, "Content-Length: 1000000000000\r\n\r\n{}"]);
    assert!(code == Some(1) && said.contains("1000000000000 bytes") && said.lines().count() == 1, "{said}");
}

#[test]
fn invalid_text_and_range_edits_are_handled() {
    let mut editor = Editor::open(TEXT);
    // An unpaired surrogate counts as one character.
    let document = json!({ "uri": editor.uri, "version": 2 });
    let change = json!({ "textDocument": document, "contentChanges": [{ "text": "# HALF\nx = 1\n" }] });
    let message =
        json!({ "jsonrpc": "2.0", "method": "textDocument/didChange", "params": change }).to_string();
    let message = message.replace("HALF", "\\ud83d");
    write!(editor.keys, "Content-Length: {}\r\n\r\n{message}", message.len()).expect("sent");
    editor.wait_for_diagnostics(|list| {
        list.iter().any(|one| one["message"].as_str().is_some_and(|text| text.contains('x')))
    });
    // A file with a NUL is binary, which is the only error, as in `glimt check`.
    editor.change("a\0b = = 1\n");
    let list = editor.wait_for_diagnostics(|list| {
        list.iter().any(|one| one["message"].as_str().is_some_and(|text| text.contains("binary")))
    });
    assert_eq!(list.len(), 1, "{list:?}");
    // Range edits are not supported.
    let start = json!({ "line": 0, "character": 0 });
    let change = json!({ "range": { "start": start, "end": start }, "text": "y" });
    editor.notify("textDocument/didChange", &json!({ "textDocument": document, "contentChanges": [change] }));
    let message = editor.receive();
    assert_eq!(message["method"], "window/logMessage", "{message}");
}
