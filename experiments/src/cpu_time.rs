//! Processor time, which excludes other programs. Linux only: `None` elsewhere.

/// Clock ticks per second in `/proc`, which the kernel fixes for all programs.
const TICKS_PER_SECOND: f64 = 100.0;

/// Processor time of this thread, seconds.
pub(crate) fn thread_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: f64 = text.split_whitespace().next()?.parse().ok()?;
    Some(nanoseconds * 1e-9)
}

/// Processor time of all threads of this process, including ended ones, seconds. In steps of 10 ms.
pub(crate) fn process_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The name in parentheses may contain spaces; user and system time are fields 14 and 15.
    let rest = text.rsplit_once(')')?.1;
    let ticks = rest.split_whitespace().skip(11).take(2).map(str::parse::<f64>);
    Some(ticks.sum::<Result<f64, _>>().ok()? / TICKS_PER_SECOND)
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use std::time::{Duration, Instant};

    use super::*;

    #[test]
    fn the_time_of_a_process_includes_ended_threads() {
        let (process, here) = (process_seconds().unwrap(), thread_seconds().unwrap());
        let work = || {
            let begun = thread_seconds().unwrap();
            let patience = Instant::now();
            while thread_seconds().unwrap() - begun < 0.1 {
                assert!(patience.elapsed() < Duration::from_secs(60), "the thread's time stands");
            }
        };
        std::thread::spawn(work).join().unwrap();
        assert!(process_seconds().unwrap() - process > 0.08);
        assert!(thread_seconds().unwrap() - here < 0.1);
    }
}
