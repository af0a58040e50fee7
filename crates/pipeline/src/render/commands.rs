//! Commands from the user that arrive while an image is rendered.

use std::cell::{Cell, RefCell};

use super::checkpointer::Interruption;
use super::film_state::FilmState;
use crate::protocol::{Event, PreviewBounds};
use crate::queries::{QueryContext, QueryOrEdit};
use crate::report::finish::remove_outdated_report;
use crate::stages::write::{ImageWriteContext, WriteState, write_on_request};

/// Commands that arrive during a request. By default, none arrive.
pub(crate) trait PendingCommands {
    /// Whether the current image should be written.
    fn wants_write(&self) -> bool {
        false
    }
    /// Like [`Self::wants_write`], but clears the command.
    fn take_write(&self) -> bool {
        false
    }
    /// Takes the pending preview size change.
    fn take_preview_resize(&self) -> Option<Option<PreviewBounds>> {
        None
    }
    /// Takes the next query about the current image.
    fn take_query(&self) -> Option<QueryOrEdit> {
        None
    }
    /// Returns the reason for interrupting the render.
    fn interruption(&self) -> Interruption {
        Interruption::Replaced
    }
}

/// Carries out the commands that arrive while an image is rendered.
pub(crate) struct PendingCommandRunner<'a> {
    pub(crate) pending: &'a dyn PendingCommands,
    pub(crate) queries: &'a QueryContext,
    pub(crate) to: ImageWriteContext<'a>,
    pub(crate) written: RefCell<&'a mut WriteState>,
    /// Whether the postponement of a write command has already been reported to the front end.
    pub(crate) is_postponed: &'a Cell<bool>,
}

impl PendingCommandRunner<'_> {
    /// Carries out pending commands about the current film, if there is one. `is_covered` states whether
    /// every pixel has a sample. Until then, a write command is postponed, which is reported once.
    pub(crate) fn run_pending(&self, film: Option<&FilmState>, is_covered: bool) {
        let ImageWriteContext { plan, inputs, sink, .. } = self.to;
        if let Some(film) = film.filter(|_| is_covered) {
            if self.pending.take_write() && write_on_request(film, self.to, &mut self.written.borrow_mut()) {
                remove_outdated_report(plan, inputs, sink);
            }
        } else if self.pending.wants_write() && !self.is_postponed.replace(true) {
            sink.send(Event::WritePostponed { generation: sink.generation });
        }
        if let Some(query) = self.pending.take_query() {
            self.queries.run(&query, film, inputs, sink);
        }
    }
}
