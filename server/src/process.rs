//! Figures of this process for Prometheus, as Linux gives them in `/proc`: memory, processor
//! time, threads, open files, and the limit on its memory. Other systems have no `/proc`, and no figures.

use std::fs;
use std::path::Path;

/// Ticks of `/proc` in a second: the same on every Linux.
const TICKS: f64 = 100.0;

/// Sets the gauges `process_…`; a figure that cannot be read keeps its last value.
pub(crate) fn measure() {
    for (name, value) in figures() {
        metrics::gauge!(name).set(value);
    }
    let read = |file| fs::read_to_string(file).unwrap_or_default();
    let limit = memory_limit(Path::new("/sys/fs/cgroup"), &read("/proc/self/cgroup"));
    let machine = number(&read("/proc/meminfo"), "MemTotal:").map(|kib| 1024 * kib as u64);
    if let Some(bytes) = limit.into_iter().chain(machine).min() {
        metrics::gauge!("palpate_memory_limit_bytes").set(bytes as f64);
    }
}

/// The bytes of memory beyond which the kernel throttles or kills the process: the least limit of
/// its control group and of those around it. `None` without a limit, or without control groups of
/// version 2; then the machine's memory is the limit.
fn memory_limit(root: &Path, groups: &str) -> Option<u64> {
    let own = groups.lines().find_map(|line| line.strip_prefix("0::/"))?;
    let own = root.join(own);
    let around = own.ancestors().take_while(|folder| folder.starts_with(root));
    let files =
        around.flat_map(|folder| ["memory.max", "memory.high"].map(|name| folder.join(name)));
    // Without a limit the file holds `max`.
    files.filter_map(|file| fs::read_to_string(file).ok()?.trim().parse().ok()).min()
}

/// The readable figures, by the names that Prometheus clients share.
fn figures() -> Vec<(&'static str, f64)> {
    let read = |file: &str| fs::read_to_string(format!("/proc/{file}")).unwrap_or_default();
    let (status, limits, stat) = (read("self/status"), read("self/limits"), read("self/stat"));
    let bytes = |name| Some(1024.0 * number(&status, name)?);
    // The program's name comes first, in brackets, and may hold anything.
    let after_name = stat.rsplit_once(") ").map_or("", |(_, rest)| rest);
    let ticks = |place| after_name.split(' ').nth(place)?.parse::<f64>().ok();
    let begun = || Some(number(&read("stat"), "btime")? + ticks(19)? / TICKS);
    let open_files = || Some(fs::read_dir("/proc/self/fd").ok()?.count() as f64);
    let figures = [
        ("process_cpu_seconds_total", ticks(11).zip(ticks(12)).map(|(a, b)| (a + b) / TICKS)),
        ("process_open_fds", open_files()),
        ("process_max_fds", number(&limits, "Max open files")),
        ("process_virtual_memory_bytes", bytes("VmSize:")),
        ("process_virtual_memory_max_bytes", number(&limits, "Max address space")),
        ("process_resident_memory_bytes", bytes("VmRSS:")),
        ("process_start_time_seconds", begun()),
        ("process_threads", number(&status, "Threads:")),
    ];
    figures.into_iter().filter_map(|(name, value)| Some((name, value?))).collect()
}

/// The first number of the line that begins so.
fn number(text: &str, start: &str) -> Option<f64> {
    let rest = text.lines().find_map(|line| line.strip_prefix(start))?;
    rest.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
#[cfg(target_os = "linux")]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    #[test]
    fn the_least_limit_of_the_control_groups_counts() {
        let root = tempfile::TempDir::new().unwrap();
        let own = root.path().join("system.slice/palpate.service");
        fs::create_dir_all(&own).unwrap();
        let groups = "1:name=systemd:/elsewhere\n0::/system.slice/palpate.service\n";
        let limit = || memory_limit(root.path(), groups);
        assert_eq!(limit(), None);
        fs::write(own.join("memory.max"), "max\n").unwrap();
        assert_eq!(limit(), None);
        fs::write(own.join("memory.max"), "6000\n").unwrap();
        fs::write(own.join("memory.high"), "5000\n").unwrap();
        assert_eq!(limit(), Some(5000));
        fs::write(root.path().join("system.slice/memory.max"), "4000\n").unwrap();
        assert_eq!(limit(), Some(4000));
        assert_eq!(memory_limit(root.path(), "0::/\n"), None);
    }

    #[test]
    fn linux_gives_every_figure() {
        let found: BTreeMap<&str, f64> = figures().into_iter().collect();
        // Most processes have no bound on their address space.
        assert!(found.len() >= 7, "{found:?}");
        let (resident, all) =
            (found["process_resident_memory_bytes"], found["process_virtual_memory_bytes"]);
        assert!(1e6 < resident && resident < all, "{found:?}");
        assert!(found["process_open_fds"] >= 3.0 && found["process_threads"] >= 2.0, "{found:?}");
        let now = std::time::UNIX_EPOCH.elapsed().unwrap().as_secs_f64();
        let age = now - found["process_start_time_seconds"];
        assert!((-2.0..86_400.0).contains(&age), "{age} s old");
    }
}
