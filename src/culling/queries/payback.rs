//! `auto`: queries that do not pay stop for a while.
//!
//! A frame's yield is what its queries spared (indices and draw calls of what they found
//! hidden) over what they cost (queries, boxes, occluders beside drawing them, and waiting),
//! all counted and priced as on the virtual clock. Below 1 the walk goes on as a plain
//! `depth_first` for [`RETRY`] times the interval of re-tests. Then queries are tried
//! until every visible leaf was asked about and the answer used, as the first frame knows
//! nothing of the scene, and stay only if the last of these frames was worth [`ON`]: the
//! thresholds lie apart so that a scene between them does not flicker. The memory of nodes
//! stands still meanwhile: what was visible is tried first. Nothing is lost either way.

/// Yield above which queries that were tried stay, and below which they stop.
pub const ON: f64 = 1.25;
pub const OFF: f64 = 1.0;
/// Frames off for each of the interval of re-tests.
const RETRY: u32 = 4;

#[derive(Debug)]
pub struct Payback {
    trial_frames: u32,
    off_frames: u32,
    state: State,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Trying(u32),
    On,
    /// For so many frames more.
    Off(u32),
}

impl Payback {
    /// Leaves are asked about every `n_av` frames.
    pub fn new(n_av: u32) -> Payback {
        Payback { trial_frames: 2 + n_av, off_frames: RETRY * n_av, state: State::Trying(0) }
    }

    pub fn reset(&mut self) {
        self.state = State::Trying(0);
    }

    /// Before a frame: whether it goes without queries.
    pub fn rests(&mut self) -> bool {
        match self.state {
            State::Off(0) => self.state = State::Trying(0),
            State::Off(left) => {
                self.state = State::Off(left - 1);
                return true;
            }
            _ => {}
        }
        false
    }

    /// After a frame with queries.
    pub fn learn(&mut self, spared_ns: f64, spent_ns: f64) {
        let pays = |threshold: f64| spared_ns >= threshold * spent_ns;
        self.state = match self.state {
            State::Trying(n) if n + 1 < self.trial_frames => State::Trying(n + 1),
            State::Trying(_) if pays(ON) => State::On,
            State::On if pays(OFF) => State::On,
            _ => State::Off(self.off_frames),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_pay_rests_and_is_tried_again() {
        let mut payback = Payback::new(1);
        let mut run = |yields: &[f64]| -> String {
            let mut at = yields.iter();
            let mut out = String::new();
            loop {
                if payback.rests() {
                    out.push('.');
                    continue;
                }
                let Some(y) = at.next() else { return out };
                payback.learn(*y, 1.0);
                out.push('q');
            }
        };
        // The first frames are forgiven, and 1.1 keeps what is on but does not turn it on.
        assert_eq!(run(&[0.0, 0.0, 1.3, 1.1, 1.0, 0.9, 9.0, 9.0, 1.1, 0.0, 0.0, 2.0]), "qqqqqq....qqq....qqq");
        payback.reset();
        assert!(!payback.rests());
    }
}
