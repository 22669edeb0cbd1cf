//! Passes the compiler version and the commit of the build to the program.

use std::process::Command;

fn main() {
    for path in ["build.rs", "src", "crates", "Cargo.toml", "Cargo.lock"] {
        println!("cargo::rerun-if-changed={path}");
    }
    let compiler = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    let version = said(Command::new(compiler).arg("--version")).unwrap_or_else(|| "unknown".to_owned());
    println!("cargo::rustc-env=VARIATIONAL_COMPILER={version}");
    // Without a repository, for example in a package, there is no commit.
    let Some(commit) = said(Command::new("git").args(["rev-parse", "--short=12", "HEAD"])) else { return };
    let changed = said(Command::new("git").args(["status", "--porcelain", "--untracked-files=no"]));
    let mark = if changed.is_some_and(|files| !files.is_empty()) { "+" } else { "" };
    println!("cargo::rustc-env=VARIATIONAL_COMMIT={commit}{mark}");
    if let Some(log) = said(Command::new("git").args(["rev-parse", "--git-path", "logs/HEAD"])) {
        println!("cargo::rerun-if-changed={log}");
    }
}

/// Returns the output of a command, if it succeeds.
fn said(command: &mut Command) -> Option<String> {
    let output = command.output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}
