//! Reads and writes PVD files, which list frames with their times. ParaView and pyvista open them as a time series.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use quick_xml::escape::escape;
use quick_xml::events::Event;
use quick_xml::{Reader, XmlVersion};

use crate::error::{IoError, Place};
use crate::replace::replace_file;

const OPENING: &str =
    "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n";
const CLOSING: &str = "</Collection>\n</VTKFile>\n";

/// A time series of frames, whose file is valid after every [`push`](PvdSeries::push).
///
/// A frame is appended over the closing tags, which are written again after it in the same call to the operating
/// system. So a series of n frames costs n entries and not n²/2. A process that is killed leaves a valid file; after a
/// power failure [`set_frames`](PvdSeries::set_frames) repairs it.
#[derive(Clone, Debug, PartialEq)]
pub struct PvdSeries {
    path: PathBuf,
    frames: Vec<(f64, String)>,
}

impl PvdSeries {
    /// Makes a series without frames. The file is written with the first frame.
    pub fn new(path: &Path) -> Self {
        Self { path: path.into(), frames: Vec::new() }
    }

    /// Opens the series of a PVD file, to continue it.
    ///
    /// # Errors
    /// Returns [`IoError::System`] if it cannot be read, [`IoError::Syntax`] if it is not a PVD file.
    pub fn open(path: &Path) -> Result<Self, IoError> {
        let text = std::fs::read_to_string(path).map_err(|source| IoError::System {
            file: path.into(),
            action: "read",
            source,
        })?;
        let mut reader = Reader::from_str(&text);
        let mut frames = Vec::new();
        loop {
            let at = reader.buffer_position() as usize;
            let wrong = |found: String| IoError::Syntax {
                file: path.into(),
                place: Place::Line(
                    1 + text.as_bytes()[..at.min(text.len())].iter().filter(|&&b| b == b'\n').count(),
                ),
                expected: "a DataSet with timestep and file".into(),
                found,
            };
            match reader.read_event().map_err(|error| wrong(error.to_string()))? {
                Event::Eof => break,
                Event::Start(tag) | Event::Empty(tag) if tag.local_name().as_ref() == "DataSet" => {
                    let (mut time, mut file) = (None, None);
                    for attribute in tag.attributes() {
                        let attribute = attribute.map_err(|error| wrong(error.to_string()))?;
                        let value = attribute
                            .normalized_value(XmlVersion::Implicit1_0)
                            .map_err(|error| wrong(error.to_string()))?;
                        match attribute.key.as_ref() {
                            "timestep" => time = value.trim().parse().ok(),
                            "file" => file = Some(value.into_owned()),
                            _ => {}
                        }
                    }
                    frames.push(time.zip(file).ok_or_else(|| wrong("another element".into()))?);
                }
                _ => {}
            }
        }
        Ok(Self { path: path.into(), frames })
    }

    /// Returns the time and the file of every frame.
    pub fn frames(&self) -> &[(f64, String)] {
        &self.frames
    }

    /// Replaces the frames and the file of the series, as a continued run does.
    ///
    /// # Errors
    /// Returns [`IoError::System`] if it cannot be written; the old file is then unchanged.
    pub fn set_frames(&mut self, frames: Vec<(f64, String)>) -> Result<(), IoError> {
        self.frames = frames;
        self.save()
    }

    /// Adds a frame, whose file is given relative to the series' own directory, and appends it to the series' file. The
    /// first frame replaces the file of an earlier series.
    ///
    /// # Errors
    /// Returns [`IoError::System`] if it cannot be written; the series and its file are then unchanged.
    pub fn push(&mut self, time: f64, file: &str) -> Result<(), IoError> {
        let is_first = self.frames.is_empty();
        self.frames.push((time, file.into()));
        let appended = match is_first {
            true => Ok(false),
            false => append(&self.path, &entry(time, file)),
        };
        let written = match appended {
            Ok(true) => Ok(()),
            Ok(false) => self.save(),
            Err(source) => Err(IoError::System { file: self.path.clone(), action: "write", source }),
        };
        if written.is_err() {
            self.frames.pop();
        }
        written
    }

    fn save(&self) -> Result<(), IoError> {
        replace_file(&self.path, |out| {
            out.write_all(OPENING.as_bytes())?;
            for (time, file) in &self.frames {
                out.write_all(entry(*time, file).as_bytes())?;
            }
            out.write_all(CLOSING.as_bytes())
        })
    }
}

fn entry(time: f64, file: &str) -> String {
    format!("<DataSet timestep=\"{time:?}\" part=\"0\" file=\"{}\"/>\n", escape(file))
}

/// Appends an entry to the file of a series. Returns false if the file does not end as a series does, because it was
/// removed or changed.
fn append(path: &Path, entry: &str) -> io::Result<bool> {
    let mut file = match File::options().read(true).write(true).open(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(false),
        opened => opened?,
    };
    let length = file.metadata()?.len();
    let Some(end) = length.checked_sub(CLOSING.len() as u64) else { return Ok(false) };
    let mut closing = [0; CLOSING.len()];
    file.seek(SeekFrom::Start(end))?;
    file.read_exact(&mut closing)?;
    if closing != CLOSING.as_bytes() {
        return Ok(false);
    }
    file.seek(SeekFrom::Start(end))?;
    let written = file.write_all(format!("{entry}{CLOSING}").as_bytes());
    if written.is_err() {
        // The disk is full. The closing tags fit, because they were there before. The first error is the one to report.
        let _ = file.seek(SeekFrom::Start(end)).and_then(|_| file.write_all(CLOSING.as_bytes()));
        let _ = file.set_len(length);
    }
    written.map(|()| true)
}
