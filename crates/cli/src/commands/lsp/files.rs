//! A thread that checks the files referenced by open documents.
//!
//! All documents share one thread and one checker, which does not read unchanged files again. Only the newest
//! request for each document is kept. It cancels the document's previous request if that is still running.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use lsp_types::{Diagnostic, Uri};

use super::diagnostics;
use super::document::OpenDocument;
use crate::control::CancelToken;
use crate::pipeline::IncrementalSceneChecker;
use crate::system::threads::spawn;

/// A thread that checks files until the handle is dropped.
pub(super) struct FileCheckThread {
    shared: Arc<CheckQueue>,
    thread: Option<JoinHandle<()>>,
}

/// The requests, and a condition variable that signals changes to them.
#[derive(Default)]
struct CheckQueue {
    requests: Mutex<CheckRequests>,
    changed: Condvar,
}

/// The pending requests and the running request.
#[derive(Default)]
struct CheckRequests {
    /// Pending requests in order of arrival, at most one per document.
    waiting: VecDeque<(Uri, OpenDocument)>,
    running: Option<(Uri, CancelToken)>,
    is_over: bool,
}

impl FileCheckThread {
    /// Starts a thread that passes diagnostics to `publish`, or returns `None` if no thread can be created.
    pub(super) fn start(
        publish: impl Fn(Uri, &OpenDocument, Vec<Diagnostic>) + Send + 'static,
    ) -> Option<Self> {
        let shared = Arc::<CheckQueue>::default();
        let work = Arc::clone(&shared);
        let read = move || {
            let mut checker = IncrementalSceneChecker::default();
            while let Some((uri, document, token)) = work.wait_for_request() {
                if let Some(found) = diagnostics::scene_and_asset_diagnostics(&document, &mut checker, &token)
                {
                    publish(uri, &document, found);
                }
            }
        };
        let thread = spawn("files", read).ok()?;
        Some(Self { shared, thread: Some(thread) })
    }

    /// Queues a check of a document's files.
    pub(super) fn queue_check(&self, uri: Uri, document: OpenDocument) {
        self.shared.lock().enqueue_latest(uri, document);
        self.shared.changed.notify_one();
    }
}

impl Drop for FileCheckThread {
    fn drop(&mut self) {
        self.shared.lock().shut_down();
        self.shared.changed.notify_one();
        if let Some(thread) = self.thread.take() {
            // Ignore a panic in the thread.
            let _ = thread.join();
        }
    }
}

impl CheckQueue {
    fn lock(&self) -> MutexGuard<'_, CheckRequests> {
        self.requests.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for the next request. Returns `None` after [`CheckRequests::shut_down`].
    fn wait_for_request(&self) -> Option<(Uri, OpenDocument, CancelToken)> {
        let mut requests = self.lock();
        requests.running = None;
        let is_idle = |requests: &mut CheckRequests| requests.waiting.is_empty() && !requests.is_over;
        let mut requests = self.changed.wait_while(requests, is_idle).unwrap_or_else(PoisonError::into_inner);
        requests.dequeue_and_mark_running()
    }
}

impl CheckRequests {
    fn enqueue_latest(&mut self, uri: Uri, document: OpenDocument) {
        if let Some((_, token)) = self.running.as_ref().filter(|(running, _)| *running == uri) {
            token.cancel();
        }
        self.waiting.retain(|(waiting, _)| *waiting != uri);
        self.waiting.push_back((uri, document));
    }

    fn dequeue_and_mark_running(&mut self) -> Option<(Uri, OpenDocument, CancelToken)> {
        let (uri, document) = self.waiting.pop_front().filter(|_| !self.is_over)?;
        let token = CancelToken::new();
        self.running = Some((uri.clone(), token.clone()));
        Some((uri, document, token))
    }

    fn shut_down(&mut self) {
        self.is_over = true;
        if let Some((_, token)) = &self.running {
            token.cancel();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_newest_request_per_document_is_kept() {
        let uri = |name: &str| name.parse::<Uri>().expect("an address");
        let document = |version| OpenDocument::new("a.toml".into(), version, String::new());
        let mut requests = CheckRequests::default();
        requests.enqueue_latest(uri("file:///a"), document(1));
        let (_, _, first) = requests.dequeue_and_mark_running().expect("a request");
        for (name, version) in [("file:///b", 1), ("file:///a", 2), ("file:///a", 3)] {
            requests.enqueue_latest(uri(name), document(version));
        }
        assert!(first.is_canceled(), "a newer request replaces it");
        let mut next = || {
            requests.dequeue_and_mark_running().map(|(uri, document, _)| (uri.to_string(), document.version))
        };
        assert_eq!(next(), Some(("file:///b".to_owned(), 1)));
        assert_eq!(next(), Some(("file:///a".to_owned(), 3)));
        assert_eq!(next(), None);
        requests.enqueue_latest(uri("file:///b"), document(2));
        let (_, _, last) = requests.dequeue_and_mark_running().expect("a request");
        requests.enqueue_latest(uri("file:///c"), document(1));
        assert!(!last.is_canceled());
        requests.shut_down();
        assert!(last.is_canceled() && requests.dequeue_and_mark_running().is_none());
    }
}
