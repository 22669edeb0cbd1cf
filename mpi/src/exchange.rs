//! The exchange between ranks by MPI. If a rank is lost, MPI ends the others.

use std::time::{Duration, Instant};

use mpi::Count;
use mpi::collective::SystemOperation;
use mpi::datatype::PartitionMut;
use mpi::request::{Request, Scope, scope};
use mpi::topology::{Communicator, SimpleCommunicator};
use mpi::traits::{CommunicatorCollectives, Destination, Source};
use variational::core::{Exchange, Message};

/// All processes that MPI started together.
pub(crate) struct Mpi {
    rank: usize,
    size: usize,
}

impl Mpi {
    /// Returns the exchange of this process; MPI must be initialised.
    pub(crate) fn new() -> Self {
        let world = SimpleCommunicator::world();
        Self { rank: world.rank() as usize, size: world.size() as usize }
    }
}

impl Exchange for Mpi {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.size
    }

    fn slots(&self, messages: &mut [Message], meanwhile: &mut dyn FnMut()) {
        let world = SimpleCommunicator::world();
        scope(|scope| {
            let mut requests = Vec::with_capacity(2 * messages.len());
            for Message { rank, send, receive } in messages {
                let other = world.process_at_rank(*rank as i32);
                // Ranks without data for each other send nothing.
                if !receive.is_empty() {
                    requests.push(other.immediate_receive_into(scope, &mut receive[..]));
                }
                if !send.is_empty() {
                    requests.push(other.immediate_send(scope, &send[..]));
                }
            }
            meanwhile();
            wait(requests);
        });
    }

    fn pieces(&self, own: &[u8]) -> Vec<Vec<u8>> {
        let world = SimpleCommunicator::world();
        let (length, mut lengths) = (own.len() as Count, vec![0 as Count; self.size]);
        scope(|scope| wait(vec![world.immediate_all_gather_into(scope, &length, &mut lengths[..])]));
        let starts: Vec<Count> = lengths
            .iter()
            .scan(0, |end, length| {
                let start = *end;
                *end += length;
                Some(start)
            })
            .collect();
        let mut all = vec![0_u8; lengths.iter().map(|&length| length as usize).sum()];
        let mut parts = PartitionMut::new(&mut all[..], &lengths[..], &starts[..]);
        scope(|scope| wait(vec![world.immediate_all_gather_varcount_into(scope, own, &mut parts)]));
        let piece =
            |(&start, &length): (&Count, &Count)| all[start as usize..(start + length) as usize].to_vec();
        starts.iter().zip(&lengths).map(piece).collect()
    }

    fn any(&self, flag: bool) -> bool {
        let world = SimpleCommunicator::world();
        let (own, mut any) = (u8::from(flag), 0_u8);
        let or = SystemOperation::max();
        scope(|scope| wait(vec![world.immediate_all_reduce_into(scope, &own, &mut any, or)]));
        any > 0
    }

    #[cfg(feature = "petsc")]
    fn linear_solver(&self) -> Option<Box<dyn variational::core::RankSolver>> {
        Some(Box::new(crate::petsc::Petsc::default()))
    }
}

/// Waits for requests. MPI keeps a core busy while it waits. This function yields the core after a while, so that it
/// does not slow down a rank that writes files, or a machine with more ranks than cores.
fn wait<'a, D: ?Sized, S: Scope<'a>>(mut requests: Vec<Request<'a, D, S>>) {
    /// Time after which other processes may run, and after which this one sleeps between tries.
    const PATIENCE: [Duration; 2] = [Duration::from_micros(50), Duration::from_millis(5)];
    let begin = Instant::now();
    loop {
        requests = requests.into_iter().filter_map(|request| request.test().err()).collect();
        if requests.is_empty() {
            return;
        }
        let waited = begin.elapsed();
        if waited > PATIENCE[1] {
            std::thread::sleep(Duration::from_micros(100));
        } else if waited > PATIENCE[0] {
            std::thread::yield_now();
        }
    }
}
