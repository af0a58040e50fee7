//! The mailbox of a worker thread.
//!
//! The mailbox has room for one pending request. A newer request replaces it and cancels the current request.
//! A single lock protects the token and the mailbox, so that no cancellation is lost between requests.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use crate::control::CancelToken;
use crate::key_overrides::KeyboardOverrides;
use crate::protocol::{Command, Event, Failure, PreviewBounds, Request, WriteRequirement};
use crate::queries::QueryOrEdit;
use crate::render::checkpointer::Interruption;
use crate::render::commands::PendingCommands;
use crate::sink::EventListener;

/// Sends commands to a worker.
#[derive(Clone)]
pub struct CommandSender {
    mailbox: Arc<(Mutex<Mailbox>, Condvar)>,
    pub(super) listener: EventListener,
}

#[derive(Debug, Default)]
struct Mailbox {
    request: Option<Box<Request>>,
    write: bool,
    /// Whether a write command is postponed until the pending request runs.
    is_write_postponed: bool,
    /// Whether a write command arrived after the pending request and therefore applies to it.
    is_write_of_waiting: bool,
    /// The current request's overrides that the user can change with keys.
    shown: KeyboardOverrides,
    /// Pending preview size change.
    preview: Option<Option<PreviewBounds>>,
    queries: VecDeque<QueryOrEdit>,
    /// Whether the newest request is paused.
    paused: bool,
    /// Whether the current render is being stopped so that it can be resumed later.
    suspended: bool,
    quit: bool,
    /// Cancels or pauses the current request.
    token: CancelToken,
    /// Cancels the write stage. It is separate because a finished image must be written even if the user
    /// pauses or quits, or a request without output arrives.
    writing: CancelToken,
    /// Generation of the newest request.
    newest: u64,
}

/// The next task for the worker.
pub(super) enum Task {
    /// A request, with the tokens for the render and the write stage.
    Render(Box<Request>, CancelToken, CancelToken),
    Write,
    Preview(Option<PreviewBounds>, CancelToken),
    Query(QueryOrEdit),
    Quit,
}

impl CommandSender {
    /// Creates an empty mailbox.
    pub(super) fn new(listener: EventListener) -> Self {
        Self { mailbox: Arc::default(), listener }
    }

    /// Sends a command without blocking.
    pub fn send(&self, command: Command) {
        let mut mailbox = self.lock();
        match command {
            Command::Render(request) => self.replace_older_pending_request(&mut mailbox, request),
            Command::Write => {
                mailbox.write = true;
                mailbox.is_write_of_waiting = mailbox.request.is_some();
            }
            Command::Preview(size) => mailbox.preview = Some(size),
            Command::KeepCamera(camera) => mailbox.queries.push_back(QueryOrEdit::KeepCamera(camera)),
            Command::UndoCamera(edit) => mailbox.queries.push_back(QueryOrEdit::UndoCamera(edit)),
            Command::Pick(position) => {
                mailbox.queries.retain(|query| !matches!(query, QueryOrEdit::Pick(_)));
                mailbox.queries.push_back(QueryOrEdit::Pick(position));
            }
            Command::Cancel => {
                mailbox.token.cancel();
                mailbox.writing.cancel();
                let dropped = mailbox.request.take();
                self.report_request_canceled(dropped);
            }
            Command::Suspend => {
                mailbox.suspended = true;
                mailbox.token.cancel();
                let dropped = mailbox.request.take();
                self.report_request_canceled(dropped);
            }
            Command::Pause(paused) => {
                mailbox.paused = paused;
                mailbox.token.set_paused(paused);
            }
            Command::Quit => {
                mailbox.token.cancel();
                mailbox.request = None;
                mailbox.quit = true;
            }
        }
        drop(mailbox);
        self.mailbox.1.notify_all();
    }

    /// Replaces the pending request unless the pending one is newer. Requests may arrive in any order.
    fn replace_older_pending_request(&self, mailbox: &mut Mailbox, request: Box<Request>) {
        if request.generation < mailbox.newest {
            return self.report_request_canceled(Some(request));
        }
        mailbox.newest = request.generation;
        mailbox.token.cancel();
        if request.write != WriteRequirement::No {
            mailbox.writing.cancel();
        }
        (mailbox.paused, mailbox.preview) = (false, None);
        let replaced = mailbox.request.replace(request);
        self.report_request_canceled(replaced);
    }

    fn report_request_canceled(&self, request: Option<Box<Request>>) {
        if let Some(request) = request {
            (self.listener)(Event::Canceled { generation: request.generation });
        }
    }

    /// Reports the newest request as failed.
    pub(super) fn report_newest_failed(&self, failure: Failure) {
        let generation = self.lock().newest;
        (self.listener)(Event::Failed { generation, failure });
    }

    fn lock(&self) -> MutexGuard<'_, Mailbox> {
        self.mailbox.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Postpones a write command until the pending request runs if the command was meant for that request, or
    /// if the current image is incomplete and the pending request has the same settings. Returns whether the
    /// command was postponed.
    pub(super) fn try_postpone_write_to_pending(&self, can_write: bool) -> bool {
        let mut mailbox = self.lock();
        let is_meant = mailbox.is_write_of_waiting;
        let postponed = mailbox.request.as_ref().is_some_and(|request| {
            is_meant || !can_write && KeyboardOverrides::from_overrides(&request.overrides) == mailbox.shown
        });
        (mailbox.write, mailbox.is_write_postponed) = (postponed, postponed);
        postponed
    }

    pub(super) fn wait_for_next_task(&self) -> Task {
        let mut mailbox = self.lock();
        loop {
            // Carry out a write command that arrived before the quit command.
            if mailbox.write && !(mailbox.is_write_postponed && mailbox.request.is_some()) {
                mailbox.write = false;
                return Task::Write;
            }
            if mailbox.quit {
                return Task::Quit;
            }
            if let Some(query) = mailbox.queries.pop_front() {
                return Task::Query(query);
            }
            mailbox.is_write_postponed = false;
            if let Some(request) = mailbox.request.take() {
                (mailbox.token, mailbox.writing) = (CancelToken::new(), CancelToken::new());
                mailbox.is_write_of_waiting = false;
                mailbox.shown = KeyboardOverrides::from_overrides(&request.overrides);
                mailbox.token.set_paused(mailbox.paused);
                return Task::Render(request, mailbox.token.clone(), mailbox.writing.clone());
            }
            if let Some(size) = mailbox.preview.take() {
                mailbox.token = CancelToken::new();
                return Task::Preview(size, mailbox.token.clone());
            }
            mailbox = self.mailbox.1.wait(mailbox).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

impl PendingCommands for CommandSender {
    fn wants_write(&self) -> bool {
        let mailbox = self.lock();
        mailbox.write && !mailbox.is_write_of_waiting
    }

    fn take_write(&self) -> bool {
        let mut mailbox = self.lock();
        let is_taken = mailbox.write && !mailbox.is_write_of_waiting;
        mailbox.write &= !is_taken;
        is_taken
    }

    fn take_preview_resize(&self) -> Option<Option<PreviewBounds>> {
        self.lock().preview.take()
    }

    fn take_query(&self) -> Option<QueryOrEdit> {
        self.lock().queries.pop_front()
    }

    fn interruption(&self) -> Interruption {
        let mailbox = self.lock();
        match (mailbox.suspended, mailbox.quit) {
            (true, _) => Interruption::Ended,
            (false, true) => Interruption::Left,
            (false, false) => Interruption::Replaced,
        }
    }
}
