//! The signals that end a command: Ctrl-C (SIGINT), SIGTERM and SIGHUP. After the first one, the command abandons the step in
//! progress and writes its results; a second one ends it immediately.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use vi_solvers::Interrupt;

use super::exit;
use super::say::message;

/// Records whether a signal has requested the end of the command.
#[derive(Debug, Clone, Default)]
pub(super) struct Stop {
    is_asked: Arc<AtomicBool>,
    signal: Arc<AtomicUsize>,
}

impl Stop {
    /// Starts to listen for the signals.
    pub(super) fn on_signals() -> Self {
        let stop = Self::default();
        for signal in signals() {
            if let Err(error) = stop.listen(signal) {
                message!("note: signal {signal} will end at once, without writing: {error}");
            }
        }
        stop
    }

    /// Actions run in the order of their registration. A signal after another one ends the process, and the number is
    /// stored before the flag is set.
    fn listen(&self, signal: i32) -> std::io::Result<()> {
        flag::register_conditional_shutdown(signal, 128 + signal, Arc::clone(&self.is_asked))?;
        flag::register_usize(signal, Arc::clone(&self.signal), signal as usize)?;
        flag::register(signal, Arc::clone(&self.is_asked))?;
        Ok(())
    }

    /// Returns whether a signal was received.
    pub(super) fn is_asked(&self) -> bool {
        self.is_asked.load(Ordering::SeqCst)
    }

    /// Returns the request that a signal makes to solvers.
    pub(super) fn interrupt(&self) -> Interrupt {
        Interrupt::from(Arc::clone(&self.is_asked))
    }

    /// Returns the exit code of a command that was ended by a signal: 128 + its number.
    pub(super) fn code(&self) -> u8 {
        match self.signal.load(Ordering::SeqCst) {
            0 => exit::INTERRUPTED,
            signal => 128 + signal as u8,
        }
    }
}

fn signals() -> Vec<i32> {
    let mut signals = vec![SIGINT, SIGTERM];
    #[cfg(unix)]
    if !is_ignored(signal_hook::consts::SIGHUP) {
        signals.push(signal_hook::consts::SIGHUP);
    }
    signals
}

/// Returns whether the program was started with this signal ignored, as `nohup` does with SIGHUP; false if the system
/// does not provide this information.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask >> (signal - 1) & 1 == 1
}
