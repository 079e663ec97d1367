//! What a running study shows: a bar, one JSON object a line, or nothing.

use crate::results::RunStatus;
use crate::store::{Kind, Left, Submitted};
use crate::worker::Event;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::collections::HashSet;
use std::io::{IsTerminal, Write};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Between two lines in a log.
const PLAIN_EVERY: Duration = Duration::from_secs(15);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    Bar,
    Json,
    Quiet,
}

/// Shown to people on standard error, so that standard output stays clean; JSON goes to standard output.
pub struct Progress {
    mode: Mode,
    bar: ProgressBar,
    state: Mutex<State>,
    /// Nobody watches: a line now and then instead of a bar.
    plain: bool,
}

#[derive(Default)]
struct State {
    ended: HashSet<String>,
    /// Of these the reader was told that they failed or are wrong.
    told: HashSet<String>,
    last_line: Option<Instant>,
    /// Number and total milliseconds of finished trials and judgements.
    trials: (f64, f64),
    judgements: (f64, f64),
    auxiliary: f64,
    /// A trial is under way; judgements beside it do not show.
    measuring: bool,
}

impl Progress {
    pub fn new(mode: Mode, submitted: &Submitted, auxiliary: usize) -> Progress {
        let open = submitted.new + submitted.resumed;
        let target =
            if mode == Mode::Bar { ProgressDrawTarget::stderr_with_hz(8) } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(open), target);
        let style = ProgressStyle::with_template("{bar:24} {pos}/{len} runs · {elapsed} · {prefix} · {wide_msg}");
        bar.set_style(style.expect("a valid template").progress_chars("━╸─"));
        bar.set_prefix("ETA unknown");
        if mode == Mode::Bar {
            bar.enable_steady_tick(Duration::from_millis(500));
        }
        let state = State { auxiliary: auxiliary as f64, last_line: Some(Instant::now()), ..State::default() };
        let plain = mode == Mode::Bar && !std::io::stderr().is_terminal();
        Progress { mode, bar, state: Mutex::new(state), plain }
    }

    pub fn on(&self, event: &Event) {
        match self.mode {
            Mode::Quiet => {}
            Mode::Json => json_line(event),
            Mode::Bar => self.draw(event),
        }
    }

    /// Clears the bar. The runs that it already called failed or wrong.
    pub fn end(&self) -> HashSet<String> {
        self.bar.finish_and_clear();
        std::mem::take(&mut self.state().told)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn say(&self, line: &str) {
        if self.plain { eprintln!("{line}") } else { self.bar.println(line) }
    }

    fn draw(&self, event: &Event) {
        let mut state = self.state();
        match event {
            Event::Trouble { message, again_s, .. } => self.say(&format!("{message}; trying again in {again_s} s")),
            Event::LaneBusy => self.bar.set_message("waiting: another study measures on this machine"),
            Event::JobStarted { kind: Kind::Trial, run, repeat, take, .. } => {
                let again = if *take > 0 { " again: it was disturbed" } else { "" };
                self.bar.set_message(format!("{run}, repeat {}{again}", repeat + 1));
                state.measuring = true;
            }
            // The lane is what a watcher waits for; judgements show when nothing else does.
            Event::JobStarted { kind: Kind::Judge, run, .. } => {
                if !state.measuring {
                    self.bar.set_message(format!("judging {run}"));
                }
            }
            Event::JobEnded { kind, wall_ms, left, outcome, run, reason, .. } => {
                let of = if *kind == Kind::Trial { &mut state.trials } else { &mut state.judgements };
                *of = (of.0 + 1.0, of.1 + wall_ms);
                if left.trials <= 0 && *kind == Kind::Trial {
                    self.bar.set_message("judging the rest");
                    state.measuring = false;
                }
                if let Some(eta) = state.eta(left) {
                    self.bar.set_prefix(format!("ETA {eta}"));
                    if self.plain && state.last_line.is_none_or(|t| t.elapsed() > PLAIN_EVERY) {
                        let (done, all) = (self.bar.position(), self.bar.length().unwrap_or(0));
                        eprintln!("{done} of {all} runs, ETA {eta}");
                        state.last_line = Some(Instant::now());
                    }
                }
                if *outcome == "crashed" {
                    let reason = reason.as_deref().unwrap_or_default();
                    self.say(&format!("{run}: will be tried again: {reason}"));
                }
            }
            Event::RunEnded { study_id: _, measurement_id, run, status, reason } => {
                if !state.ended.insert(measurement_id.clone()) {
                    return;
                }
                self.bar.inc(1);
                let word = match status {
                    RunStatus::Failed => "failed",
                    RunStatus::Wrong => "wrong",
                    _ => return,
                };
                state.told.insert(measurement_id.clone());
                self.say(&format!("{word}: {run}: {}", reason.as_deref().unwrap_or_default()));
            }
        }
    }
}

impl State {
    /// The lane works one at a time, the others side by side; the longer of both counts.
    fn eta(&self, left: &Left) -> Option<String> {
        let mean = |(n, ms): (f64, f64)| if n > 0.0 { Some(ms / n) } else { None };
        let ms = |left: i64, of: Option<f64>| if left <= 0 { Some(0.0) } else { of.map(|ms| ms * left as f64) };
        let lane = ms(left.trials, mean(self.trials))?;
        let beside = ms(left.judgements, mean(self.judgements))? / self.auxiliary.max(1.0);
        let s = (lane.max(beside) / 1e3).round() as u64;
        Some(duration(s))
    }
}

pub fn duration(s: u64) -> String {
    match s {
        0..=99 => format!("{s} s"),
        100..=5999 => format!("{} min {:02} s", s / 60, s % 60),
        _ => format!("{} h {:02} min", s / 3600, s / 60 % 60),
    }
}

/// One line, flushed: whoever reads along should not wait for a buffer.
pub fn json_line(value: &impl serde::Serialize) {
    let mut out = std::io::stdout().lock();
    let line = serde_json::to_string(value).expect("events are plain data");
    // A reader that went away is no reason to stop measuring.
    let _ = writeln!(out, "{line}").and_then(|()| out.flush());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_that_of_the_longer_lane() {
        let state = State { trials: (2.0, 4000.0), judgements: (1.0, 9000.0), auxiliary: 3.0, ..State::default() };
        assert_eq!(state.eta(&Left { trials: 4, judgements: 3 }).unwrap(), "9 s");
        assert_eq!(state.eta(&Left { trials: 60, judgements: 1 }).unwrap(), "2 min 00 s");
        assert_eq!(state.eta(&Left { trials: 0, judgements: 0 }).unwrap(), "0 s");
        assert_eq!(State::default().eta(&Left { trials: 4, judgements: 3 }), None, "nothing is known before the first");
    }
}
