//! The context of a running request.

use std::cell::Cell;

use crate::control::CancelToken;
use crate::protocol::Request;
use crate::render::commands::PendingCommands;
use crate::sink::EventSink;

/// A running request, with its cancel tokens and the front end.
pub(crate) struct RequestContext<'a> {
    pub(crate) request: &'a Request,
    pub(crate) sink: &'a EventSink,
    pub(crate) token: &'a CancelToken,
    /// Cancels the write stage, which runs last.
    pub(crate) writing: &'a CancelToken,
    pub(crate) commands: &'a dyn PendingCommands,
    /// Whether the postponement of a write command has already been reported to the front end.
    pub(super) is_postponed: Cell<bool>,
}

impl<'a> RequestContext<'a> {
    pub(crate) fn new(
        request: &'a Request,
        sink: &'a EventSink,
        token: &'a CancelToken,
        writing: &'a CancelToken,
        commands: &'a dyn PendingCommands,
    ) -> Self {
        Self { request, sink, token, writing, commands, is_postponed: Cell::new(false) }
    }
}
