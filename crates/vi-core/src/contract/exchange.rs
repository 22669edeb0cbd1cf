//! Several processes (ranks) that compute one system together, and the messages that they exchange.

use std::ops::Range;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, Sender, channel};

use crate::contract::rank_solver::RankSolver;

/// Exchanges data between the ranks of one computation.
///
/// Every method is collective: all ranks call the same methods in the same order. A call returns after every rank
/// involved has made it. If a rank is lost, the implementation ends the other processes, so no method returns an error.
pub trait Exchange: Send + Sync {
    /// Returns the number of this rank, below [`Exchange::size`].
    fn rank(&self) -> usize;

    /// Returns the number of ranks.
    fn size(&self) -> usize;

    /// Sends the numbers of each message to its rank, and fills its `receive` with those that the rank sends here.
    /// Calls `meanwhile` once while the messages travel.
    ///
    /// There is at most one message per rank. The length of `receive` must be that of the `send` of the other rank.
    fn slots(&self, messages: &mut [Message], meanwhile: &mut dyn FnMut());

    /// Returns the bytes that each rank passes, in the order of the ranks.
    fn pieces(&self, own: &[u8]) -> Vec<Vec<u8>>;

    /// Returns whether any rank passes true.
    fn any(&self, flag: bool) -> bool;

    /// Returns a new solver of linear systems that works over the same ranks, for example that of PETSc; `None` if there is
    /// none.
    fn linear_solver(&self) -> Option<Box<dyn RankSolver>> {
        None
    }
}

/// Returns the runs of a term ([`crate::run_length`]) that each of `size` ranks computes, in the order of the ranks.
///
/// Two ranks have half each. The first of more ranks has a share of (9 − `size`)/(8 `size`), and at least one run; the others have equal
/// shares of the rest. The first rank also keeps the state of the whole system, about an eighth of the memory of all portions, so that
/// with up to eight ranks all need about the same memory (docs/scale.md). Of two ranks, the second would have an eighth more elements,
/// and both a longer border: a step would take 1.25 instead of 1.12 times as long as on two threads. Sums have the same bits for all
/// shares.
pub fn runs_of_ranks(run_count: usize, size: usize) -> Vec<Range<usize>> {
    let others = size.saturating_sub(1);
    let less = if size == 2 { 0 } else { others };
    // Rounded to the nearest number.
    let (parts, of) = (run_count * 8_usize.saturating_sub(less), 8 * size.max(1));
    let first = if others == 0 { run_count } else { ((2 * parts + of) / (2 * of)).max(run_count.min(1)) };
    let end = |rank: usize| if rank == 0 { first } else { first + (run_count - first) * rank / others };
    (0..size).map(|rank| if rank == 0 { 0..first } else { end(rank - 1)..end(rank) }).collect()
}

/// The traffic from a rank to the others per gradient.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Traffic {
    /// Number of bytes.
    pub bytes: u64,
    /// Number of bytes if the rank sent one sum per node to each rank that needs it. The bits of one process could not
    /// be reproduced from such sums.
    pub node_sum_bytes: u64,
}

impl std::ops::AddAssign for Traffic {
    fn add_assign(&mut self, other: Self) {
        self.bytes += other.bytes;
        self.node_sum_bytes += other.node_sum_bytes;
    }
}

/// Numbers that this rank and another one send to each other.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Message {
    /// The other rank.
    pub rank: usize,
    /// The numbers for the other rank.
    pub send: Vec<f64>,
    /// The numbers from the other rank.
    pub receive: Vec<f64>,
}

/// A computation by one process: there is nobody to exchange data with.
#[derive(Debug, Clone, Copy, Default)]
pub struct Alone;

impl Exchange for Alone {
    fn rank(&self) -> usize {
        0
    }

    fn size(&self) -> usize {
        1
    }

    fn slots(&self, _messages: &mut [Message], meanwhile: &mut dyn FnMut()) {
        meanwhile();
    }

    fn pieces(&self, own: &[u8]) -> Vec<Vec<u8>> {
        vec![own.to_vec()]
    }

    fn any(&self, flag: bool) -> bool {
        flag
    }
}

/// A rank that is a thread of this process, for tests of code for several ranks.
pub struct ThreadRank {
    rank: usize,
    /// The ends of the channels to and from each rank.
    to: Vec<Sender<Parcel>>,
    from: Vec<Mutex<Receiver<Parcel>>>,
}

/// What threads send to each other.
enum Parcel {
    Numbers(Vec<f64>),
    Bytes(Vec<u8>),
}

impl ThreadRank {
    /// Returns `size` ranks that exchange data with each other.
    pub fn crew(size: usize) -> Vec<Self> {
        let mut crew: Vec<Self> =
            (0..size).map(|rank| Self { rank, to: Vec::new(), from: Vec::new() }).collect();
        for sender in 0..size {
            for receiver in 0..size {
                let (to, from) = channel();
                crew[sender].to.push(to);
                crew[receiver].from.push(Mutex::new(from));
            }
        }
        crew
    }

    fn send(&self, rank: usize, parcel: Parcel) {
        // The receiver may have panicked: its own message is the one to read.
        let _ = self.to[rank].send(parcel);
    }

    fn receive(&self, rank: usize) -> Parcel {
        let from = self.from[rank].lock().expect("one thread per rank");
        from.recv().unwrap_or_else(|_| panic!("rank {rank} has ended"))
    }
}

impl Exchange for ThreadRank {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.to.len()
    }

    fn slots(&self, messages: &mut [Message], meanwhile: &mut dyn FnMut()) {
        for message in messages.iter() {
            self.send(message.rank, Parcel::Numbers(message.send.clone()));
        }
        meanwhile();
        for message in messages {
            match self.receive(message.rank) {
                Parcel::Numbers(numbers) => message.receive.copy_from_slice(&numbers),
                Parcel::Bytes(_) => panic!("rank {} sends other data", message.rank),
            }
        }
    }

    fn pieces(&self, own: &[u8]) -> Vec<Vec<u8>> {
        (0..self.size()).for_each(|rank| self.send(rank, Parcel::Bytes(own.to_vec())));
        let piece = |rank| match self.receive(rank) {
            Parcel::Bytes(bytes) => bytes,
            Parcel::Numbers(_) => panic!("rank {rank} sends other data"),
        };
        (0..self.size()).map(piece).collect()
    }

    fn any(&self, flag: bool) -> bool {
        self.pieces(&[u8::from(flag)]).iter().any(|piece| piece == &[1])
    }
}

#[cfg(test)]
mod tests {
    use super::runs_of_ranks;

    #[test]
    fn every_run_has_one_rank_and_the_first_of_many_has_fewer() {
        for (count, size) in
            [(0, 1), (0, 3), (1, 1), (1, 3), (7, 2), (8, 4), (1000, 2), (1000, 4), (1000, 40)]
        {
            let runs = runs_of_ranks(count, size);
            assert_eq!(runs.len(), size);
            let mut end = 0;
            for of_rank in &runs {
                assert_eq!(of_rank.start, end);
                end = of_rank.end;
            }
            assert_eq!(end, count);
            if count >= size {
                let lengths: Vec<usize> = runs.iter().map(ExactSizeIterator::len).collect();
                assert!(lengths.iter().all(|&length| length > 0 && length + 1 >= lengths[0]), "{lengths:?}");
                let others = &lengths[1..];
                assert!(others.iter().max() <= others.iter().min().map(|least| least + 1).as_ref());
            }
        }
        assert_eq!(runs_of_ranks(1000, 2), [0..500, 500..1000]);
        assert_eq!(runs_of_ranks(1000, 4)[0], 0..156);
    }
}
