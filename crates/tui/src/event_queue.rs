//! The event loop's queue, into which the worker and the file watcher put their events directly.

use std::sync::mpsc::{Receiver, Sender, channel};

use super::event::{Event, RequiredEventSource};
use super::options::WatchEvent;
use crate::pipeline::protocol;

/// Queue of the event loop. It exists before the front end runs, so that the worker can be started first.
pub struct EventQueue {
    pub(super) sender: Sender<Event>,
    pub(super) events: Receiver<Event>,
}

impl Default for EventQueue {
    fn default() -> Self {
        let (sender, events) = channel();
        Self { sender, events }
    }
}

impl EventQueue {
    /// Returns the sender for the worker's events. When it is dropped, the front end exits with an error.
    pub fn worker_sender(&self) -> EventSender<protocol::Event> {
        EventSender { queue: self.sender.clone(), wrap: Event::Worker, source: RequiredEventSource::Worker }
    }

    /// Returns the sender for the file watcher's events. When it is dropped, the front end shows a message.
    pub fn watcher_sender(&self) -> EventSender<WatchEvent> {
        let (queue, source) = (self.sender.clone(), RequiredEventSource::Watcher);
        EventSender { queue, wrap: Event::from_watcher, source }
    }
}

/// Sends one source's events to the event loop, and reports when the source has ended.
pub struct EventSender<T> {
    queue: Sender<Event>,
    wrap: fn(T) -> Event,
    source: RequiredEventSource,
}

impl<T> EventSender<T> {
    /// Sends an event without blocking. Does nothing after the front end has exited.
    pub fn send(&self, event: T) {
        let _ = self.queue.send((self.wrap)(event));
    }
}

impl<T> Drop for EventSender<T> {
    fn drop(&mut self) {
        let _ = self.queue.send(Event::SourceEnded(self.source));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn end_of_a_source_is_reported_last() {
        let queue = EventQueue::default();
        let sender = queue.watcher_sender();
        sender.send(WatchEvent::Settled);
        drop(sender);
        assert!(matches!(queue.events.recv(), Ok(Event::Settled)));
        assert!(matches!(queue.events.recv(), Ok(Event::SourceEnded(RequiredEventSource::Watcher))));
    }
}
