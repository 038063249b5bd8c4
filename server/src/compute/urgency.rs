//! How urgent and how large a piece of work is, and the priority of the threads for it.

/// Increment of the nice value of the threads for questions (Linux only). Chosen: at 5 a thread
/// gets a quarter of a core that a thread for readings needs too.
pub(super) const QUESTION_NICE: i32 = 5;
/// The same for long work, and for work of any urgency that has used up its slice. Chosen: at 10 it
/// gets a tenth, so long work still ends on a busy server.
pub(super) const LONG_NICE: i32 = 10;

/// How urgently a piece of work is waited for, the most urgent first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Urgency {
    /// A robot waits for the belief after a reading.
    Reading,
    /// A robot waits for the answer to a question that takes longer.
    Question,
    /// It yields to all other work.
    Long,
}

impl Urgency {
    /// The most urgent first.
    pub(super) const ALL: [Self; 3] = [Self::Reading, Self::Question, Self::Long];

    /// Increment of the nice value of its threads.
    pub(super) fn nice(self) -> i32 {
        match self {
            Self::Reading => 0,
            Self::Question => QUESTION_NICE,
            Self::Long => LONG_NICE,
        }
    }

    /// The name of its threads.
    pub(super) fn threads(self) -> &'static str {
        match self {
            Self::Reading => "compute",
            Self::Question => "compute-question",
            Self::Long => "compute-long",
        }
    }
}

/// How much work a piece is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Size {
    /// Less than a millisecond.
    Small,
    /// More, or unknown.
    Large,
    /// It takes memory in proportion to a body that may be large. No more such pieces are at work
    /// than threads compute.
    Heavy,
}

/// A thread whose priority can be set.
#[derive(Clone, Copy, Debug)]
pub(super) struct Thread(#[cfg(target_os = "linux")] rustix::process::Pid);

impl Thread {
    /// This thread.
    #[cfg(target_os = "linux")]
    pub(super) fn current() -> Self {
        Self(rustix::thread::gettid())
    }

    /// This thread.
    #[cfg(not(target_os = "linux"))]
    pub(super) fn current() -> Self {
        Self()
    }

    /// Sets the priority: the nice value of the process, plus `more`.
    pub(super) fn give_way(self, more: i32) {
        // On other systems a priority is that of the whole process.
        #[cfg(target_os = "linux")]
        {
            use rustix::process::{getpid, getpriority_process, setpriority_process};
            // The main thread keeps the priority of the process.
            let nicer = getpriority_process(Some(getpid())).map(|nice| (nice + more).min(19));
            if let Err(error) = nicer.and_then(|nicer| setpriority_process(Some(self.0), nicer)) {
                tracing::warn!(%error, "Less urgent work cannot give way: {error}");
            }
        }
        #[cfg(not(target_os = "linux"))]
        let _ = more;
    }
}
