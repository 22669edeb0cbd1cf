//! The signals that end a command: Ctrl-C (SIGINT), SIGTERM and SIGHUP. After the first one, the command abandons the step in
//! progress and writes its results; a second one ends it immediately, unless it follows at once: `timeout` and batch systems send the same
//! signal to the process and to its group.

use std::sync::Arc;
#[cfg(unix)]
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
#[cfg(unix)]
use std::time::{Duration, Instant};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use vi_solvers::Interrupt;

use super::exit;
use super::say::message;

/// Signals that follow another one within this time belong to it.
#[cfg(unix)]
const ECHO: Duration = Duration::from_millis(500);

/// Whether the process runs this program alone, so that it may block signals in its threads.
#[cfg(unix)]
static OWNS_PROCESS: OnceLock<()> = OnceLock::new();

/// Declares that the process runs this program alone. Call it before other threads start.
pub(super) fn own_process() {
    #[cfg(unix)]
    OWNS_PROCESS.get_or_init(|| ());
}

/// Records whether a signal has requested the end of the command.
#[derive(Debug, Clone, Default)]
pub(super) struct Stop {
    is_asked: Arc<AtomicBool>,
    signal: Arc<AtomicUsize>,
}

impl Stop {
    /// Starts to listen for the signals. Call it before the threads of the command start: they inherit which signals are blocked.
    pub(super) fn on_signals() -> Self {
        let stop = Self::default();
        #[cfg(unix)]
        if OWNS_PROCESS.get().is_some() && stop.wait_in_own_thread().is_ok() {
            return stop;
        }
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

    /// Blocks the signals in this thread and its descendants, and waits for them in a thread of its own. While METIS orders a
    /// matrix, it replaces the handler of SIGTERM by a jump within its own thread; in another thread, that jump crashes.
    #[cfg(unix)]
    fn wait_in_own_thread(&self) -> std::io::Result<()> {
        let numbers = signals().into_iter().map(nix::sys::signal::Signal::try_from);
        let set: nix::sys::signal::SigSet = numbers.collect::<nix::Result<_>>()?;
        set.thread_block()?;
        let stop = self.clone();
        let listener = move || {
            let mut last: Option<Instant> = None;
            while let Ok(signal) = set.wait() {
                let signal = signal as i32;
                if let Some(last) = last.replace(Instant::now()) {
                    if last.elapsed() < ECHO {
                        continue;
                    }
                    signal_hook::low_level::exit(128 + signal);
                }
                stop.signal.store(signal as usize, Ordering::SeqCst);
                stop.is_asked.store(true, Ordering::SeqCst);
            }
        };
        if let Err(error) = std::thread::Builder::new().spawn(listener) {
            set.thread_unblock()?;
            return Err(error);
        }
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
