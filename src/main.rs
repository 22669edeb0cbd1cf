//! The command-line program: a shim over [`variational::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    variational::cli::main(std::env::args_os())
}
