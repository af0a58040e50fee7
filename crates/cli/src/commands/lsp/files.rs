//! The thread that reads the files which texts name.
//!
//! One thread reads for all texts, with one checker, so that what has not changed is not read again. Of each text only the newest
//! request waits, and it cancels an older one that is under way.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use lsp_types::{Diagnostic, Uri};

use super::diagnostics;
use super::document::Document;
use crate::control::CancelToken;
use crate::pipeline::Checker;

/// A thread that reads files, until it is dropped.
pub(super) struct FileThread {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

/// Requests, and a signal that they have changed.
#[derive(Default)]
struct Shared {
    requests: Mutex<Requests>,
    changed: Condvar,
}

/// Requests that wait, and the one under way.
#[derive(Default)]
struct Requests {
    /// At most one for each text, in the order of their coming.
    waiting: VecDeque<(Uri, Document)>,
    running: Option<(Uri, CancelToken)>,
    is_over: bool,
}

impl FileThread {
    /// Starts a thread that gives what it finds to a function. `None` if the system has no thread left.
    pub(super) fn start(publish: impl Fn(Uri, &Document, Vec<Diagnostic>) + Send + 'static) -> Option<Self> {
        let shared = Arc::<Shared>::default();
        let work = Arc::clone(&shared);
        let read = move || {
            let mut checker = Checker::default();
            while let Some((uri, document, token)) = work.next() {
                if let Some(found) = diagnostics::of_files(&document, &mut checker, &token) {
                    publish(uri, &document, found);
                }
            }
        };
        let thread = std::thread::Builder::new().name("files".to_owned()).spawn(read).ok()?;
        Some(Self { shared, thread: Some(thread) })
    }

    /// Reads the files of a text, after those of texts that came before.
    pub(super) fn read(&self, uri: Uri, document: Document) {
        self.shared.lock().put(uri, document);
        self.shared.changed.notify_one();
    }
}

impl Drop for FileThread {
    fn drop(&mut self) {
        self.shared.lock().end();
        self.shared.changed.notify_one();
        if let Some(thread) = self.thread.take() {
            // What a thread that died was to say is not missed any more.
            let _ = thread.join();
        }
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Requests> {
        self.requests.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for the next request. `None` at the end.
    fn next(&self) -> Option<(Uri, Document, CancelToken)> {
        let mut requests = self.lock();
        requests.running = None;
        let is_idle = |requests: &mut Requests| requests.waiting.is_empty() && !requests.is_over;
        let mut requests = self.changed.wait_while(requests, is_idle).unwrap_or_else(PoisonError::into_inner);
        requests.take()
    }
}

impl Requests {
    fn put(&mut self, uri: Uri, document: Document) {
        if let Some((_, token)) = self.running.as_ref().filter(|(running, _)| *running == uri) {
            token.cancel();
        }
        self.waiting.retain(|(waiting, _)| *waiting != uri);
        self.waiting.push_back((uri, document));
    }

    fn take(&mut self) -> Option<(Uri, Document, CancelToken)> {
        let (uri, document) = self.waiting.pop_front().filter(|_| !self.is_over)?;
        let token = CancelToken::new();
        self.running = Some((uri.clone(), token.clone()));
        Some((uri, document, token))
    }

    fn end(&mut self) {
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
    fn the_newest_request_of_each_text_is_the_only_one() {
        let uri = |name: &str| name.parse::<Uri>().expect("an address");
        let document = |version| Document::new("a.toml".into(), version, String::new());
        let mut requests = Requests::default();
        requests.put(uri("file:///a"), document(1));
        let (_, _, first) = requests.take().expect("a request");
        for (name, version) in [("file:///b", 1), ("file:///a", 2), ("file:///a", 3)] {
            requests.put(uri(name), document(version));
        }
        assert!(first.is_cancelled(), "a newer one of the same text came");
        let mut next = || requests.take().map(|(uri, document, _)| (uri.to_string(), document.version));
        assert_eq!(next(), Some(("file:///b".to_owned(), 1)));
        assert_eq!(next(), Some(("file:///a".to_owned(), 3)));
        assert_eq!(next(), None);
        requests.put(uri("file:///b"), document(2));
        let (_, _, last) = requests.take().expect("a request");
        requests.put(uri("file:///c"), document(1));
        assert!(!last.is_cancelled());
        requests.end();
        assert!(last.is_cancelled() && requests.take().is_none());
    }
}
