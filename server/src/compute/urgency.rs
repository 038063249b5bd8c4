//! How urgent and how large a piece of work is, and the priority of the threads for it.

/// Increment of the nice value of the threads for questions (Linux only). Chosen: at 5 a thread
/// gets a quarter of a core that a thread for readings needs too.
pub(super) const QUESTION_NICE: i32 = 5;
/// The same for long work. Chosen: at 10 it gets a tenth, so long work still ends on a busy server.
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

/// How much work a piece is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Size {
    /// Less than a millisecond.
    Small,
    /// More, or unknown.
    Large,
}

/// Sets the priority of this thread.
pub(super) fn give_way(urgency: Urgency) {
    // On other systems a priority is that of the whole process.
    #[cfg(target_os = "linux")]
    {
        use rustix::process::{getpriority_process, setpriority_process};
        let more = match urgency {
            Urgency::Reading => return,
            Urgency::Question => QUESTION_NICE,
            Urgency::Long => LONG_NICE,
        };
        let nicer = getpriority_process(None).map(|nice| (nice + more).min(19));
        if let Err(error) = nicer.and_then(|nicer| setpriority_process(None, nicer)) {
            tracing::warn!(%error, "Less urgent work cannot give way: {error}");
        }
    }
    #[cfg(not(target_os = "linux"))]
    let _ = (urgency, QUESTION_NICE, LONG_NICE);
}
