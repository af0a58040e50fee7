//! `glimt lsp`: a language server for scenes, on stdin and stdout.
//!
//! The client sends the full document with every change, and the server parses it immediately. When a
//! document is opened or saved, a separate thread checks the files it references.

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

use self::document::OpenDocument;
use self::files::FileCheckThread;
use self::wire::{ClientWriter, ReceivedFrame};
use crate::console::Console;
use crate::exit::Exit;

/// Runs the server until the client sends `exit` or closes stdin. `exit` without a preceding `shutdown` is a
/// failure, as the protocol requires.
pub(crate) fn run(console: &Console) -> Exit {
    match serve(&mut std::io::stdin().lock(), &ClientWriter::new(std::io::stdout())) {
        Ok(exit) => exit,
        Err(message) => console.print_error(Exit::FAILED, &format!("language server: {message}")),
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

/// The server's lifecycle phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ServerPhase {
    /// Before `initialize`.
    New,
    /// Serving requests.
    Serving,
    /// After `shutdown`, before `exit`.
    ShutDown,
}

fn serve(from: &mut impl BufRead, client: &ClientWriter) -> Result<Exit, String> {
    let documents = Documents::default();
    let (open, to) = (Arc::clone(&documents), client.clone());
    let publish = move |uri, document: &OpenDocument, found| {
        publish_if_current(&open, |message| to.send(&message), uri, document, found);
    };
    let files = FileCheckThread::start(publish);
    let mut server = Server { client, documents, files };
    let mut phase = ServerPhase::New;
    while let Some(received) = wire::read_frame(from)? {
        match received {
            ReceivedFrame::Invalid(answer) => client.send_error(&answer),
            ReceivedFrame::Message(Message::Request(request)) => {
                let response = server.handle_request(request, &mut phase);
                server.send(&response.into());
            }
            ReceivedFrame::Message(Message::Notification(one)) => match (one.method.as_str(), phase) {
                (Exited::METHOD, ServerPhase::ShutDown) => return Ok(Exit::DONE),
                (Exited::METHOD, ServerPhase::New | ServerPhase::Serving) => return Ok(Exit::FAILED),
                (_, ServerPhase::Serving) => server.handle_notification(one),
                (_, ServerPhase::New | ServerPhase::ShutDown) => {}
            },
            // The server sends no requests, so it expects no responses.
            ReceivedFrame::Message(Message::Response(_)) => {}
        }
    }
    Ok(Exit::DONE)
}

/// Open documents by URI.
type Documents = Arc<Mutex<HashMap<String, OpenDocument>>>;

struct Server<'c> {
    client: &'c ClientWriter,
    documents: Documents,
    /// The thread that checks referenced files. If it could not be started, this is `None`, and only the
    /// documents themselves are checked.
    files: Option<FileCheckThread>,
}

impl Server<'_> {
    fn lock_documents(&self) -> MutexGuard<'_, HashMap<String, OpenDocument>> {
        self.documents.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn send(&self, message: &Message) {
        self.client.send(message);
    }

    /// Responds to a request and updates the phase.
    fn handle_request(&self, request: Request, phase: &mut ServerPhase) -> Response {
        let refused = |id, code: ErrorCode, why: &str| Response::new_err(id, code as i32, why.to_owned());
        match (request.method.as_str(), *phase) {
            (Initialize::METHOD, ServerPhase::New) => {
                *phase = ServerPhase::Serving;
                Response::new_ok(request.id, capabilities())
            }
            (_, ServerPhase::New) => {
                refused(request.id, ErrorCode::ServerNotInitialized, "`initialize` must be the first request")
            }
            (Initialize::METHOD, ServerPhase::Serving) => {
                refused(request.id, ErrorCode::InvalidRequest, "the server is already initialized")
            }
            (Shutdown::METHOD, ServerPhase::Serving) => {
                *phase = ServerPhase::ShutDown;
                Response::new_ok(request.id, Value::Null)
            }
            (_, ServerPhase::Serving) => self.dispatch_request(request),
            (_, ServerPhase::ShutDown) => refused(
                request.id,
                ErrorCode::InvalidRequest,
                "the server is shut down; only `exit` is allowed",
            ),
        }
    }

    fn dispatch_request(&self, request: Request) -> Response {
        let Request { id, method, params } = request;
        let found = match method.as_str() {
            Completion::METHOD => self.with_document_at(params, complete::complete),
            HoverRequest::METHOD => self.with_document_at(params, look::hover),
            GotoDefinition::METHOD => {
                let uri = params["textDocument"]["uri"].clone();
                self.with_document_at(params, look::definition)
                    .map(|range| json!({ "uri": uri, "range": range }))
            }
            DocumentColor::METHOD => self.with_document(&params, colors::document_colors),
            ColorPresentationRequest::METHOD => colors::color_presentations(&params),
            _ => return unknown_method_response(id, &method),
        };
        match found {
            Some(value) => Response::new_ok(id, value),
            None => Response::new_ok(id, Value::Null),
        }
    }

    /// Calls a function with the document and byte offset in `params`. Returns `None` if the document is not
    /// open.
    fn with_document_at(
        &self,
        params: Value,
        look: impl FnOnce(&OpenDocument, usize) -> Option<Value>,
    ) -> Option<Value> {
        let TextDocumentPositionParams { text_document, position } = serde_json::from_value(params).ok()?;
        let documents = self.lock_documents();
        let document = documents.get(text_document.uri.as_str())?;
        look(document, document.offset(position))
    }

    /// Calls a function with the document in `params`. Returns `None` if the document is not open.
    fn with_document(&self, params: &Value, look: impl FnOnce(&OpenDocument) -> Value) -> Option<Value> {
        let uri = params["textDocument"]["uri"].as_str()?;
        self.lock_documents().get(uri).map(look)
    }

    fn handle_notification(&mut self, notification: Notification) {
        let Notification { method, params } = notification;
        match method.as_str() {
            DidOpenTextDocument::METHOD => {
                if let Some(DidOpenTextDocumentParams { text_document: one }) = params_if_valid(params) {
                    self.store_and_diagnose_document(&one.uri, one.version, one.text);
                    self.queue_referenced_files_check(&one.uri);
                }
            }
            DidChangeTextDocument::METHOD => {
                if let Some(DidChangeTextDocumentParams { text_document, mut content_changes }) =
                    params_if_valid(params)
                {
                    if content_changes.iter().any(|change| change.range.is_some()) {
                        self.log_error(
                            "ignored an incremental change: this server needs full text synchronization",
                        );
                    } else if let Some(last) = content_changes.pop() {
                        self.store_and_diagnose_document(
                            &text_document.uri,
                            text_document.version,
                            last.text,
                        );
                    }
                }
            }
            DidSaveTextDocument::METHOD => {
                if let Some(DidSaveTextDocumentParams { text_document, .. }) = params_if_valid(params) {
                    self.queue_referenced_files_check(&text_document.uri);
                }
            }
            DidCloseTextDocument::METHOD => {
                if let Some(DidCloseTextDocumentParams { text_document }) = params_if_valid(params) {
                    self.lock_documents().remove(text_document.uri.as_str());
                    self.send(&diagnostics_notification(text_document.uri, None, Vec::new()));
                }
            }
            _ => {}
        }
    }

    /// Writes an error to the client's log.
    fn log_error(&self, message: &str) {
        let params = LogMessageParams { typ: MessageType::ERROR, message: message.to_owned() };
        self.send(&Notification::new(LogMessage::METHOD.to_owned(), params).into());
    }

    /// Stores a document and publishes its diagnostics.
    fn store_and_diagnose_document(&self, uri: &Uri, version: i32, text: String) {
        let document = OpenDocument::new(uri_to_path(uri), version, text);
        let found = diagnostics::text_diagnostics(&document);
        self.lock_documents().insert(uri.as_str().to_owned(), document);
        self.send(&diagnostics_notification(uri.clone(), Some(version), found));
    }

    /// Queues a check of the files referenced by a document.
    fn queue_referenced_files_check(&self, uri: &Uri) {
        let document = self.lock_documents().get(uri.as_str()).cloned();
        if let (Some(files), Some(document)) = (&self.files, document) {
            files.queue_check(uri.clone(), document);
        }
    }
}

/// Publishes the diagnostics for a document and its files, unless the document has changed.
fn publish_if_current(
    documents: &Documents,
    send: impl FnOnce(Message),
    uri: Uri,
    document: &OpenDocument,
    found: Vec<Diagnostic>,
) {
    let documents = documents.lock().unwrap_or_else(PoisonError::into_inner);
    if documents.get(uri.as_str()).is_some_and(|now| now.version == document.version) {
        send(diagnostics_notification(uri, Some(document.version), found));
    }
}

fn params_if_valid<P: DeserializeOwned>(params: Value) -> Option<P> {
    serde_json::from_value(params).ok()
}

/// Creates the notification that publishes a document's diagnostics.
fn diagnostics_notification(uri: Uri, version: Option<i32>, diagnostics: Vec<Diagnostic>) -> Message {
    let params = PublishDiagnosticsParams { uri, diagnostics, version };
    Notification::new(PublishDiagnostics::METHOD.to_owned(), params).into()
}

fn unknown_method_response(id: RequestId, method: &str) -> Response {
    Response::new_err(id, ErrorCode::MethodNotFound as i32, format!("unsupported method {method}"))
}

/// Returns the path in a file URI, or a nonexistent path for other URIs.
fn uri_to_path(uri: &Uri) -> PathBuf {
    let decoded = uri.path().as_estr().decode().into_string();
    decoded.map_or_else(|_| PathBuf::from(uri.as_str()), |path| PathBuf::from(path.into_owned()))
}
