//! Progress in logs: an occasional line, where no bar can be drawn.

use std::io::Write;
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Least and greatest time between lines.
#[derive(Clone, Copy)]
pub(crate) struct Pace {
    /// A stage that ends sooner gets no line.
    pub(crate) least: Duration,
    /// A longer stage gets another line.
    pub(crate) most: Duration,
}

impl Default for Pace {
    fn default() -> Self {
        Self {
            least: Duration::from_secs(5),
            most: Duration::from_secs(60),
        }
    }
}

/// The work under way: the stage, and a line about it.
pub(crate) struct Now {
    pub(crate) stage: String,
    pub(crate) line: String,
}

/// Decides which lines are due.
struct Lines {
    pace: Pace,
    /// The stage of the last line, and its time.
    last: Option<(String, Duration)>,
}

impl Lines {
    /// Returns the line due at time `at`, if any; called every [`Pace::least`].
    fn due(&mut self, now: Option<Now>, at: Duration) -> Option<String> {
        let Now { stage, line } = now?;
        let is_due = self.last.as_ref().is_none_or(|(last, when)| {
            // Intervals between ticks vary slightly.
            *last != stage || at + self.pace.least / 2 >= *when + self.pace.most
        });
        is_due.then(|| {
            self.last = Some((stage, at));
            line
        })
    }
}

/// Writes lines until it is dropped, on its own thread.
pub(crate) struct Ticker {
    /// Carries no messages: the thread ends when this is dropped.
    end: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Ticker {
    /// Calls `now` for the work under way, and writes its line to `out` at the given pace.
    pub(crate) fn start(
        pace: Pace,
        now: impl Fn() -> Option<Now> + Send + 'static,
        mut out: impl Write + Send + 'static,
    ) -> Self {
        let (end, ended) = mpsc::channel::<()>();
        let began = Instant::now();
        let mut lines = Lines { pace, last: None };
        let tick = move || {
            while ended.recv_timeout(pace.least) == Err(RecvTimeoutError::Timeout) {
                if let Some(line) = lines.due(now(), began.elapsed()) {
                    // If the output is closed, nobody reads it: ignore the failure.
                    let _ = writeln!(out, "{line}");
                }
            }
        };
        Self {
            end: Some(end),
            // Without a thread there are no progress lines, and the work goes on.
            thread: std::thread::Builder::new().spawn(tick).ok(),
        }
    }
}

impl Drop for Ticker {
    fn drop(&mut self) {
        drop(self.end.take());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, Mutex};

    fn now(stage: &str) -> Option<Now> {
        Some(Now {
            stage: stage.to_owned(),
            line: format!("at {stage}"),
        })
    }

    #[test]
    fn a_stage_has_a_line_and_a_long_one_a_line_a_minute() {
        let mut lines = Lines {
            pace: Pace::default(),
            last: None,
        };
        assert_eq!(lines.due(None, Duration::from_secs(5)), None);
        let mut said = Vec::new();
        // Two hours: ten seconds of the first stage, the rest of the second.
        for tick in 1..=1440 {
            let stage = if tick <= 2 { "flood" } else { "rooms" };
            let line = lines.due(now(stage), Duration::from_millis(5001 * tick));
            said.extend(line);
        }
        assert_eq!(said[..2], ["at flood", "at rooms"]);
        assert_eq!(said.len(), 121);
    }

    #[test]
    fn a_ticker_writes_until_it_is_dropped_and_not_afterwards() {
        #[derive(Clone, Default)]
        struct Kept(Arc<Mutex<Vec<u8>>>);
        impl Write for Kept {
            fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
                self.0.lock().unwrap().write(bytes)
            }
            fn flush(&mut self) -> std::io::Result<()> {
                Ok(())
            }
        }
        let kept = Kept::default();
        let text = || String::from_utf8(kept.0.lock().unwrap().clone()).unwrap();
        let pace = Pace {
            least: Duration::from_millis(1),
            most: Duration::from_secs(3600),
        };
        let ticker = Ticker::start(pace, || now("work"), kept.clone());
        let start = Instant::now();
        while text().is_empty() && start.elapsed() < Duration::from_secs(60) {
            std::thread::yield_now();
        }
        drop(ticker);
        assert_eq!(text(), "at work\n");
        assert_eq!(Arc::strong_count(&kept.0), 1, "the thread is gone");
        // A ticker whose next line is due in an hour ends without waiting.
        let pace = Pace {
            least: Duration::from_secs(3600),
            ..pace
        };
        let late = Ticker::start(pace, || now("work"), kept.clone());
        let (ended, has_ended) = mpsc::channel();
        std::thread::spawn(move || {
            drop(late);
            ended.send(())
        });
        assert_eq!(has_ended.recv_timeout(Duration::from_secs(600)), Ok(()));
        assert_eq!(text(), "at work\n");
    }
}
