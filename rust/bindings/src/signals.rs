//! Calls that take long and end early: by signals, such as Ctrl-C, or by flags that other threads set.
//!
//! Python runs handlers of signals on the main thread only, and only between two of its own instructions. So work on
//! that thread takes the GIL now and then to let handlers run; where one raises, the work ends.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use threads::watched;

use crate::cancel::{cancelled, is_cancelled, may_be_cancelled};

/// Time from one look for signals to the next.
const EVERY: Duration = Duration::from_millis(10);
/// Most time between two looks, where other threads keep the GIL for long.
const AT_MOST: Duration = Duration::from_millis(40);

/// Time in which a reading of the clock, which takes as long as some of a substep's work, is spread over several polls.
const READ_EVERY: Duration = Duration::from_micros(500);
/// Most polls in a row that do not read the clock.
const MOST_SKIPS: u128 = 15;

thread_local! {
    /// Whether this thread runs handlers of signals within a call.
    static IN_HANDLER: Cell<bool> = const { Cell::new(false) };
    /// When this thread looks for signals next, in whichever call it then is.
    static NEXT: Cell<Instant> = Cell::new(Instant::now() + EVERY);
}

/// Function that Python runs after each look for signals.
static HOOK: PyOnceLock<Py<PyAny>> = PyOnceLock::new();

/// Calls `hook` after each look for signals; an exception of it ends the call.
#[pyfunction]
pub fn after_signals(py: Python<'_>, hook: Py<PyAny>) {
    HOOK.get_or_init(py, || hook);
}

pub fn in_handler() -> bool {
    IN_HANDLER.get()
}

/// Looks for signals, at times.
struct Signals {
    /// When the clock was read last, how many polls leave it alone until it is read again, and how many did so far.
    read: Cell<Instant>,
    skipped: Cell<u32>,
    skips: Cell<u32>,
    raised: Rc<RefCell<Option<PyErr>>>,
}

impl Signals {
    /// Whether a handler has raised an exception.
    fn poll(&self) -> bool {
        if self.raised.borrow().is_some() {
            return true;
        }
        let skipped = self.skipped.get();
        if skipped < self.skips.get() {
            self.skipped.set(skipped + 1);
            return false;
        }
        let began = Instant::now();
        let each = (began - self.read.get()) / (skipped + 1);
        self.read.set(began);
        self.skipped.set(0);
        self.skips
            .set((READ_EVERY.as_nanos() / each.as_nanos().max(1)).min(MOST_SKIPS) as u32);
        if began < NEXT.get() || in_handler() {
            return false;
        }
        let outcome = Python::attach(|py| {
            IN_HANDLER.set(true);
            let run = || {
                py.check_signals()?;
                HOOK.get(py).map(|hook| hook.call0(py)).transpose()
            };
            let outcome = run();
            IN_HANDLER.set(false);
            outcome
        });
        // The GIL may be slow to get: looks then take at most a fifth of the time.
        let pause = EVERY.max((4 * began.elapsed()).min(AT_MOST));
        NEXT.set(Instant::now() + pause);
        *self.raised.borrow_mut() = outcome.err();
        self.raised.borrow().is_some()
    }
}

/// Does work with the GIL released, which ends early where a handler of a signal raises an exception, or where a flag
/// of this thread's blocks is set.
///
/// The exception of a handler is returned before any other; what the work returned is then incomplete.
pub fn interruptible<R: Send>(
    py: Python<'_>,
    work: impl FnOnce() -> PyResult<R> + Send,
) -> PyResult<R> {
    let hears_signals = is_main_thread(py)?;
    if !hears_signals && !may_be_cancelled() {
        return py.detach(work);
    }
    let (done, raised, ended) = py.detach(|| {
        let (raised, ended) = (Rc::new(RefCell::new(None)), Rc::new(Cell::new(false)));
        let signals = hears_signals.then(|| Signals {
            read: Cell::new(Instant::now()),
            skipped: Cell::new(0),
            skips: Cell::new(0),
            raised: Rc::clone(&raised),
        });
        let seen = Rc::clone(&ended);
        let poll = move || {
            seen.set(seen.get() || is_cancelled());
            seen.get() || signals.as_ref().is_some_and(Signals::poll)
        };
        let done = watched(poll, work);
        (done, raised.take(), ended.get())
    });
    match raised {
        Some(error) => Err(error),
        None if ended => done.and_then(|_| Err(cancelled())),
        None => done,
    }
}

fn is_main_thread(py: Python<'_>) -> PyResult<bool> {
    let threading = py.import("threading")?;
    let main = threading.call_method0("main_thread")?.getattr("ident")?;
    threading.call_method0("get_ident")?.eq(main)
}
