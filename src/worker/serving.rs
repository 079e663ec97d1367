//! A crew that works for every study of a database: rests when nothing waits, waits out
//! trouble, and puts in order what others left.

use super::crew::{Crew, Scope};
use super::lane::Lane;
use super::{Event, Phase};
use crate::error::Result;
use crate::store::Kind;
use std::collections::HashMap;
use std::time::Duration;

/// How long one of a pool does, unless it is roused: other processes may have submitted.
const LONG_REST: Duration = Duration::from_millis(250);

/// How often a pool looks for leases of the dead and for runs that lack only a decision.
const MEND: Duration = Duration::from_secs(5);

/// After trouble a worker of a pool waits, twice as long each time.
const TROUBLE: (Duration, Duration) = (Duration::from_millis(500), Duration::from_secs(30));

impl Crew {
    /// Works for whoever asks until told to end.
    pub async fn serve(&self, worker: usize, kinds: &[Kind]) {
        let lane = Lane::new(&self.options.lane_file);
        let mut pause = TROUBLE.0;
        while self.phase() == Phase::Work {
            match self.round(worker, kinds, &lane).await {
                Ok(true) => pause = TROUBLE.0,
                Ok(false) => {
                    pause = TROUBLE.0;
                    tokio::select! {
                        () = self.wake.notified() => {}
                        () = tokio::time::sleep(LONG_REST) => {}
                        () = self.asked(Phase::Drain) => {}
                    }
                }
                Err(e) => {
                    (self.tell)(Event::Trouble { worker, message: e.to_string(), again_s: pause.as_secs_f64() });
                    tokio::select! {
                        () = tokio::time::sleep(pause) => {}
                        () = self.asked(Phase::Drain) => {}
                    }
                    pause = (pause * 2).min(TROUBLE.1);
                }
            }
        }
    }

    /// Returns the leases of dead workers, and decides about runs that nobody works on any more.
    pub async fn mend(&self) {
        let Scope::Every(pool) = &self.scope else { return };
        // What the last look left open is not looked at again until something changed.
        let mut looked: HashMap<i64, (i64, usize)> = HashMap::new();
        while self.phase() == Phase::Work {
            let once = async {
                self.store.return_orphans().await?;
                for study_id in self.store.undecided(pool).await? {
                    let state = (self.store.now().await?, self.store.loose_ends(study_id).await?.len());
                    if looked.insert(study_id, state) != Some(state) {
                        self.settle_all(study_id).await?;
                    }
                }
                Ok(())
            };
            if let Err(e) = once.await as Result<()> {
                (self.tell)(Event::Trouble { worker: 0, message: e.to_string(), again_s: MEND.as_secs_f64() });
            }
            tokio::select! {
                () = tokio::time::sleep(MEND) => {}
                () = self.asked(Phase::Drain) => {}
            }
        }
    }
}
