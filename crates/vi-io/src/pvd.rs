//! PVD files: which frame belongs to which time. ParaView and pyvista open them as a time series.

use std::io::Write;
use std::path::{Path, PathBuf};

use quick_xml::escape::escape;
use quick_xml::events::Event;
use quick_xml::{Reader, XmlVersion};

use crate::error::{IoError, Place};
use crate::replace::replace_file;

/// A time series of frames, whose file is whole after every [`push`](PvdSeries::push).
#[derive(Clone, Debug, PartialEq)]
pub struct PvdSeries {
    path: PathBuf,
    frames: Vec<(f64, String)>,
}

impl PvdSeries {
    /// A series without frames yet. The file is written with the first one.
    pub fn new(path: &Path) -> Self {
        Self { path: path.into(), frames: Vec::new() }
    }

    /// The series that a PVD file holds, to be continued.
    ///
    /// # Errors
    /// [`IoError::System`] if it cannot be read, [`IoError::Syntax`] if it is no PVD file.
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

    /// Time and file of every frame.
    pub fn frames(&self) -> &[(f64, String)] {
        &self.frames
    }

    /// Makes these the frames, as a run does that continues after them, and replaces the series' file.
    ///
    /// # Errors
    /// [`IoError::System`] if it cannot be written; the old file is then untouched.
    pub fn set_frames(&mut self, frames: Vec<(f64, String)>) -> Result<(), IoError> {
        self.frames = frames;
        self.save()
    }

    /// Adds a frame, its file given relative to the series' own directory, and replaces the series' file.
    ///
    /// # Errors
    /// [`IoError::System`] if it cannot be written; the old file is then untouched.
    pub fn push(&mut self, time: f64, file: &str) -> Result<(), IoError> {
        self.frames.push((time, file.into()));
        self.save()
    }

    fn save(&self) -> Result<(), IoError> {
        replace_file(&self.path, |out| {
            writeln!(
                out,
                "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>"
            )?;
            for (time, file) in &self.frames {
                writeln!(
                    out,
                    "<DataSet timestep=\"{time:?}\" part=\"0\" file=\"{}\"/>",
                    escape(file.as_str())
                )?;
            }
            writeln!(out, "</Collection>\n</VTKFile>")
        })
    }
}
