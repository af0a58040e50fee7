//! A slow connection: 1 Mbit/s, a round-trip time of 150 ms, and 2 MB of buffers (the ssh window).
//!
//! A relay between the pseudo-terminal and the user's screen replies to queries like a terminal, like tmux
//! (immediately, on behalf of the terminal), or not at all.

use std::collections::VecDeque;
use std::io::{Read, Write};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

/// Bytes per second: 1 Mbit/s.
const RATE: f64 = 125_000.0;
/// One-way delay.
const DELAY: Duration = Duration::from_millis(75);
const QUERIES: [(&[u8], &[u8]); 3] =
    [(b"\x1b[5n", b"\x1b[0n"), (b"\x1b[c", b"\x1b[?62;22c"), (b"\x1b[?2026$p", b"\x1b[?2026;2$y")];

/// The component that replies to the program's queries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Responder {
    /// The terminal at the far end.
    Terminal,
    /// A multiplexer at the near end.
    Multiplexer,
    Nothing,
}

/// Traffic on the connection.
#[derive(Debug, Default)]
pub struct Traffic {
    /// Bytes sent by the program.
    pub sent: usize,
    /// Bytes that reached the user's screen.
    pub shown: usize,
    /// Number of bytes sent up to the last query whose reply has reached the program.
    answered: usize,
    /// Largest number of unacknowledged bytes.
    pub max_unanswered: usize,
    /// Largest number of queued bytes.
    pub max_waiting: usize,
}

/// Bytes in transit with their arrival time. A reply also has the number of bytes sent up to its query.
struct DelayedBytes {
    when: Instant,
    bytes: Vec<u8>,
    asked: Option<usize>,
}

impl DelayedBytes {
    fn answer((bytes, asked): (&'static [u8], usize), when: Instant) -> Self {
        Self { when, bytes: bytes.to_vec(), asked: Some(asked) }
    }
}

/// The two directions of a connection.
pub struct Relay {
    pub seen: Arc<Mutex<Traffic>>,
    up: Sender<DelayedBytes>,
}

impl Relay {
    /// Starts a relay between the program's output, its input, and the user's screen.
    pub fn start(
        mut output: Box<dyn Read + Send>,
        input: Arc<Mutex<Box<dyn Write + Send>>>,
        (screen, kept): (Arc<Mutex<vt100::Parser>>, Arc<Mutex<Vec<u8>>>),
        answers: Responder,
    ) -> Self {
        let seen = Arc::new(Mutex::new(Traffic::default()));
        let (down, arriving) = channel::<DelayedBytes>();
        let (up, rising) = channel::<DelayedBytes>();
        let (at_ends, to_answer) = (up.clone(), up.clone());

        let noted = seen.clone();
        thread::spawn(move || {
            let (mut bytes, mut free, mut tail) = ([0; 1 << 12], Instant::now(), Scanner::default());
            while let Ok(count @ 1..) = output.read(&mut bytes) {
                let now = Instant::now();
                let bytes = &bytes[..count];
                kept.lock().expect("no panic").extend_from_slice(bytes);
                record_sent(&noted, count);
                if answers == Responder::Multiplexer {
                    for answer in tail.answers(bytes) {
                        let _ = to_answer.send(DelayedBytes::answer(answer, now));
                    }
                }
                // Bytes arrive in order, so later bytes wait for earlier ones.
                for part in bytes.chunks(250) {
                    free = free.max(now) + Duration::from_secs_f64(part.len() as f64 / RATE);
                    let _ = down.send(DelayedBytes { when: free + DELAY, bytes: part.to_vec(), asked: None });
                }
            }
        });
        let noted = seen.clone();
        thread::spawn(move || show(&arriving, &screen, &noted, answers, &at_ends));
        let noted = seen.clone();
        thread::spawn(move || deliver(&rising, &input, &noted));
        Self { seen, up }
    }

    /// Sends keys from the user to the program.
    pub fn press(&self, keys: &str) {
        let when = Instant::now() + DELAY;
        let _ = self.up.send(DelayedBytes { when, bytes: keys.as_bytes().to_vec(), asked: None });
    }
}

fn record_sent(seen: &Mutex<Traffic>, count: usize) {
    let mut seen = seen.lock().expect("no panic");
    seen.sent += count;
    seen.max_unanswered = seen.max_unanswered.max(seen.sent - seen.answered);
    seen.max_waiting = seen.max_waiting.max(seen.sent - seen.shown);
}

fn show(
    arriving: &Receiver<DelayedBytes>,
    screen: &Mutex<vt100::Parser>,
    seen: &Mutex<Traffic>,
    answers: Responder,
    up: &Sender<DelayedBytes>,
) {
    let mut tail = Scanner::default();
    while let Ok(DelayedBytes { when, bytes, .. }) = arriving.recv() {
        thread::sleep(when.saturating_duration_since(Instant::now()));
        screen.lock().expect("no panic").process(&bytes);
        seen.lock().expect("no panic").shown += bytes.len();
        if answers == Responder::Terminal {
            for answer in tail.answers(&bytes) {
                let _ = up.send(DelayedBytes::answer(answer, Instant::now() + DELAY));
            }
        }
    }
}

/// Delivers keys and replies when they are due.
fn deliver(rising: &Receiver<DelayedBytes>, input: &Mutex<Box<dyn Write + Send>>, seen: &Mutex<Traffic>) {
    let mut waiting: VecDeque<DelayedBytes> = VecDeque::new();
    loop {
        let next = match waiting.front() {
            Some(next) => rising.recv_timeout(next.when.saturating_duration_since(Instant::now())),
            None => rising.recv().map_err(RecvTimeoutError::from),
        };
        match next {
            Ok(due) => {
                let place = waiting.iter().position(|other| other.when > due.when).unwrap_or(waiting.len());
                waiting.insert(place, due);
            }
            Err(RecvTimeoutError::Disconnected) => return,
            Err(RecvTimeoutError::Timeout) => {
                let Some(DelayedBytes { bytes, asked, .. }) = waiting.pop_front() else { continue };
                if let Some(asked) = asked {
                    let mut seen = seen.lock().expect("no panic");
                    seen.answered = seen.answered.max(asked);
                }
                if input.lock().expect("no panic").write_all(&bytes).is_err() {
                    return;
                }
            }
        }
    }
}

/// Finds queries in a stream that may be split at any byte.
#[derive(Default)]
pub struct Scanner {
    last: Vec<u8>,
    /// Number of bytes scanned so far.
    count: usize,
}

impl Scanner {
    /// Replies to queries, each with the number of bytes up to its query.
    pub fn answers(&mut self, bytes: &[u8]) -> Vec<(&'static [u8], usize)> {
        let mut found = Vec::new();
        for byte in bytes {
            self.last.push(*byte);
            self.count += 1;
            if let Some((_, answer)) = QUERIES.iter().find(|(question, _)| self.last.ends_with(question)) {
                found.push((*answer, self.count));
            }
        }
        let spare = self.last.len().saturating_sub(16);
        self.last.drain(..spare);
        found
    }
}
