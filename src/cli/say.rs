//! Output of a command: results on standard output, messages on standard error. Either may be closed or full; no
//! command ends for that.

use std::fmt::Arguments;
use std::io::{Write, stderr, stdout};
use std::sync::atomic::{AtomicBool, Ordering};

/// Has some of the standard output been lost?
static LOST: AtomicBool = AtomicBool::new(false);

/// Writes to standard output. After a write has failed, nothing more is written.
pub(super) fn write_result(text: Arguments<'_>) {
    if !LOST.load(Ordering::Relaxed) && stdout().write_fmt(text).is_err() {
        LOST.store(true, Ordering::Relaxed);
    }
}

/// Writes to standard error. A message that cannot be written has no other place to go, and is dropped.
pub(super) fn write_message(text: Arguments<'_>) {
    let _ = stderr().write_fmt(text);
}

/// Has everything that was given to [`write_result`] been written?
pub(super) fn all_is_written() -> bool {
    stdout().flush().is_ok() && !LOST.load(Ordering::Relaxed)
}

/// Writes a line of results to standard output.
macro_rules! out {
    ($($text:tt)*) => {
        $crate::cli::say::write_result(format_args!("{}\n", format_args!($($text)*)))
    };
}

/// Writes a line to standard error.
macro_rules! message {
    ($($text:tt)*) => {
        $crate::cli::say::write_message(format_args!("{}\n", format_args!($($text)*)))
    };
}

pub(super) use {message, out};
