//! Long work without Python's lock, which ends soon after Ctrl-C.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use palpate_core::stop::Stop;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

/// Time between two looks at Python's signals. Chosen: a person does not notice it.
const LOOK: Duration = Duration::from_millis(50);

/// Runs work on another thread, without Python's lock. A signal sets `stop`, which
/// the work checks; the signal's error is then returned.
///
/// # Errors
/// The error that a signal handler raises, such as `KeyboardInterrupt`.
pub(crate) fn run<T: Send>(
    py: Python<'_>,
    stop: &Stop,
    work: impl FnOnce() -> T + Send,
) -> PyResult<T> {
    watched(py, stop, &mut || Ok(()), work)
}

/// Like [`run`]; `watch` is called now and then meanwhile, with Python's lock. Its error stops the
/// work.
///
/// # Errors
/// As [`run`], and the error of `watch`.
pub(crate) fn watched<T: Send>(
    py: Python<'_>,
    stop: &Stop,
    watch: &mut dyn FnMut() -> PyResult<()>,
    work: impl FnOnce() -> T + Send,
) -> PyResult<T> {
    let done = AtomicBool::new(false);
    let waiting = thread::current();
    let (ended, signalled) = thread::scope(|scope| {
        let worker = scope.spawn(|| {
            let ended = Stop::heeding(work);
            done.store(true, Ordering::Release);
            waiting.unpark();
            ended
        });
        let mut signalled = Ok(());
        while signalled.is_ok() && !done.load(Ordering::Acquire) && !worker.is_finished() {
            py.detach(|| thread::park_timeout(LOOK));
            signalled = py.check_signals().and_then(|()| watch());
        }
        if signalled.is_err() {
            stop.ask();
        }
        (py.detach(|| worker.join()), signalled)
    });
    signalled?;
    match ended {
        Ok(Ok(result)) => Ok(result),
        Ok(Err(_)) => Err(PyKeyboardInterrupt::new_err("the work was stopped")),
        Err(panic) => resume_unwind(panic),
    }
}
