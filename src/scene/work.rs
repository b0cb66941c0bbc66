//! Work counted instead of timed: tests ask how much of it there was, and nothing else counts.

#[cfg(test)]
thread_local!(static DONE: std::cell::Cell<usize> = const { std::cell::Cell::new(0) });

/// Adds to the work of this thread.
#[inline]
pub(crate) fn add(_amount: impl FnOnce() -> usize) {
    #[cfg(test)]
    DONE.set(DONE.get() + _amount());
}

/// Work of one thread that does all of `run`.
#[cfg(test)]
pub(crate) fn of<T: Send>(run: impl FnOnce() -> T + Send) -> (T, usize) {
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread can be started");
    alone.install(|| {
        let found = run();
        (found, DONE.get())
    })
}
