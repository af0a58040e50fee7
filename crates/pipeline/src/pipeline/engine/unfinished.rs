//! The render of a scene that was good, while the file is broken.

use super::{Engine, Meanwhile, Ready};
use crate::pipeline::protocol::Request;
use crate::pipeline::sink::Sink;
use crate::pipeline::stages::Findings;
use crate::scene::fingerprint::Key;

/// A picture whose render was stopped.
pub(super) struct Unfinished {
    pub(super) request: Request,
    pub(super) ready: Ready,
    pub(super) photons: Option<Key>,
}

impl Engine {
    /// The request that stopped it is of a scene that cannot be read: the picture at hand gets the samples that it lacks, and is
    /// written where it would have been, unless the scene might name that file now.
    pub(super) fn go_on(&mut self, newest: &Request, sink: &Sink, meanwhile: &Meanwhile<'_>) {
        let Some(unfinished) = self.unfinished.take() else { return };
        let request = Request {
            preview: newest.preview,
            first: newest.first,
            force: false,
            ..unfinished.request.clone()
        };
        let ready = &unfinished.ready;
        if self.render(&request, ready, unfinished.photons, sink, meanwhile).is_err() {
            self.unfinished = Some(unfinished);
            return;
        }
        let outputs = &ready.plan.outputs;
        if self.written.not_ours(outputs, &self.contents).is_none() {
            // What cannot be written is said by the stage.
            let _ = self.write(&request, &ready.plan, &Findings::default(), sink, meanwhile.writing);
        }
    }
}
