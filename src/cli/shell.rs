//! `variational completions` and `variational man`: describe the command line to shells and to `man`.

use std::path::PathBuf;

use clap::Args;
use clap_complete::Shell;

use super::exit;
use super::say::{self, message, out};

#[derive(Debug, Args)]
pub(super) struct CompletionsArguments {
    /// The shell whose script is printed
    #[arg(value_enum)]
    shell: Shell,
}

#[derive(Debug, Args)]
pub(super) struct ManArguments {
    /// Directory for the pages: variational.1, variational-run.1 …
    directory: PathBuf,
}

/// Prints the completion script of a shell.
pub(super) fn completions(mut command: clap::Command, arguments: &CompletionsArguments) -> u8 {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut command, "variational", &mut script);
    say::write_result(format_args!("{}", String::from_utf8_lossy(&script)));
    exit::DONE
}

/// Writes one manual page per command.
pub(super) fn man(command: clap::Command, arguments: &ManArguments) -> u8 {
    let directory = &arguments.directory;
    let written =
        std::fs::create_dir_all(directory).and_then(|()| clap_mangen::generate_to(command, directory));
    match written {
        Ok(()) => {
            out!(
                "written to {}; read a page with `man -l {}/variational.1`",
                directory.display(),
                directory.display()
            );
            exit::DONE
        }
        Err(error) => {
            message!("error: {}: the manual pages cannot be written: {error}", directory.display());
            exit::INPUT_OUTPUT
        }
    }
}
