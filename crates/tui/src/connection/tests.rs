use super::*;

/// A line with a terminal at its end, in simulated time, to which as much is sent as the flow control allows.
struct SimulatedTerminal {
    line: Connection,
    start: Instant,
    now: Instant,
    bytes_a_second: f64,
    round_trip: Duration,
    answers: bool,
    /// When the last byte leaves the line's queue.
    busy: Instant,
    /// Answers under way.
    due: VecDeque<(Instant, QueryKind)>,
    carried: usize,
    /// Most bytes and longest wait in the queue, since the last look.
    most_in_flight: usize,
    longest: Duration,
}

impl SimulatedTerminal {
    fn new(bytes_a_second: f64, milliseconds: u64, answers: bool, is_multiplexed: bool) -> Self {
        let now = Instant::now();
        let mut relay = Self {
            line: Connection::new(is_multiplexed, now),
            start: now,
            now,
            bytes_a_second,
            round_trip: Duration::from_millis(milliseconds),
            answers,
            busy: now,
            due: VecDeque::new(),
            carried: 0,
            most_in_flight: 0,
            longest: Duration::ZERO,
        };
        relay.send(12, Some(QueryKind::Attributes));
        relay
    }

    fn send(&mut self, bytes: usize, question: Option<QueryKind>) {
        self.line.send(bytes, question, self.now);
        self.line.written(bytes);
        self.busy = self.busy.max(self.now) + Duration::from_secs_f64(bytes as f64 / self.bytes_a_second);
        self.carried += bytes;
        self.longest = self.longest.max(self.busy - self.now);
        self.most_in_flight = self.most_in_flight.max(self.line.in_flight);
        if let Some(question) = question.filter(|_| self.answers) {
            let multiplexed = self.line.is_multiplexed;
            // What answers in its place stands beside glimt.
            let beside = Duration::from_millis(1);
            let when = if multiplexed { self.now + beside } else { self.busy + self.round_trip };
            self.due.push_back((when, question));
        }
    }

    /// Sends without end for so long.
    fn run(&mut self, milliseconds: u64) {
        let end = self.now + Duration::from_millis(milliseconds);
        (self.carried, self.longest) = (0, Duration::ZERO);
        while self.now < end {
            while let Some((_, question)) = self.due.pop_front_if(|(when, _)| *when <= self.now) {
                self.line.answered(question, self.now);
            }
            loop {
                let room = self.line.room(self.now);
                if room == 0 {
                    break;
                }
                let question = self.line.question();
                self.send(room + question.map_or(0, |_| ASKED_BYTES), question);
            }
            let next = [self.due.front().map(|(when, _)| *when), self.line.wake(self.now)];
            self.now =
                next.into_iter().flatten().filter(|next| *next > self.now).min().unwrap_or(end).min(end);
        }
    }

    /// Share of what the line can carry that was carried in the last run.
    fn share(&self, milliseconds: u64) -> f64 {
        self.carried as f64 / (self.bytes_a_second * milliseconds as f64 / 1e3)
    }
}

#[test]
fn lines_are_filled_and_their_queues_stay_short() {
    for (bytes_a_second, milliseconds) in
        [(125e3, 150), (125e3, 20), (1.25e6, 150), (16e3, 150), (16e3, 600), (1e8, 1), (6e3, 300)]
    {
        let mut relay = SimulatedTerminal::new(bytes_a_second, milliseconds, true, false);
        relay.run(10_000);
        relay.run(10_000);
        let name = format!("{bytes_a_second} B/s, {milliseconds} ms");
        assert!(relay.most_in_flight <= MOST, "{name}: {}", relay.most_in_flight);
        // The least window is more than the slowest lines carry in time.
        let longest = QUEUE.as_secs_f64() * 2.0 + LEAST / bytes_a_second;
        assert!(relay.longest.as_secs_f64() <= longest, "{name}: {:?}", relay.longest);
        let most = MOST as f64 / (bytes_a_second * milliseconds as f64 / 1e3);
        assert!(relay.share(10_000) >= 0.6 * most.min(1.0), "{name}: {}", relay.share(10_000));
        let measured = relay.line.round_trip().expect("it answers").as_millis();
        assert!(measured >= u128::from(milliseconds), "{name}: {measured}");
    }
}

#[test]
fn a_terminal_that_never_answers_is_paced_by_time() {
    let mut relay = SimulatedTerminal::new(125e3, 150, false, false);
    relay.run(900);
    assert!(relay.most_in_flight <= MOST && relay.line.owes());
    relay.run(10_000);
    assert!(!relay.line.owes() && relay.line.round_trip().is_none() && relay.line.question().is_none());
    assert!(relay.longest <= Duration::from_millis(140), "{:?}", relay.longest);
    assert!(relay.share(10_000) > 0.7, "{}", relay.share(10_000));
}

#[test]
fn a_late_answer_is_believed() {
    let mut relay = SimulatedTerminal::new(125e3, 1500, true, false);
    relay.run(1200);
    assert_eq!(relay.line.pace, SendRate::Silent);
    relay.run(2000);
    assert_eq!(relay.line.pace, SendRate::ProbeReplies);
}

#[test]
fn behind_a_multiplexer_time_counts_as_well() {
    let mut relay = SimulatedTerminal::new(125e3, 150, true, true);
    relay.run(10_000);
    assert!(relay.longest <= Duration::from_millis(140), "{:?}", relay.longest);
    assert!(relay.share(10_000) > 0.7, "{}", relay.share(10_000));
}

#[test]
fn a_line_that_stands_still_gets_little_and_recovers() {
    let mut relay = SimulatedTerminal::new(125e3, 150, true, false);
    relay.run(3_000);
    let lost = std::mem::take(&mut relay.due);
    assert!(!lost.is_empty());
    relay.answers = false;
    relay.run(20_000);
    assert!(relay.carried <= MOST + 8 * LEAST as usize, "{}", relay.carried);
    relay.answers = true;
    relay.run(10_000);
    assert!(relay.share(10_000) > 0.6, "{}", relay.share(10_000));
}

#[test]
fn a_lost_answer_holds_the_screen_up_for_a_second() {
    let mut line = Connection::new(false, Instant::now());
    let now = Instant::now();
    line.send(100, Some(QueryKind::Attributes), now);
    line.answered(QueryKind::Attributes, now + Duration::from_millis(5));
    let sent = now + Duration::from_millis(100);
    line.send(line.window_bytes(), Some(QueryKind::Status), sent);
    assert_eq!(line.room(sent + Duration::from_millis(900)), 0);
    assert_eq!(line.wake(sent), Some(sent + SILENCE));
    assert!(line.room(sent + SILENCE) > 0);
    // Where answers take long they are waited for longer.
    let mut slow = Connection::new(false, now);
    slow.send(100, Some(QueryKind::Attributes), now);
    slow.answered(QueryKind::Attributes, now + Duration::from_millis(800));
    slow.send(slow.window_bytes(), Some(QueryKind::Status), sent);
    assert_eq!(slow.room(sent + Duration::from_secs(3)), 0);
    assert!(slow.room(sent + Duration::from_millis(3200)) > 0);
}

#[test]
fn nothing_is_due_while_nothing_is_owed() {
    let mut relay = SimulatedTerminal::new(1e8, 1, true, false);
    relay.run(100);
    relay.now += Duration::from_secs(1);
    while let Some((_, question)) = relay.due.pop_front() {
        relay.line.answered(question, relay.now);
    }
    assert!(!relay.line.owes());
    assert_eq!(relay.line.wake(relay.now), None);
    assert!(relay.now > relay.start);
}

#[test]
fn answers_that_nobody_asked_for_change_nothing() {
    let mut line = Connection::new(false, Instant::now());
    let now = Instant::now();
    line.answered(QueryKind::Status, now);
    line.send(100, Some(QueryKind::Attributes), now);
    line.answered(QueryKind::Status, now);
    assert!(line.owes());
    line.answered(QueryKind::Attributes, now);
    assert!(!line.owes() && line.in_flight == 0);
}

#[test]
fn a_terminal_that_was_slow_for_a_moment_is_quick_again_by_small_slices() {
    let mut line = Connection::new(false, Instant::now());
    let mut now = Instant::now();
    let mut answer = |line: &mut Connection, bytes: usize, milliseconds: u64| {
        line.send(bytes, Some(QueryKind::Status), now);
        now += Duration::from_millis(milliseconds);
        line.answered(QueryKind::Status, now);
    };
    assert!(!line.is_quick(), "nothing is known of it");
    answer(&mut line, 2000, 1);
    assert!(line.is_quick());
    for _ in 0..8 {
        answer(&mut line, 2000, 21);
    }
    assert!(!line.is_quick());
    for _ in 0..5 {
        answer(&mut line, 60, 20);
    }
    assert!(line.is_quick());
    let mut behind = Connection::new(true, now);
    behind.send(12, Some(QueryKind::Attributes), now);
    behind.answered(QueryKind::Attributes, now + Duration::from_millis(1));
    assert!(!behind.is_quick(), "what answers is not the terminal");
}
