//! The threads of one simulation or run.

use std::sync::Mutex;
use std::thread::{Builder, JoinHandle};

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::callables::lock;
use crate::errors;

/// A pool of threads that have ended, and freed their scratch memory, when it is dropped. The pool of rayon alone does
/// not wait for them: they would still hold 4 MB each while the next simulation is made.
pub(crate) struct Threads {
    /// `None` only while it is dropped.
    pool: Option<ThreadPool>,
    handles: Vec<JoinHandle<()>>,
}

impl Threads {
    /// Starts `count` threads; `None` for one per core.
    pub(crate) fn new(count: Option<usize>) -> PyResult<Self> {
        if count == Some(0) {
            return Err(errors::value("threads must be at least 1"));
        }
        let handles = Mutex::new(Vec::new());
        let pool = ThreadPoolBuilder::new().num_threads(count.unwrap_or(0)).spawn_handler(|thread| {
            lock(&handles).push(Builder::new().spawn(move || thread.run())?);
            Ok(())
        });
        let pool = Some(pool.build().map_err(errors::value)?);
        Ok(Self { pool, handles: std::mem::take(&mut *lock(&handles)) })
    }

    /// Runs `job` on one of the threads, with the others as its helpers.
    pub(crate) fn install<T: Send>(&self, job: impl FnOnce() -> T + Send) -> T {
        match &self.pool {
            Some(pool) => pool.install(job),
            None => job(),
        }
    }
}

impl Drop for Threads {
    fn drop(&mut self) {
        self.pool = None;
        for handle in self.handles.drain(..) {
            // A thread returns nothing, and rayon has passed on the panics of its jobs.
            let _ = handle.join();
        }
    }
}
