//! Whether work should end early, as after Ctrl-C.
//!
//! Work that takes longer than some milliseconds reads `interrupted` between its pieces. Its caller decides by
//! `watched` what that returns; without, it is false.

use std::cell::RefCell;
use std::rc::Rc;

type Poll = Rc<dyn Fn() -> bool>;

thread_local! {
    static POLL: RefCell<Option<Poll>> = const { RefCell::new(None) };
}

/// Calls `work`, within which `interrupted` on this thread is what `poll` returns.
///
/// Once `poll` has returned true it must go on to do so: what `work` returns is then incomplete.
pub fn watched<R>(poll: impl Fn() -> bool + 'static, work: impl FnOnce() -> R) -> R {
    let _back = Back(POLL.replace(Some(Rc::new(poll))));
    work()
}

/// Puts the watch of the caller back, also after a panic.
struct Back(Option<Poll>);

impl Drop for Back {
    fn drop(&mut self) {
        POLL.set(self.0.take());
    }
}

/// Whether this thread's work is watched.
pub(crate) fn is_watched() -> bool {
    POLL.with_borrow(Option::is_some)
}

/// Whether this thread's work should end early. Takes some tens of nanoseconds.
pub fn interrupted() -> bool {
    // Not borrowed while it is called: a handler of signals may start other work that is watched.
    let poll = POLL.with_borrow(Clone::clone);
    poll.is_some_and(|poll| poll())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_innermost_watch_counts_and_ends_with_its_work() {
        assert!(!interrupted() && !is_watched());
        watched(
            || true,
            || {
                assert!(interrupted() && is_watched());
                assert!(!watched(|| false, interrupted));
                assert!(interrupted());
            },
        );
        assert!(!interrupted());
        let panicked = std::panic::catch_unwind(|| watched(|| true, || panic!("on purpose")));
        assert!(panicked.is_err() && !is_watched());
    }
}
