//! The program `variational` on several processes (ranks) that exchange messages by MPI:
//! `mpiexec -n 4 variational-mpi run SCENE`. The first rank is the program itself, the others serve it.

mod exchange;
mod memory;
#[cfg(feature = "petsc")]
mod petsc;

use std::process::ExitCode;
use std::sync::Arc;

use mpi::Threading;
use mpi::environment::initialize_with_threading;
use mpi::topology::{Communicator, SimpleCommunicator};
use variational::cli;
use variational::core::Exchange;
use variational::run::Team;

use crate::exchange::Mpi;

/// Exit code of all ranks if one of them panics, as that of a Rust program that panics.
const PANICKED: i32 = 101;

fn main() -> ExitCode {
    memory::give_back_when_freed();
    // One thread at a time makes calls, not always the same one.
    let Some((universe, threading)) = initialize_with_threading(Threading::Serialized) else {
        eprintln!("error: MPI cannot be initialised");
        return ExitCode::from(5);
    };
    if threading < Threading::Serialized {
        eprintln!(
            "error: this MPI does not accept calls from several threads; build it with MPI_THREAD_SERIALIZED"
        );
        return ExitCode::from(5);
    }
    // A rank that is lost would be waited for: end all of them.
    let say = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        say(info);
        SimpleCommunicator::world().abort(PANICKED);
    }));
    let exchange = Mpi::new();
    let is_first = exchange.rank() == 0;
    let team = Team::new(Arc::new(exchange)).with_threads(threads());
    let code = if is_first {
        cli::execute_on_first_rank(&team, std::env::args_os())
    } else {
        cli::execute_on_other_rank(&team)
    };
    #[cfg(feature = "petsc")]
    petsc::finish();
    drop(universe);
    ExitCode::from(code)
}

/// Returns the number of threads of each rank: its share of the processors of its machine.
fn threads() -> usize {
    let here = SimpleCommunicator::world().split_shared(0).size() as usize;
    (std::thread::available_parallelism().map_or(1, usize::from) / here).max(1)
}
