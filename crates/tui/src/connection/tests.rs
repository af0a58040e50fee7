use super::*;

/// A terminal behind a simulated connection. Sends as much as flow control allows.
struct SimulatedTerminal {
    connection: TerminalFlowControl,
    start: Instant,
    now: Instant,
    bytes_a_second: f64,
    round_trip: Duration,
    answers: bool,
    /// Time at which the last queued byte is transmitted.
    busy: Instant,
    /// Replies in flight, with their arrival times.
    due: VecDeque<(Instant, QueryKind)>,
    carried: usize,
    /// Maximum number of bytes in flight so far.
    max_in_flight: usize,
    /// Longest queueing delay in the last run.
    longest: Duration,
}

impl SimulatedTerminal {
    fn new(bytes_a_second: f64, milliseconds: u64, answers: bool, is_multiplexed: bool) -> Self {
        let now = Instant::now();
        let mut terminal = Self {
            connection: TerminalFlowControl::new(is_multiplexed, now),
            start: now,
            now,
            bytes_a_second,
            round_trip: Duration::from_millis(milliseconds),
            answers,
            busy: now,
            due: VecDeque::new(),
            carried: 0,
            max_in_flight: 0,
            longest: Duration::ZERO,
        };
        terminal.send(12, Some(QueryKind::Attributes));
        terminal
    }

    fn send(&mut self, bytes: usize, question: Option<QueryKind>) {
        self.connection.record_sent(bytes, question, self.now);
        self.connection.record_accepted_bytes(bytes);
        self.busy = self.busy.max(self.now) + Duration::from_secs_f64(bytes as f64 / self.bytes_a_second);
        self.carried += bytes;
        self.longest = self.longest.max(self.busy - self.now);
        self.max_in_flight = self.max_in_flight.max(self.connection.in_flight);
        if let Some(question) = question.filter(|_| self.answers) {
            let multiplexed = self.connection.is_multiplexed;
            // A local multiplexer replies immediately.
            let beside = Duration::from_millis(1);
            let when = if multiplexed { self.now + beside } else { self.busy + self.round_trip };
            self.due.push_back((when, question));
        }
    }

    /// Sends continuously for `milliseconds`.
    fn run(&mut self, milliseconds: u64) {
        let end = self.now + Duration::from_millis(milliseconds);
        (self.carried, self.longest) = (0, Duration::ZERO);
        while self.now < end {
            while let Some((_, question)) = self.due.pop_front_if(|(when, _)| *when <= self.now) {
                self.connection.handle_reply(question, self.now);
            }
            loop {
                let room = self.connection.max_sendable_bytes(self.now);
                if room == 0 {
                    break;
                }
                let question = self.connection.next_query();
                self.send(room + question.map_or(0, |_| QUERY_BYTES), question);
            }
            let next = [self.due.front().map(|(when, _)| *when), self.connection.next_send_time(self.now)];
            self.now =
                next.into_iter().flatten().filter(|next| *next > self.now).min().unwrap_or(end).min(end);
        }
    }

    /// Fraction of the bandwidth used by the last run.
    fn bandwidth_share(&self, milliseconds: u64) -> f64 {
        self.carried as f64 / (self.bytes_a_second * milliseconds as f64 / 1e3)
    }
}

#[test]
fn bandwidth_is_used_without_long_queues() {
    for (bytes_a_second, milliseconds) in
        [(125e3, 150), (125e3, 20), (1.25e6, 150), (16e3, 150), (16e3, 600), (1e8, 1), (6e3, 300)]
    {
        let mut terminal = SimulatedTerminal::new(bytes_a_second, milliseconds, true, false);
        terminal.run(10_000);
        terminal.run(10_000);
        let name = format!("{bytes_a_second} B/s, {milliseconds} ms");
        assert!(terminal.max_in_flight <= MAX_WINDOW, "{name}: {}", terminal.max_in_flight);
        // The slowest connections take longer than `MAX_QUEUE` to carry the minimum window.
        let longest = MAX_QUEUE.as_secs_f64() * 2.0 + MIN_WINDOW / bytes_a_second;
        assert!(terminal.longest.as_secs_f64() <= longest, "{name}: {:?}", terminal.longest);
        let most = MAX_WINDOW as f64 / (bytes_a_second * milliseconds as f64 / 1e3);
        assert!(
            terminal.bandwidth_share(10_000) >= 0.6 * most.min(1.0),
            "{name}: {}",
            terminal.bandwidth_share(10_000)
        );
        let measured = terminal.connection.min_round_trip_time().expect("a reply").as_millis();
        assert!(measured >= u128::from(milliseconds), "{name}: {measured}");
    }
}

#[test]
fn output_is_paced_by_time_without_replies() {
    let mut terminal = SimulatedTerminal::new(125e3, 150, false, false);
    terminal.run(900);
    assert!(terminal.max_in_flight <= MAX_WINDOW && terminal.connection.awaits_reply());
    terminal.run(10_000);
    assert!(
        !terminal.connection.awaits_reply()
            && terminal.connection.min_round_trip_time().is_none()
            && terminal.connection.next_query().is_none()
    );
    assert!(terminal.longest <= Duration::from_millis(140), "{:?}", terminal.longest);
    assert!(terminal.bandwidth_share(10_000) > 0.7, "{}", terminal.bandwidth_share(10_000));
}

#[test]
fn late_replies_are_accepted() {
    let mut terminal = SimulatedTerminal::new(125e3, 1500, true, false);
    terminal.run(1200);
    assert_eq!(terminal.connection.replies, ReplySupport::Silent);
    terminal.run(2000);
    assert_eq!(terminal.connection.replies, ReplySupport::Answering);
}

#[test]
fn output_to_multiplexers_is_paced_by_time() {
    let mut terminal = SimulatedTerminal::new(125e3, 150, true, true);
    terminal.run(10_000);
    assert!(terminal.longest <= Duration::from_millis(140), "{:?}", terminal.longest);
    assert!(terminal.bandwidth_share(10_000) > 0.7, "{}", terminal.bandwidth_share(10_000));
}

#[test]
fn stalled_connection_recovers() {
    let mut terminal = SimulatedTerminal::new(125e3, 150, true, false);
    terminal.run(3_000);
    let lost = std::mem::take(&mut terminal.due);
    assert!(!lost.is_empty());
    terminal.answers = false;
    terminal.run(20_000);
    assert!(terminal.carried <= MAX_WINDOW + 8 * MIN_WINDOW as usize, "{}", terminal.carried);
    terminal.answers = true;
    terminal.run(10_000);
    assert!(terminal.bandwidth_share(10_000) > 0.6, "{}", terminal.bandwidth_share(10_000));
}

#[test]
fn lost_reply_delays_output_by_a_second() {
    let mut connection = TerminalFlowControl::new(false, Instant::now());
    let now = Instant::now();
    connection.record_sent(100, Some(QueryKind::Attributes), now);
    connection.handle_reply(QueryKind::Attributes, now + Duration::from_millis(5));
    let sent = now + Duration::from_millis(100);
    connection.record_sent(connection.window_bytes(), Some(QueryKind::Status), sent);
    assert_eq!(connection.max_sendable_bytes(sent + Duration::from_millis(900)), 0);
    assert_eq!(connection.next_send_time(sent), Some(sent + LOST_REPLY_TIMEOUT));
    assert!(connection.max_sendable_bytes(sent + LOST_REPLY_TIMEOUT) > 0);
    // The timeout grows with the round-trip time.
    let mut slow = TerminalFlowControl::new(false, now);
    slow.record_sent(100, Some(QueryKind::Attributes), now);
    slow.handle_reply(QueryKind::Attributes, now + Duration::from_millis(800));
    slow.record_sent(slow.window_bytes(), Some(QueryKind::Status), sent);
    assert_eq!(slow.max_sendable_bytes(sent + Duration::from_secs(3)), 0);
    assert!(slow.max_sendable_bytes(sent + Duration::from_millis(3200)) > 0);
}

#[test]
fn idle_connection_needs_no_wakeups() {
    let mut terminal = SimulatedTerminal::new(1e8, 1, true, false);
    terminal.run(100);
    terminal.now += Duration::from_secs(1);
    while let Some((_, question)) = terminal.due.pop_front() {
        terminal.connection.handle_reply(question, terminal.now);
    }
    assert!(!terminal.connection.awaits_reply());
    assert_eq!(terminal.connection.next_send_time(terminal.now), None);
    assert!(terminal.now > terminal.start);
}

#[test]
fn unsolicited_replies_are_ignored() {
    let mut connection = TerminalFlowControl::new(false, Instant::now());
    let now = Instant::now();
    connection.handle_reply(QueryKind::Status, now);
    connection.record_sent(100, Some(QueryKind::Attributes), now);
    connection.handle_reply(QueryKind::Status, now);
    assert!(connection.awaits_reply());
    connection.handle_reply(QueryKind::Attributes, now);
    assert!(!connection.awaits_reply() && connection.in_flight == 0);
}

#[test]
fn replies_to_small_slices_reveal_a_fast_terminal() {
    let mut connection = TerminalFlowControl::new(false, Instant::now());
    let mut now = Instant::now();
    let mut answer = |connection: &mut TerminalFlowControl, bytes: usize, milliseconds: u64| {
        connection.record_sent(bytes, Some(QueryKind::Status), now);
        now += Duration::from_millis(milliseconds);
        connection.handle_reply(QueryKind::Status, now);
    };
    assert!(!connection.is_fast(), "no replies yet");
    answer(&mut connection, 2000, 1);
    assert!(connection.is_fast());
    for _ in 0..8 {
        answer(&mut connection, 2000, 21);
    }
    assert!(!connection.is_fast());
    for _ in 0..5 {
        answer(&mut connection, 60, 20);
    }
    assert!(connection.is_fast());
    let mut behind = TerminalFlowControl::new(true, now);
    behind.record_sent(12, Some(QueryKind::Attributes), now);
    behind.handle_reply(QueryKind::Attributes, now + Duration::from_millis(1));
    assert!(!behind.is_fast(), "the multiplexer replies");
}
