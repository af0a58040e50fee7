//! `glimt lsp`: a language server for scenes, over stdin and stdout.
//!
//! The client sends a whole text with every change. Each text is parsed at once, which finds what stands in it; the files that it
//! names are read when it is opened and saved, on one thread for all texts.

mod colors;
mod complete;
mod diagnostics;
mod document;
mod files;
mod look;
mod place;
mod wire;

use std::collections::HashMap;
use std::io::BufRead;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use lsp_server::{ErrorCode, Message, Notification, Request, RequestId, Response};
use lsp_types::notification::{
    DidChangeTextDocument, DidCloseTextDocument, DidOpenTextDocument, DidSaveTextDocument, Exit as Exited,
    LogMessage, Notification as _, PublishDiagnostics,
};
use lsp_types::request::{
    ColorPresentationRequest, Completion, DocumentColor, GotoDefinition, HoverRequest, Initialize,
    Request as _, Shutdown,
};
use lsp_types::{
    Diagnostic, DidChangeTextDocumentParams, DidCloseTextDocumentParams, DidOpenTextDocumentParams,
    DidSaveTextDocumentParams, LogMessageParams, MessageType, PublishDiagnosticsParams,
    TextDocumentPositionParams, Uri,
};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use self::document::Document;
use self::files::FileThread;
use self::wire::{Client, Received};
use crate::console::Console;
use crate::exit::Exit;

/// Serves until the client ends it, or its end of stdin is closed. Without a request to shut down before, that it ends is a failure,
/// as the protocol has it.
pub(crate) fn run(console: &Console) -> Exit {
    match serve(&mut std::io::stdin().lock(), &Client::new(std::io::stdout())) {
        Ok(exit) => exit,
        Err(message) => console.fail(Exit::FAILED, &format!("language server: {message}")),
    }
}

fn capabilities() -> Value {
    json!({
        "capabilities": {
            "textDocumentSync": { "openClose": true, "change": 1, "save": { "includeText": false } },
            "completionProvider": { "triggerCharacters": ["[", ".", "\"", "="] },
            "hoverProvider": true,
            "definitionProvider": true,
            "colorProvider": true,
        },
        "serverInfo": { "name": "glimt", "version": env!("CARGO_PKG_VERSION") },
    })
}

/// Part of a server's life.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// The client has not said yet what it can.
    New,
    /// It serves.
    Serving,
    /// It waits for its end.
    ShutDown,
}

fn serve(from: &mut impl BufRead, client: &Client) -> Result<Exit, String> {
    let documents = Documents::default();
    let (open, to) = (Arc::clone(&documents), client.clone());
    let publish = move |uri, document: &Document, found| {
        publish_if_current(&open, |message| to.send(&message), uri, document, found);
    };
    let files = FileThread::start(publish);
    let mut server = Server { client, documents, files };
    let mut phase = Phase::New;
    while let Some(received) = wire::read(from)? {
        match received {
            Received::Wrong(answer) => client.refuse(&answer),
            Received::Message(Message::Request(request)) => {
                let response = server.respond(request, &mut phase);
                server.send(&response.into());
            }
            Received::Message(Message::Notification(one)) => match (one.method.as_str(), phase) {
                (Exited::METHOD, Phase::ShutDown) => return Ok(Exit::DONE),
                (Exited::METHOD, Phase::New | Phase::Serving) => return Ok(Exit::FAILED),
                (_, Phase::Serving) => server.hear(one),
                (_, Phase::New | Phase::ShutDown) => {}
            },
            // The server asks nothing.
            Received::Message(Message::Response(_)) => {}
        }
    }
    Ok(Exit::DONE)
}

/// Open texts by their addresses.
type Documents = Arc<Mutex<HashMap<String, Document>>>;

struct Server<'c> {
    client: &'c Client,
    documents: Documents,
    /// Reads files. `None` without a thread for it: then the mistakes of the texts alone are shown.
    files: Option<FileThread>,
}

impl Server<'_> {
    fn documents(&self) -> MutexGuard<'_, HashMap<String, Document>> {
        self.documents.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn send(&self, message: &Message) {
        self.client.send(message);
    }

    /// The answer to a request in a phase, which it may change.
    fn respond(&self, request: Request, phase: &mut Phase) -> Response {
        let refused = |id, code: ErrorCode, why: &str| Response::new_err(id, code as i32, why.to_owned());
        match (request.method.as_str(), *phase) {
            (Initialize::METHOD, Phase::New) => {
                *phase = Phase::Serving;
                Response::new_ok(request.id, capabilities())
            }
            (_, Phase::New) => {
                refused(request.id, ErrorCode::ServerNotInitialized, "`initialize` comes first")
            }
            (Initialize::METHOD, Phase::Serving) => {
                refused(request.id, ErrorCode::InvalidRequest, "the server is initialized already")
            }
            (Shutdown::METHOD, Phase::Serving) => {
                *phase = Phase::ShutDown;
                Response::new_ok(request.id, Value::Null)
            }
            (_, Phase::Serving) => self.answer(request),
            (_, Phase::ShutDown) => {
                refused(request.id, ErrorCode::InvalidRequest, "the server is shut down and waits for `exit`")
            }
        }
    }

    fn answer(&self, request: Request) -> Response {
        let Request { id, method, params } = request;
        let found = match method.as_str() {
            Completion::METHOD => self.at(params, complete::complete),
            HoverRequest::METHOD => self.at(params, look::hover),
            GotoDefinition::METHOD => {
                let uri = params["textDocument"]["uri"].clone();
                self.at(params, look::definition).map(|range| json!({ "uri": uri, "range": range }))
            }
            DocumentColor::METHOD => self.on(&params, colors::all),
            ColorPresentationRequest::METHOD => colors::presentations(&params),
            _ => return unknown(id, &method),
        };
        match found {
            Some(value) => Response::new_ok(id, value),
            None => Response::new_ok(id, Value::Null),
        }
    }

    /// The answer of a function about a place in a document. `None` if it has none.
    fn at(&self, params: Value, look: impl FnOnce(&Document, usize) -> Option<Value>) -> Option<Value> {
        let TextDocumentPositionParams { text_document, position } = serde_json::from_value(params).ok()?;
        let documents = self.documents();
        let document = documents.get(text_document.uri.as_str())?;
        look(document, document.offset(position))
    }

    /// The answer of a function about a document. `None` if the document is not open.
    fn on(&self, params: &Value, look: impl FnOnce(&Document) -> Value) -> Option<Value> {
        let uri = params["textDocument"]["uri"].as_str()?;
        self.documents().get(uri).map(look)
    }

    fn hear(&mut self, notification: Notification) {
        let Notification { method, params } = notification;
        match method.as_str() {
            DidOpenTextDocument::METHOD => {
                if let Some(DidOpenTextDocumentParams { text_document: one }) = read(params) {
                    self.put(&one.uri, one.version, one.text);
                    self.read_files(&one.uri);
                }
            }
            DidChangeTextDocument::METHOD => {
                if let Some(DidChangeTextDocumentParams { text_document, mut content_changes }) = read(params)
                {
                    if content_changes.iter().any(|change| change.range.is_some()) {
                        self.note("a change of a range is left out: this server takes whole texts");
                    } else if let Some(last) = content_changes.pop() {
                        self.put(&text_document.uri, text_document.version, last.text);
                    }
                }
            }
            DidSaveTextDocument::METHOD => {
                if let Some(DidSaveTextDocumentParams { text_document, .. }) = read(params) {
                    self.read_files(&text_document.uri);
                }
            }
            DidCloseTextDocument::METHOD => {
                if let Some(DidCloseTextDocumentParams { text_document }) = read(params) {
                    self.documents().remove(text_document.uri.as_str());
                    self.send(&published(text_document.uri, None, Vec::new()));
                }
            }
            _ => {}
        }
    }

    /// Writes an error into the client's log.
    fn note(&self, message: &str) {
        let params = LogMessageParams { typ: MessageType::ERROR, message: message.to_owned() };
        self.send(&Notification::new(LogMessage::METHOD.to_owned(), params).into());
    }

    /// Takes a text, and says what is wrong in it.
    fn put(&self, uri: &Uri, version: i32, text: String) {
        let document = Document::new(path(uri), version, text);
        let found = diagnostics::of_text(&document);
        self.documents().insert(uri.as_str().to_owned(), document);
        self.send(&published(uri.clone(), Some(version), found));
    }

    /// Has the files be read that a text names.
    fn read_files(&self, uri: &Uri) {
        let document = self.documents().get(uri.as_str()).cloned();
        if let (Some(files), Some(document)) = (&self.files, document) {
            files.read(uri.clone(), document);
        }
    }
}

/// Says what is wrong with a text and its files, unless the text is another by now.
fn publish_if_current(
    documents: &Documents,
    send: impl FnOnce(Message),
    uri: Uri,
    document: &Document,
    found: Vec<Diagnostic>,
) {
    let documents = documents.lock().unwrap_or_else(PoisonError::into_inner);
    if documents.get(uri.as_str()).is_some_and(|now| now.version == document.version) {
        send(published(uri, Some(document.version), found));
    }
}

fn read<P: DeserializeOwned>(params: Value) -> Option<P> {
    serde_json::from_value(params).ok()
}

/// The message with all mistakes of a text.
fn published(uri: Uri, version: Option<i32>, diagnostics: Vec<Diagnostic>) -> Message {
    let params = PublishDiagnosticsParams { uri, diagnostics, version };
    Notification::new(PublishDiagnostics::METHOD.to_owned(), params).into()
}

fn unknown(id: RequestId, method: &str) -> Response {
    Response::new_err(id, ErrorCode::MethodNotFound as i32, format!("{method} is not served"))
}

/// The path of a file by its address; other addresses have a path that no file has.
fn path(uri: &Uri) -> PathBuf {
    let decoded = uri.path().as_estr().decode().into_string();
    decoded.map_or_else(|_| PathBuf::from(uri.as_str()), |path| PathBuf::from(path.into_owned()))
}
