//! One buffer per thread that is kept from call to call, so that inner loops allocate nothing.

use std::cell::RefCell;

thread_local! {
    static SCRATCH: RefCell<Vec<f64>> = const { RefCell::new(Vec::new()) };
}

/// Calls `body` with a buffer of `length` numbers, which the thread keeps from call to call.
pub(crate) fn with_scratch<R>(length: usize, body: impl FnOnce(&mut [f64]) -> R) -> R {
    let mut buffer = SCRATCH.take();
    if buffer.len() < length {
        buffer.resize(length, 0.0);
    }
    let result = body(&mut buffer[..length]);
    SCRATCH.set(buffer);
    result
}
