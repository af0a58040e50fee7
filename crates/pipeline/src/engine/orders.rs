//! Orders that a request hears while it is under way.

use std::cell::Cell;

use crate::control::CancelToken;
use crate::errands::{AtHand, Errand};
use crate::inputs::Inputs;
use crate::protocol::{Event, PreviewSize};
use crate::render::film_state::FilmState;
use crate::sink::Sink;

/// Why a render is cancelled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Interruption {
    /// Something else is rendered, or nothing: nobody comes back to it.
    Replaced,
    /// A person leaves: if it took long, it is gone on with later.
    Left,
    /// The process is ended: it is gone on with later.
    Ended,
}

/// Orders that come while a request is under way.
pub(crate) trait Orders {
    /// Whether the picture is to be written as it is.
    fn wants_write(&self) -> bool;
    /// The same, and the order is carried out.
    fn take_write(&self) -> bool;
    /// The size that previews are to have from now on.
    fn take_preview(&self) -> Option<Option<PreviewSize>>;
    /// The next question about the current picture.
    fn take_errand(&self) -> Option<Errand>;
    /// Why a render that is cancelled is not gone on with now.
    fn interruption(&self) -> Interruption;
}

/// Tokens and orders of a request while it is under way.
pub(crate) struct Meanwhile<'a> {
    pub(crate) token: &'a CancelToken,
    /// Token of the write stage, the last one.
    pub(crate) writing: &'a CancelToken,
    pub(crate) orders: &'a dyn Orders,
    /// Whether the front end knows that its order to write waits.
    is_postponed: Cell<bool>,
}

impl<'a> Meanwhile<'a> {
    pub(crate) fn new(token: &'a CancelToken, writing: &'a CancelToken, orders: &'a dyn Orders) -> Self {
        Self { token, writing, orders, is_postponed: Cell::new(false) }
    }

    /// Tells the front end once that its order to write waits until every pixel has a sample.
    pub(super) fn postpone_write(&self, sink: &Sink) {
        if self.orders.wants_write() && !self.is_postponed.replace(true) {
            sink.send(Event::WritePostponed { generation: sink.generation });
        }
    }

    /// Answers the next question about the current picture.
    pub(super) fn run_errand(
        &self,
        at_hand: &AtHand,
        canvas: Option<&FilmState>,
        inputs: &Inputs,
        sink: &Sink,
    ) {
        if let Some(errand) = self.orders.take_errand() {
            at_hand.run(&errand, canvas, inputs, sink);
        }
    }
}
