//! A run by several processes (ranks). The first rank runs the scene and writes all files, as one process does. The
//! others build the same scene and step their portions of its bodies whenever the first rank says so.

use std::fs::File;
use std::io::Read;
use std::sync::Arc;

use vi_core::{Alone, Exchange, Traffic};
use vi_solvers::{Member, SolverError};

use super::checkpoint::Origin;
use super::error::RunError;
use crate::record::{self, record};
use crate::scene::{LinearChoice, Problem, Scene};
use crate::simulation::{RankFacts, Simulation, are_complete, is_shared, members, problems_of_ranks};

/// The first bytes of the message with which the first rank starts a run; a command to step begins with other bytes.
const START: &[u8; 8] = b"VI-START";
/// The first bytes of the message with which the first rank ends the program; the exit code follows.
const END: &[u8; 8] = b"VI-ENDED";
const FORMAT: u64 = 2;

/// The ranks of a run.
pub struct Team {
    exchange: Arc<dyn Exchange>,
    /// Number of threads of each rank unless the command line says otherwise.
    threads: Option<usize>,
}

/// The settings of a run, which must be equal on all ranks.
struct Order {
    /// CRC-32 of the program.
    program: u64,
    threads: u64,
    /// 1 if the other ranks generate only the parts of the bodies that they need, else 0.
    in_parts: u64,
    origin: Origin,
}

record!(Order { program: u64, threads: u64, in_parts: u64, origin: Origin });

/// The answer of a rank to an order.
struct Answer {
    /// The reason why the rank cannot run the scene; empty if it can.
    problem: String,
    /// 1 if the parts of the bodies that the rank holds do not suffice for its portion, else 0.
    is_incomplete: u64,
    /// Number of bytes that the rank sends per evaluation of forces.
    bytes: u64,
    node_sum_bytes: u64,
}

record!(Answer { problem: String, is_incomplete: u64, bytes: u64, node_sum_bytes: u64 });

/// A simulation that all ranks have built.
struct Built {
    simulation: Simulation,
    /// The traffic per evaluation of forces of the rank that sends most.
    most: Traffic,
    /// Whether every rank could make its portion from a part of the bodies, if it should.
    is_complete: bool,
}

impl Default for Team {
    fn default() -> Self {
        Self::new(Arc::new(Alone))
    }
}

impl Team {
    /// Returns the team of all ranks of an exchange.
    pub fn new(exchange: Arc<dyn Exchange>) -> Self {
        Self { exchange, threads: None }
    }

    /// Returns the team with a number of threads for each rank, which the command line may replace.
    #[must_use]
    pub fn with_threads(self, threads: usize) -> Self {
        Self { threads: Some(threads), ..self }
    }

    /// Returns the number of threads of each rank; `None` for one per core.
    pub fn threads(&self) -> Option<usize> {
        self.threads
    }

    /// Returns the number of ranks.
    pub fn size(&self) -> usize {
        self.exchange.size()
    }

    /// Returns the keys of a scene that these ranks do not run.
    pub(crate) fn problems(&self, scene: &Scene) -> Vec<Problem> {
        let mut problems = Vec::new();
        if scene.solver.linear == LinearChoice::Petsc && self.exchange.linear_solver().is_none() {
            problems.push(Problem::new("solver.linear", SolverError::no_petsc().to_string()));
        }
        if is_shared(scene, &self.exchange) {
            problems.extend(problems_of_ranks(scene));
        }
        problems
    }

    /// Builds the simulation of a scene that all ranks share, on the first rank. Also returns a note on the messages
    /// that they exchange; `None` if there is one rank.
    ///
    /// # Errors
    /// Returns [`RunError::Scene`] with the problems of the scene, with what does not run on several ranks, and with the
    /// first problem of another rank.
    pub(super) fn build(&self, scene: Scene, name: &str) -> Result<(Simulation, Option<String>), RunError> {
        let size = self.size();
        let problems = self.problems(&scene);
        if !problems.is_empty() {
            return Err(RunError::Scene(problems));
        }
        if !is_shared(&scene, &self.exchange) {
            return Ok((Simulation::new(scene).map_err(RunError::Scene)?, None));
        }
        let threads = rayon::current_num_threads() as u64;
        let mut made = self.build_by_all((scene.clone(), name), threads, true)?;
        if !made.is_complete {
            // The part of a rank does not suffice: all build the whole bodies.
            made = self.build_by_all((scene, name), threads, false)?;
        }
        let Built { simulation, most: Traffic { bytes, node_sum_bytes }, .. } = made;
        let note = format!("{size} ranks of {threads} threads; a rank sends at most {bytes} bytes per force");
        let facts = RankFacts {
            count: size,
            bytes_per_force: bytes,
            bytes_per_force_of_node_sums: node_sum_bytes,
            in_parts: simulation.is_of_parts(),
        };
        Ok((simulation.with_ranks(facts), Some(note)))
    }

    /// Builds the simulation of a scene by all ranks, in parts if it can.
    fn build_by_all(
        &self,
        (scene, name): (Scene, &str),
        threads: u64,
        in_parts: bool,
    ) -> Result<Built, RunError> {
        let simulation = Simulation::shared(scene, in_parts, &self.exchange).map_err(RunError::Scene)?;
        let origin = Origin::new(simulation.scene(), name)?;
        let in_parts = u64::from(simulation.is_of_parts());
        let order = Order { program: program(), threads, in_parts, origin };
        self.exchange.pieces(&record::seal(START, FORMAT, &order));
        let Traffic { bytes, node_sum_bytes } = simulation.traffic();
        let own = Answer { problem: String::new(), is_incomplete: 0, bytes, node_sum_bytes };
        let answers = self.exchange.pieces(&record::seal(START, FORMAT, &own));
        let mut most = Traffic::default();
        let mut is_complete = true;
        for (rank, bytes) in answers.iter().enumerate() {
            let Answer { problem, is_incomplete, bytes, node_sum_bytes } =
                record::unseal(START, FORMAT, bytes)?;
            if !problem.is_empty() {
                return Err(RunError::Scene(vec![Problem::new("", format!("rank {rank}: {problem}"))]));
            }
            is_complete &= is_incomplete == 0;
            if bytes > most.bytes {
                most = Traffic { bytes, node_sum_bytes };
            }
        }
        Ok(Built { simulation, most, is_complete })
    }

    /// Obeys the first rank until it ends the program; returns the exit code. For all ranks but the first.
    pub fn obey(&self) -> u8 {
        let mut members: Vec<Option<Member>> = Vec::new();
        let mut pool = None;
        loop {
            let pieces = self.exchange.pieces(&[]);
            let bytes = pieces.first().map_or(&[][..], Vec::as_slice);
            if let Some(rest) = bytes.strip_prefix(END) {
                return rest.first().copied().unwrap_or(0);
            }
            if bytes.starts_with(START) {
                members.clear();
                let prepared = self.prepare(bytes).map(|(found, in_parts, threads)| {
                    members = found;
                    (u64::from(in_parts && !are_complete(&members)), threads)
                });
                let (problem, (is_incomplete, threads)) = match prepared {
                    Ok(prepared) => (String::new(), prepared),
                    Err(problem) => (problem, (0, 1)),
                };
                // Without threads of its own, a rank uses those of the process.
                pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().ok();
                let mut sent = Traffic::default();
                members.iter_mut().flatten().for_each(|member| sent += member.traffic());
                let Traffic { bytes, node_sum_bytes } = sent;
                let answer = Answer { problem, is_incomplete, bytes, node_sum_bytes };
                self.exchange.pieces(&record::seal(START, FORMAT, &answer));
                continue;
            }
            let mut obey = || Member::obey(&mut members, bytes);
            let is_known = match &pool {
                Some(pool) => pool.install(obey),
                None => obey(),
            };
            assert!(is_known, "the first rank sent {} bytes that are no command", bytes.len());
        }
    }

    /// Ends the program on all other ranks, with this exit code. For the first rank.
    pub fn dismiss(&self, code: u8) {
        self.exchange.pieces(&[&END[..], &[code]].concat());
    }

    /// Builds the portions that this rank steps. Also returns whether meshes are read in parts, and the number of
    /// threads.
    fn prepare(&self, order: &[u8]) -> Result<(Vec<Option<Member>>, bool, usize), String> {
        let order: Order = record::unseal(START, FORMAT, order).map_err(|error| error.to_string())?;
        let own = program();
        if own != order.program {
            return Err(format!(
                "its program has the checksum {own:08x}, that of the first rank {:08x}: start the same program on all \
                 ranks",
                order.program
            ));
        }
        let scene = parse(&order.origin)?;
        let here = Origin::new(&scene, &order.origin.name).map_err(|error| error.to_string())?;
        for ((mesh, there), (_, here)) in order.origin.meshes.iter().zip(&here.meshes) {
            if there != here {
                return Err(format!(
                    "{} has the checksum {here:08x} here and {there:08x} on the first rank: give all ranks the same file",
                    mesh.display()
                ));
            }
        }
        let in_parts = order.in_parts == 1;
        let members = members(&scene, in_parts, &self.exchange)
            .map_err(|problems| problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))?;
        Ok((members, in_parts, order.threads as usize))
    }
}

/// Returns the scene of an order.
fn parse(origin: &Origin) -> Result<Scene, String> {
    #[cfg(feature = "cli")]
    {
        let parsed = origin.parse();
        let problem = parsed.problems.first().map(ToString::to_string);
        parsed.scene.filter(|_| problem.is_none()).ok_or_else(|| problem.unwrap_or_default())
    }
    #[cfg(not(feature = "cli"))]
    Err(format!("the scene '{}' is a text, which needs the feature `cli`", origin.name))
}

/// Returns the CRC-32 of this program; 0 if it cannot be read.
fn program() -> u64 {
    let checksum = || -> std::io::Result<u32> {
        let mut file = File::open(std::env::current_exe()?)?;
        // The file may be larger than a rank's share of the mesh.
        let (mut hasher, mut piece) = (crc32fast::Hasher::new(), vec![0; 1 << 16]);
        loop {
            match file.read(&mut piece)? {
                0 => return Ok(hasher.finalize()),
                length => hasher.update(&piece[..length]),
            }
        }
    };
    checksum().map_or(0, u64::from)
}
