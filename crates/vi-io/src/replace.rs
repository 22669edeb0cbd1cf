//! Replaces a file as a whole: a reader sees the old one or the new one, never a partial one.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::error::IoError;

/// Writes `path` through a temporary file `<path>.tmp` beside it, which replaces it once it is complete.
///
/// # Errors
/// Returns [`IoError::System`]; the old file is then unchanged and the temporary one removed.
pub fn replace_file(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), IoError> {
    let mut temporary = path.as_os_str().to_owned();
    temporary.push(".tmp");
    let temporary = PathBuf::from(temporary);
    let result = (|| {
        let mut file = BufWriter::with_capacity(1 << 16, File::create(&temporary)?);
        write(&mut file)?;
        file.flush()?;
        drop(file);
        fs::rename(&temporary, path)
    })();
    result.map_err(|source| {
        // The first error is the one to report; the temporary file may not even exist.
        let _ = fs::remove_file(&temporary);
        IoError::System { file: path.into(), action: "write", source }
    })
}
