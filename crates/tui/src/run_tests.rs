use super::*;

#[test]
fn channel_close_is_reported_last() {
    let (from, receiver) = mpsc::channel();
    let (sender, events) = mpsc::channel();
    forward_channel("test", receiver, &sender, Event::from_watcher, RequiredEventSource::Watcher)
        .expect("a thread");
    from.send(super::super::WatchEvent::Settled).expect("a receiver");
    drop(from);
    assert!(matches!(events.recv(), Ok(Event::Settled)));
    assert!(matches!(events.recv(), Ok(Event::Lost(RequiredEventSource::Watcher))));
}
