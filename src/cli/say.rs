//! Output of a command: results on standard output, messages on standard error. Either may be closed or full; this
//! does not end a command.

use std::fmt::Arguments;
use std::io::{Write, stderr, stdout};
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;

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

/// Amount of output of a command. These options have the same meaning for every command.
#[derive(Debug, Clone, Copy, Args)]
pub(super) struct Say {
    /// Print only errors, warnings and notes (on standard error)
    #[arg(long, short)]
    pub(super) quiet: bool,
    /// Print the result as one JSON document on standard output; errors, warnings and notes stay on standard error
    #[arg(long)]
    pub(super) json: bool,
}

impl Say {
    /// Returns whether progress and text for a reader are omitted.
    pub(super) fn is_brief(&self) -> bool {
        self.quiet || self.json
    }

    /// Outputs a result: as JSON, with `print`, or not at all.
    pub(super) fn result(&self, result: &impl serde::Serialize, print: impl FnOnce()) {
        if self.json {
            match serde_json::to_string_pretty(result) {
                Ok(text) => out!("{text}"),
                Err(error) => message!("error: {error}"),
            }
        } else if !self.quiet {
            print();
        }
    }
}

/// Whether a part of the standard output was lost.
static LOST: AtomicBool = AtomicBool::new(false);

/// Writes to standard output. After a write has failed, nothing more is written.
pub(super) fn write_result(text: Arguments<'_>) {
    if !LOST.load(Ordering::Relaxed) && stdout().write_fmt(text).is_err() {
        LOST.store(true, Ordering::Relaxed);
    }
}

/// Writes to standard error. A message that cannot be written is dropped.
pub(super) fn write_message(text: Arguments<'_>) {
    let _ = stderr().write_fmt(text);
}

/// Returns whether all text of [`write_result`] has been written.
pub(super) fn all_is_written() -> bool {
    stdout().flush().is_ok() && !LOST.load(Ordering::Relaxed)
}
