//! Process figures from Linux, shared by the black-box tests in `whole/` and `torture`.

use std::fs;
use std::io;

/// Processor time of a process, seconds: fields 14 and 15 of its `stat`, in hundredths.
///
/// # Errors
/// The process is gone, or there is no `/proc`.
pub fn processor_seconds(process: u32) -> io::Result<f64> {
    let stat = fs::read_to_string(format!("/proc/{process}/stat"))?;
    let fields = stat.rsplit_once(')').map_or("", |(_, rest)| rest);
    let ticks = fields.split_whitespace().skip(11).take(2).filter_map(|n| n.parse::<f64>().ok());
    Ok(ticks.sum::<f64>() / 100.0)
}

/// A memory figure of a process, KiB: `VmSize` (virtual) or `VmHWM` (peak resident).
///
/// # Errors
/// The process is gone, or there is no `/proc`, or no such figure.
pub fn memory_kib(process: u32, figure: &str) -> io::Result<u64> {
    let status = fs::read_to_string(format!("/proc/{process}/status"))?;
    let line = status.lines().find_map(|line| line.strip_prefix(figure)?.strip_prefix(':'));
    let kib = line.and_then(|line| line.split_whitespace().next()?.parse().ok());
    kib.ok_or_else(|| io::Error::other(format!("no {figure}")))
}
