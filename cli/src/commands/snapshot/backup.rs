//! A folder of snapshots whose names are their times; the newest ones are kept.
//!
//! Other files in the folder are left alone.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use jiff::Timestamp;

const START: &str = "palpate-";
const END: &str = ".snapshot";
/// End of the name of a file that is being written.
const PART: &str = ".snapshot.part";
/// The time within a name: names sort by time.
const TIME: &str = "%Y%m%dT%H%M%SZ";

/// Name of a snapshot of now.
pub(super) fn name() -> String {
    format!("{START}{}{END}", Timestamp::now().strftime(TIME))
}

/// Removes all but the newest snapshots, and what interrupted backups left. `newest` was just
/// written. Returns the removed files.
pub(super) fn prune(folder: &Path, newest: &str, keep: usize) -> anyhow::Result<Vec<PathBuf>> {
    let context = || format!("cannot remove old snapshots in {}", folder.display());
    let (mut names, mut removed) = (Vec::new(), Vec::new());
    for entry in fs::read_dir(folder).with_context(context)? {
        let entry = entry.with_context(context)?;
        let name = entry.file_name();
        let Some(name) = name.to_str().filter(|name| *name != newest) else { continue };
        if is_named(name, PART) {
            removed.push(entry.path());
        } else {
            names.push(name.to_owned());
        }
    }
    removed.extend(surplus(names, newest, keep).into_iter().map(|name| folder.join(name)));
    for file in &removed {
        fs::remove_file(file).with_context(context)?;
    }
    Ok(removed)
}

/// The names of the snapshots that go when the newest `keep` stay. One with a later time than the
/// one just written was written while the clock was ahead, or the clock is behind now: until its
/// time has come it neither goes nor takes the place of another.
pub(super) fn surplus(names: Vec<String>, newest: &str, keep: usize) -> Vec<String> {
    let is_older = |name: &String| name.as_str() < newest && is_named(name, END);
    let mut older: Vec<String> = names.into_iter().filter(is_older).collect();
    older.sort();
    older.truncate((older.len() + 1).saturating_sub(keep));
    older
}

/// Whether a name is one that a backup gives.
fn is_named(name: &str, end: &str) -> bool {
    let time = name.strip_prefix(START).and_then(|rest| rest.strip_suffix(end));
    let form = |time: &str| {
        let digit_or = |(idx, byte): (usize, u8)| match idx {
            8 => byte == b'T',
            15 => byte == b'Z',
            _ => byte.is_ascii_digit(),
        };
        time.len() == 16 && time.bytes().enumerate().all(digit_or)
    };
    time.is_some_and(form)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_and_the_files_of_others_stay() {
        let folder = tempfile::TempDir::new().unwrap();
        let day = |day: u32| format!("palpate-202611{day:02}T023000Z.snapshot");
        let others =
            ["palpate-monday.snapshot", "notes.txt", "palpate-20261101T023000Z.snapshot.old"];
        let part = format!("{}.part", day(4));
        let mine = [day(1), day(2), day(3), day(5), part.clone()];
        for name in mine.iter().map(String::as_str).chain(others) {
            fs::write(folder.path().join(name), name).unwrap();
        }
        let removed = prune(folder.path(), &day(5), 3).unwrap();
        assert_eq!(removed, [part, day(1)].map(|name| folder.path().join(name)));
        let mut left: Vec<String> = fs::read_dir(folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        left.sort();
        let mut expected = vec![day(2), day(3), day(5)];
        expected.extend(others.map(str::to_owned));
        expected.sort();
        assert_eq!(left, expected);
    }

    #[test]
    fn a_clock_that_jumps_removes_no_snapshot_that_would_stay() {
        let day = |day: u32| format!("palpate-202611{day:02}T023000Z.snapshot");
        let names = |days: &[u32]| days.iter().map(|it| day(*it)).collect::<Vec<_>>();
        // One was written while the clock was ahead: the three before today's stay as well.
        assert_eq!(surplus(names(&[2, 3, 4, 28]), &day(4), 3), names(&[]));
        assert_eq!(surplus(names(&[1, 2, 3, 4, 28]), &day(4), 3), names(&[1]));
        // The clock is behind: nothing is known to be old.
        assert_eq!(surplus(names(&[1, 2, 3, 4]), &day(1), 1), names(&[]));
        // It is ahead now: as many stay as are to.
        assert_eq!(surplus(names(&[1, 2, 3, 28]), &day(28), 3), names(&[1]));
    }

    #[test]
    fn new_names_are_those_that_are_pruned() {
        assert!(is_named(&name(), END), "{}", name());
    }
}
