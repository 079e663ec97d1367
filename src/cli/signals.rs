//! Ctrl-C and requests to terminate.

use tokio::sync::mpsc;

/// Interrupted by Ctrl-C, as shells count it.
pub const INTERRUPTED: u8 = 130;

/// A word for each signal.
pub fn listen() -> mpsc::UnboundedReceiver<()> {
    let (sender, receiver) = mpsc::unbounded_channel();
    tokio::spawn(async move {
        loop {
            #[cfg(unix)]
            {
                use tokio::signal::unix::{SignalKind, signal};
                let Ok(mut terminate) = signal(SignalKind::terminate()) else { return };
                tokio::select! {
                    _ = tokio::signal::ctrl_c() => {}
                    _ = terminate.recv() => {}
                }
            }
            #[cfg(not(unix))]
            if tokio::signal::ctrl_c().await.is_err() {
                return;
            }
            if sender.send(()).is_err() {
                return;
            }
        }
    });
    receiver
}
