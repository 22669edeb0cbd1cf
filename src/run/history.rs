//! Writes history.csv: a row of energies, momenta and probes every n steps. Writing to a string cannot fail, so results
//! of `write!` are ignored.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::error::RunError;
use super::observer::{Observer, Purpose, Row, Sight};
use super::probe_estimate::ProbeEstimate;
use super::report::Report;
use crate::record::{Bytes, record};
use crate::simulation::Simulation;

/// Optional columns.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Columns {
    /// Energy of conservative loads other than weight.
    pub(crate) has_loads: bool,
    /// Estimated errors of the probes; empty in rows without a comparison.
    pub(crate) has_estimates: bool,
    /// `load_factor`, if a path of equilibria is followed.
    pub(crate) has_load_factor: bool,
}

/// Writes history.csv.
pub(crate) struct HistoryWriter {
    path: PathBuf,
    file: BufWriter<File>,
    columns: Columns,
    written: Written,
}

/// Position in the file.
#[derive(Debug, Clone, Copy, Default)]
struct Written {
    /// Number of bytes written so far, in the buffer or in the file.
    bytes: u64,
    /// The step of the last row.
    step: u64,
    /// Work since the last row.
    work: RowWork,
}

record!(RowWork { iterations: u64, substeps: u64 });
record!(Written { bytes: u64, step: u64, work: RowWork });

/// Work since the previous row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct RowWork {
    /// Newton iterations.
    pub(crate) iterations: u64,
    /// Substeps of steps that were cut.
    pub(crate) substeps: u64,
}

impl HistoryWriter {
    /// Creates the file and writes its header, the names of all columns (`scene/columns.rs`).
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub(crate) fn create(path: &Path, names: &[String], columns: Columns) -> io::Result<Self> {
        let file = BufWriter::new(File::create(path)?);
        let mut writer = Self { path: path.to_owned(), file, columns, written: Written::default() };
        writer.append(names.join(","))?;
        Ok(writer)
    }

    /// Continues a file after its first `bytes`; [`HistoryWriter::restore`] removes the rest.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub(crate) fn resume(path: &Path, columns: Columns, bytes: u64) -> io::Result<Self> {
        let file = File::options().write(true).open(path)?;
        let (path, written) = (path.to_owned(), Written { bytes, ..Written::default() });
        Ok(Self { path, file: BufWriter::new(file), columns, written })
    }

    /// Removes everything after the first `bytes`.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    fn truncate(&mut self, bytes: u64) -> io::Result<()> {
        self.file.flush()?;
        self.file.get_ref().set_len(bytes)?;
        self.file.seek(SeekFrom::Start(bytes))?;
        Ok(())
    }

    /// Waits until all bytes written so far are on disk.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub(crate) fn sync(&mut self) -> io::Result<()> {
        self.file.flush()?;
        self.file.get_ref().sync_data()
    }

    /// Returns the number of bytes written so far.
    pub(crate) fn bytes(&self) -> u64 {
        self.written.bytes
    }

    /// Returns the step of the last row.
    pub(crate) fn last_step(&self) -> u64 {
        self.written.step
    }

    /// Appends one row.
    fn write(&mut self, row: &Row<'_>) -> io::Result<()> {
        let Row { step, seen, measures, estimates } = row;
        let work = std::mem::take(&mut self.written.work);
        self.written.step = *step;
        let mut line = format!("{:.16e}", seen.t);
        let mut number = |value: f64| {
            let _ = write!(line, ",{value:.16e}");
        };
        let energies = [seen.kinetic, seen.elastic, seen.gravity, seen.total()];
        energies.iter().chain(&seen.momentum).chain(&seen.angular_momentum).for_each(|&value| number(value));
        for probe in &seen.probes {
            probe.position.iter().chain(&probe.displacement).for_each(|&value| number(value));
        }
        let _ = write!(line, ",{},{}", work.iterations, work.substeps);
        if self.columns.has_loads {
            let _ = write!(line, ",{:.16e}", seen.load);
        }
        if let Some(facts) = &seen.contact_facts {
            for energy in [seen.contact, facts.friction, facts.damping] {
                let _ = write!(line, ",{energy:.16e}");
            }
            let _ = write!(line, ",{},{:.16e}", facts.pairs, facts.smallest_gap);
        }
        for pose in &seen.rigids {
            for value in pose.position.iter().chain(&pose.orientation) {
                let _ = write!(line, ",{value:.16e}");
            }
        }
        for value in *measures {
            let _ = write!(line, ",{value:.16e}");
        }
        if self.columns.has_estimates {
            for index in 0..seen.probes.len() {
                match estimates.map(|estimates| estimates[index]) {
                    Some(ProbeEstimate { error: [x, y, z], observed_order }) => {
                        let _ = write!(line, ",{x:.16e},{y:.16e},{z:.16e},");
                        if let Some(order) = observed_order {
                            let _ = write!(line, "{order:.16e}");
                        }
                    }
                    None => line.push_str(",,,,"),
                }
            }
        }
        if self.columns.has_load_factor {
            let _ = write!(line, ",{:.16e}", seen.load_factor.unwrap_or(f64::NAN));
        }
        self.append(line)
    }

    fn append(&mut self, mut line: String) -> io::Result<()> {
        line.push('\n');
        self.written.bytes += line.len() as u64;
        self.file.write_all(line.as_bytes())
    }

    /// Passes everything written to the operating system.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub(crate) fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Observer for HistoryWriter {
    fn name(&self) -> &'static str {
        "history"
    }

    fn see(&mut self, sight: &Sight<'_>) -> Result<(), RunError> {
        match sight {
            Sight::Steps(stepped) => {
                self.written.work.iterations += stepped.iterations;
                self.written.work.substeps += stepped.substeps + stepped.adaptive_steps;
            }
            Sight::Row(row) => self.write(row).map_err(RunError::output(&self.path))?,
            _ => {}
        }
        Ok(())
    }

    fn snapshot(&self, _: Purpose) -> Bytes {
        Bytes::of(&self.written)
    }

    fn restore(&mut self, snapshot: &Bytes) -> Result<(), RunError> {
        self.written = snapshot.value()?;
        self.truncate(self.written.bytes).map_err(RunError::output(&self.path))
    }

    fn report(&self, _: &Simulation, _: &mut Report) {}
}
