//! history.csv: a row of energies, momenta and probes every n steps. It must not know clock time,
//! so that equal runs are equal files.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use crate::estimate::ProbeEstimate;
use crate::simulation::Observation;

/// Columns that not every run has.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Columns {
    /// `load`: the energy of conservative loads other than weight, J.
    pub(crate) has_loads: bool,
    /// For each probe `ex ey ez`, the estimated |error| of its displacement, m, and the observed `order`;
    /// empty in rows at which nothing could be compared.
    pub(crate) has_estimates: bool,
}

/// Writes history.csv.
pub(crate) struct HistoryWriter {
    file: BufWriter<File>,
    columns: Columns,
}

impl HistoryWriter {
    /// Creates the file and writes its header. Columns: `t` s; energies, J; linear momentum, kg m/s;
    /// angular momentum about the origin, kg m²/s; for each probe position and displacement, m; then
    /// the Newton iterations since the row before.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub(crate) fn create(path: &Path, probes: &[String], columns: Columns) -> io::Result<Self> {
        let mut file = BufWriter::new(File::create(path)?);
        write!(file, "t,kinetic,elastic,gravity,total,px,py,pz,lx,ly,lz")?;
        for name in probes {
            for column in ["x", "y", "z", "ux", "uy", "uz"] {
                write!(file, ",{name}.{column}")?;
            }
        }
        write!(file, ",newton_iterations")?;
        if columns.has_loads {
            write!(file, ",load")?;
        }
        if columns.has_estimates {
            for name in probes {
                for column in ["ex", "ey", "ez", "order"] {
                    write!(file, ",{name}.{column}")?;
                }
            }
        }
        writeln!(file)?;
        Ok(Self { file, columns })
    }

    /// Appends one row.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub(crate) fn write(
        &mut self,
        row: &Observation,
        iterations: u64,
        estimates: Option<&[ProbeEstimate]>,
    ) -> io::Result<()> {
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
        if self.columns.has_loads {
            write!(file, ",{:.16e}", row.load)?;
        }
        if self.columns.has_estimates {
            for index in 0..row.probes.len() {
                match estimates.map(|estimates| estimates[index]) {
                    Some(ProbeEstimate { error: [x, y, z], observed_order }) => {
                        write!(file, ",{x:.16e},{y:.16e},{z:.16e},")?;
                        if let Some(order) = observed_order {
                            write!(file, "{order:.16e}")?;
                        }
                    }
                    None => write!(file, ",,,,")?,
                }
            }
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
