//! The exchange between ranks by MPI. If a rank is lost, MPI ends the others.

use mpi::Count;
use mpi::collective::SystemOperation;
use mpi::datatype::PartitionMut;
use mpi::request::scope;
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
            let mut requests = Vec::with_capacity(messages.len());
            for Message { rank, send, receive } in messages {
                let other = world.process_at_rank(*rank as i32);
                // Ranks without data for each other send nothing.
                let receives =
                    (!receive.is_empty()).then(|| other.immediate_receive_into(scope, &mut receive[..]));
                let sends = (!send.is_empty()).then(|| other.immediate_send(scope, &send[..]));
                requests.push((receives, sends));
            }
            meanwhile();
            for (receives, sends) in requests {
                if let Some(request) = receives {
                    request.wait();
                }
                if let Some(request) = sends {
                    request.wait();
                }
            }
        });
    }

    fn pieces(&self, own: &[u8]) -> Vec<Vec<u8>> {
        let world = SimpleCommunicator::world();
        let mut lengths: Vec<Count> = vec![0; self.size];
        world.all_gather_into(&(own.len() as Count), &mut lengths[..]);
        let starts: Vec<Count> = lengths
            .iter()
            .scan(0, |end, length| {
                let start = *end;
                *end += length;
                Some(start)
            })
            .collect();
        let mut all = vec![0_u8; lengths.iter().map(|&length| length as usize).sum()];
        world.all_gather_varcount_into(own, &mut PartitionMut::new(&mut all[..], &lengths[..], &starts[..]));
        let piece =
            |(&start, &length): (&Count, &Count)| all[start as usize..(start + length) as usize].to_vec();
        starts.iter().zip(&lengths).map(piece).collect()
    }

    fn any(&self, flag: bool) -> bool {
        let mut any = 0_u8;
        SimpleCommunicator::world().all_reduce_into(&u8::from(flag), &mut any, SystemOperation::max());
        any > 0
    }
}
