//! The names of the files of frames: `<name>_000012.vtu`, or `<name>_000012.pvtu` with pieces `<name>_000012_p000.vtu` ….

use std::path::{Path, PathBuf};

use vi_io::IoError;

/// Returns the files of all frames of the run `name` from number `first` on, with their pieces.
///
/// # Errors
/// Returns an error if the directory cannot be listed.
pub(super) fn files_from(directory: &Path, name: &str, first: usize) -> Result<Vec<PathBuf>, IoError> {
    let refused = |source| IoError::System { file: directory.to_owned(), action: "list", source };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(directory).map_err(refused)? {
        let entry = entry.map_err(refused)?;
        let number = entry.file_name().to_str().and_then(|file| frame_number(name, file));
        if number.is_some_and(|number| number >= first) {
            files.push(entry.path());
        }
    }
    Ok(files)
}

/// Returns the file name of a frame of the run `name`.
pub(super) fn frame_file(name: &str, number: usize, is_in_pieces: bool) -> String {
    let extension = if is_in_pieces { "pvtu" } else { "vtu" };
    format!("{name}_{number:06}.{extension}")
}

/// Returns the number of a frame of the run `name`, if `file` is the name of one, of its list of pieces, or of a piece.
pub(crate) fn frame_number(name: &str, file: &str) -> Option<usize> {
    let is_number =
        |text: &str, least: usize| text.len() >= least && text.bytes().all(|byte| byte.is_ascii_digit());
    let rest = file.strip_prefix(name)?.strip_prefix('_')?;
    let digits = match rest.strip_suffix(".vtu") {
        Some(digits) => match digits.split_once("_p") {
            Some((digits, piece)) if is_number(piece, 3) => digits,
            _ => digits,
        },
        None => rest.strip_suffix(".pvtu")?,
    };
    is_number(digits, 6).then(|| digits.parse().ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_frames_are_told_from_others() {
        for is_in_pieces in [false, true] {
            assert_eq!(frame_number("a_b", &frame_file("a_b", 12, is_in_pieces)), Some(12));
        }
        assert_eq!(frame_number("run", "run_1234567_p003.vtu"), Some(1_234_567));
        for other in ["run_00001.vtu", "run_000001_p1.vtu", "run_000001_p.vtu", "run_b_000001.vtu", "run.pvd"]
        {
            assert_eq!(frame_number("run", other), None, "{other}");
        }
    }
}
