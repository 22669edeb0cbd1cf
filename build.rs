//! Tells the program which compiler and commit it was built from.

use std::process::Command;

fn main() {
    for path in ["build.rs", "src", "crates", "Cargo.toml", "Cargo.lock"] {
        println!("cargo::rerun-if-changed={path}");
    }
    let compiler = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    let version = said(Command::new(compiler).arg("--version")).unwrap_or_else(|| "unknown".to_owned());
    println!("cargo::rustc-env=VARIATIONAL_COMPILER={version}");
    // Built from a package there is no repository, and no commit to name.
    let Some(commit) = said(Command::new("git").args(["rev-parse", "--short=12", "HEAD"])) else { return };
    let changed = said(Command::new("git").args(["status", "--porcelain", "--untracked-files=no"]));
    let mark = if changed.is_some_and(|files| !files.is_empty()) { "+" } else { "" };
    println!("cargo::rustc-env=VARIATIONAL_COMMIT={commit}{mark}");
    if let Some(log) = said(Command::new("git").args(["rev-parse", "--git-path", "logs/HEAD"])) {
        println!("cargo::rerun-if-changed={log}");
    }
}

/// What a command prints, where it succeeds.
fn said(command: &mut Command) -> Option<String> {
    let output = command.output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}
