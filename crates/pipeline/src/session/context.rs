//! Commands that the front end sends during a request.

use std::cell::Cell;

use crate::control::CancelToken;
use crate::inputs::ProtectedInputs;
use crate::protocol::{Event, MaxPreviewSize};
use crate::queries::{QueryContext, QueryOrEdit};
use crate::render::film_state::FilmState;
use crate::sink::EventSink;

/// Reasons for interrupting a render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Interruption {
    /// The user requested another image, or none at all. The render will not be resumed.
    Replaced,
    /// The user quit. A long render will be resumed later.
    Left,
    /// The process is being terminated. The render will be resumed later.
    Ended,
}

/// Commands that arrive during a request.
pub(crate) trait PendingCommands {
    /// Whether the current image should be written.
    fn wants_write(&self) -> bool;
    /// Like [`Self::wants_write`], but clears the command.
    fn take_write(&self) -> bool;
    /// Takes the pending preview size change.
    fn take_preview_resize(&self) -> Option<Option<MaxPreviewSize>>;
    /// Takes the next query about the current image.
    fn take_query(&self) -> Option<QueryOrEdit>;
    /// Returns the reason for interrupting the render.
    fn cancellation_cause(&self) -> Interruption;
}

/// Cancel tokens and commands for a running request.
pub(crate) struct RequestContext<'a> {
    pub(crate) token: &'a CancelToken,
    /// Cancels the write stage, which runs last.
    pub(crate) writing: &'a CancelToken,
    pub(crate) orders: &'a dyn PendingCommands,
    /// Whether the postponement of a write command has already been reported to the front end.
    is_postponed: Cell<bool>,
}

impl<'a> RequestContext<'a> {
    pub(crate) fn new(
        token: &'a CancelToken,
        writing: &'a CancelToken,
        orders: &'a dyn PendingCommands,
    ) -> Self {
        Self { token, writing, orders, is_postponed: Cell::new(false) }
    }

    /// Reports, once per request, that a write command is postponed until every pixel has a sample.
    pub(super) fn report_write_awaiting_samples(&self, sink: &EventSink) {
        if self.orders.wants_write() && !self.is_postponed.replace(true) {
            sink.send(Event::WritePostponed { generation: sink.generation });
        }
    }

    /// Answers the next query about the current image.
    pub(super) fn answer_query(
        &self,
        query_context: &QueryContext,
        state: Option<&FilmState>,
        inputs: &ProtectedInputs,
        sink: &EventSink,
    ) {
        if let Some(query) = self.orders.take_query() {
            query_context.run(&query, state, inputs, sink);
        }
    }
}
