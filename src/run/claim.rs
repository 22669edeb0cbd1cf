//! Grants the right to write into a directory to one process at a time.
//!
//! A claim is a lock of the operating system on the file `variational.lock`. The system releases it when the process
//! ends, however it ends. So the file of a killed process blocks nobody, even if its process number is in use again.

use std::fs::{self, File, TryLockError};
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;

use same_file::Handle;

/// Name of the file that is locked.
const LOCK: &str = "variational.lock";

/// Error that prevents a claim on a directory.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ClaimError {
    /// Another process writes into the directory.
    #[error(
        "{}: {holder} is writing into this directory; wait until it has ended, or choose another directory with --out",
        .directory.display()
    )]
    Held {
        /// The directory.
        directory: PathBuf,
        /// `process 123`, or `another process` if its number cannot be read.
        holder: String,
    },
    /// The directory or its lock file cannot be created.
    #[error("{}: {source}", .path.display())]
    Output {
        /// The directory or the lock file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}

/// A directory that this process may write into as long as the value lives.
///
/// The directory is created if it is missing, and removed with the claim if nothing has been written into it.
#[derive(Debug)]
pub struct Claim {
    path: PathBuf,
    lock: Handle,
    is_locked: bool,
    /// Directories that were created for it, innermost first.
    made: Vec<PathBuf>,
}

impl Claim {
    /// Claims a directory.
    ///
    /// # Errors
    /// Returns [`ClaimError`] if another process or another claim holds it, or if it cannot be written into.
    pub fn new(directory: &Path) -> Result<Self, ClaimError> {
        let path = directory.join(LOCK);
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |source| ClaimError::Output { path, source }
        };
        let is_missing = |path: &&Path| !path.as_os_str().is_empty() && !path.exists();
        let made = directory.ancestors().take_while(is_missing).map(Path::to_owned).collect();
        loop {
            fs::create_dir_all(directory).map_err(failed(directory))?;
            let file = match File::options().read(true).write(true).create(true).truncate(false).open(&path) {
                // Another claim was just dropped, and its directory was removed with it.
                Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
                opened => opened.map_err(failed(&path))?,
            };
            let is_locked = match file.try_lock() {
                Ok(()) => true,
                Err(TryLockError::WouldBlock) => {
                    return Err(ClaimError::Held { directory: directory.to_owned(), holder: holder(file) });
                }
                Err(TryLockError::Error(error)) if error.kind() == io::ErrorKind::Unsupported => false,
                Err(TryLockError::Error(error)) => return Err(failed(&path)(error)),
            };
            let lock = Handle::from_file(file).map_err(failed(&path))?;
            // The holder may have removed the file between our opening and our locking it.
            if Handle::from_path(&path).is_ok_and(|there| there == lock) {
                let mut claim = Self { path, lock, is_locked, made };
                claim.sign().map_err(failed(&claim.path))?;
                return Ok(claim);
            }
        }
    }

    /// Writes the number of this process, for the messages of other processes.
    fn sign(&mut self) -> io::Result<()> {
        let file = self.lock.as_file_mut();
        file.set_len(0)?;
        writeln!(file, "process {}", std::process::id())
    }

    /// Removes the lock file that a killed process has left in a directory. Does nothing if there is none, or if a
    /// process holds it.
    #[cfg(any(feature = "cli", test))]
    pub(crate) fn remove_stale(directory: &Path) {
        if directory.join(LOCK).exists() {
            drop(Self::new(directory));
        }
    }

    /// Returns a note if the directory lies on a file system without locks.
    pub fn note(&self) -> Option<String> {
        let place = self.path.parent()?.display();
        (!self.is_locked).then(|| {
            format!("the file system of {place} has no locks: see to it that no other process writes there")
        })
    }
}

impl Drop for Claim {
    /// Removes the lock file and the directories made for it. The lock ends with the last handle of the file, after the
    /// file is removed. A removal may fail and is then ignored: it leaves a lock file that nobody holds, or a directory
    /// in use.
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.path);
        for directory in &self.made {
            let _ = fs::remove_dir(directory);
        }
    }
}

/// Returns `process 123`, or `another process` if its number cannot be read. The holder writes its number just after it
/// has locked the file, so an incomplete line is read again, for up to a second.
fn holder(mut file: File) -> String {
    for _ in 0..100 {
        let mut text = String::new();
        if file.rewind().and_then(|()| file.read_to_string(&mut text)).is_err() {
            break;
        }
        if text.starts_with("process ") && text.ends_with('\n') {
            return text.trim_end().to_owned();
        }
        thread::sleep(Duration::from_millis(10));
    }
    "another process".to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_claim_at_a_time_and_nothing_is_left_of_it() {
        let parent = tempfile::tempdir().unwrap();
        let directory = parent.path().join("a/b");
        let claim = Claim::new(&directory).unwrap();
        let own = format!("process {}", std::process::id());
        let error = Claim::new(&directory).unwrap_err();
        assert!(matches!(&error, ClaimError::Held { holder, .. } if *holder == own), "{error}");
        drop(claim);
        assert!(!parent.path().join("a").exists());
    }

    /// The number of a holder that is between its lock and its signature is awaited.
    #[test]
    fn a_holder_that_has_not_signed_yet_is_named() {
        let directory = tempfile::tempdir().unwrap();
        let mut claim = Claim::new(directory.path()).unwrap();
        let file = claim.lock.as_file_mut();
        file.set_len(0).and_then(|()| file.rewind()).unwrap();
        let own = format!("process {}", std::process::id());
        thread::scope(|scope| {
            let other = scope.spawn(|| Claim::new(directory.path()).unwrap_err());
            thread::sleep(Duration::from_millis(50));
            claim.sign().unwrap();
            let error = other.join().unwrap();
            assert!(matches!(&error, ClaimError::Held { holder, .. } if *holder == own), "{error}");
        });
    }

    #[test]
    fn a_file_of_a_process_that_is_gone_bars_nobody() {
        let directory = tempfile::tempdir().unwrap();
        // Process 1 always exists, so the number alone does not show that the lock is held.
        fs::write(directory.path().join(LOCK), "process 1\n").unwrap();
        let claim = Claim::new(directory.path()).unwrap();
        fs::write(directory.path().join("kept"), "").unwrap();
        drop(claim);
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
    }

    #[test]
    fn only_a_stale_lock_file_is_removed() {
        let directory = tempfile::tempdir().unwrap();
        let claim = Claim::new(directory.path()).unwrap();
        Claim::remove_stale(directory.path());
        assert!(directory.path().join(LOCK).exists());
        drop(claim);
        fs::write(directory.path().join(LOCK), "process 1\n").unwrap();
        Claim::remove_stale(directory.path());
        assert!(!directory.path().join(LOCK).exists());
    }
}
