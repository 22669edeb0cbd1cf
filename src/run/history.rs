//! history.csv: a row of energies, momenta and probes every n steps. It must not know clock time,
//! so that equal runs are equal files.
//! Writing into a text in memory cannot fail; what `write!` returns there is passed over.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

use crate::run::estimate::ProbeEstimate;
use crate::simulation::Observation;

/// Columns that not every run has.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Columns {
    /// The energy of conservative loads other than weight.
    pub(crate) has_loads: bool,
    /// Estimated errors of the probes; empty in rows at which nothing could be compared.
    pub(crate) has_estimates: bool,
    /// `load_factor`, where a path of equilibria is followed.
    pub(crate) has_load_factor: bool,
}

/// Writes history.csv.
pub(crate) struct HistoryWriter {
    file: BufWriter<File>,
    columns: Columns,
    /// Bytes written so far, in the buffer or in the file.
    bytes: u64,
}

/// Work since the row before.
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
    /// Where the file cannot be written.
    pub(crate) fn create(path: &Path, names: &[String], columns: Columns) -> io::Result<Self> {
        let mut writer = Self { file: BufWriter::new(File::create(path)?), columns, bytes: 0 };
        writer.append(names.join(","))?;
        Ok(writer)
    }

    /// Continues a file after its first `bytes`; what is behind them goes.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub(crate) fn resume(path: &Path, columns: Columns, bytes: u64) -> io::Result<Self> {
        let file = File::options().write(true).open(path)?;
        let mut writer = Self { file: BufWriter::new(file), columns, bytes };
        writer.truncate(bytes)?;
        Ok(writer)
    }

    /// Drops what is behind the first `bytes`.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub(crate) fn truncate(&mut self, bytes: u64) -> io::Result<()> {
        self.file.flush()?;
        self.file.get_ref().set_len(bytes)?;
        self.file.seek(SeekFrom::Start(bytes))?;
        self.bytes = bytes;
        Ok(())
    }

    /// Bytes written so far, when they are on the disk.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub(crate) fn sync(&mut self) -> io::Result<u64> {
        self.file.flush()?;
        self.file.get_ref().sync_data()?;
        Ok(self.bytes)
    }

    /// Bytes written so far.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Appends one row; `measures` are the values of the columns of that name.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub(crate) fn write(
        &mut self,
        row: &Observation,
        measures: &[f64],
        work: RowWork,
        estimates: Option<&[ProbeEstimate]>,
    ) -> io::Result<()> {
        let mut line = format!("{:.16e}", row.t);
        let mut number = |value: f64| {
            let _ = write!(line, ",{value:.16e}");
        };
        let energies = [row.kinetic, row.elastic, row.gravity, row.total()];
        energies.iter().chain(&row.momentum).chain(&row.angular_momentum).for_each(|&value| number(value));
        for probe in &row.probes {
            probe.position.iter().chain(&probe.displacement).for_each(|&value| number(value));
        }
        let _ = write!(line, ",{},{}", work.iterations, work.substeps);
        if self.columns.has_loads {
            let _ = write!(line, ",{:.16e}", row.load);
        }
        for pose in &row.rigids {
            for value in pose.position.iter().chain(&pose.orientation) {
                let _ = write!(line, ",{value:.16e}");
            }
        }
        for value in measures {
            let _ = write!(line, ",{value:.16e}");
        }
        if self.columns.has_estimates {
            for index in 0..row.probes.len() {
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
            let _ = write!(line, ",{:.16e}", row.load_factor.unwrap_or(f64::NAN));
        }
        self.append(line)
    }

    fn append(&mut self, mut line: String) -> io::Result<()> {
        line.push('\n');
        self.bytes += line.len() as u64;
        self.file.write_all(line.as_bytes())
    }

    /// Hands everything to the operating system.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub(crate) fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}
