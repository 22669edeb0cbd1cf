//! history.csv: a row of energies, momenta and probes every n steps. It must not know clock time,
//! so that equal runs are equal files.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use crate::simulation::Observation;

/// Writes history.csv.
pub(crate) struct HistoryWriter {
    file: BufWriter<File>,
}

impl HistoryWriter {
    /// Creates the file and writes its header. Columns: `t` s; energies, J; linear momentum, kg m/s;
    /// angular momentum about the origin, kg m²/s; for each probe position and displacement, m; then
    /// the Newton iterations since the row before.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub(crate) fn create(path: &Path, probes: &[String], has_loads: bool) -> io::Result<Self> {
        let mut file = BufWriter::new(File::create(path)?);
        write!(file, "t,kinetic,elastic,gravity,total,px,py,pz,lx,ly,lz")?;
        for name in probes {
            for column in ["x", "y", "z", "ux", "uy", "uz"] {
                write!(file, ",{name}.{column}")?;
            }
        }
        write!(file, ",newton_iterations")?;
        if has_loads {
            write!(file, ",load")?;
        }
        writeln!(file)?;
        Ok(Self { file })
    }

    /// Appends one row.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub(crate) fn write(&mut self, row: &Observation, iterations: u64, has_loads: bool) -> io::Result<()> {
        let file = &mut self.file;
        write!(file, "{:.16e}", row.t)?;
        let energies = [row.kinetic, row.elastic, row.gravity, row.total()];
        for value in energies.iter().chain(&row.momentum).chain(&row.angular_momentum) {
            write!(file, ",{value:.16e}")?;
        }
        for probe in &row.probes {
            for value in probe.position.iter().chain(&probe.displacement) {
                write!(file, ",{value:.16e}")?;
            }
        }
        write!(file, ",{iterations}")?;
        if has_loads {
            write!(file, ",{:.16e}", row.load)?;
        }
        writeln!(file)
    }

    /// Hands everything to the operating system.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub(crate) fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}
