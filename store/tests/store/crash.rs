//! Tests of a killed process: acknowledged writes are present and complete.
//!
//! The test starts its own binary again as the process to kill.

use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Stdio};
use std::time::Duration;

use palpate_store::engine::{Commit, Engine};
use palpate_store::sled::{SledEngine, SledOptions};
use tempfile::TempDir;

/// Folder for the child to write to; without it, the child's test does nothing.
const FOLDER: &str = "PALPATE_CRASH_TEST_FOLDER";
/// Round of the child.
const ROUND: &str = "PALPATE_CRASH_TEST_ROUND";
const ROUNDS: u32 = 5;
const WRITERS: u32 = 4;

fn pair(round: u32, writer: u32, number: u32) -> [Vec<u8>; 2] {
    ["left", "right"].map(|side| format!("{side}/{round}/{writer}/{number}").into_bytes())
}

#[test]
fn acknowledged_writes_survive_a_kill() {
    let folder = TempDir::new().unwrap();
    let mut acknowledged: Vec<(u32, u32, u32)> = Vec::new();
    for round in 0..ROUNDS {
        let before = acknowledged.len();
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "crash::child_process_to_kill", "--nocapture"])
            .env(FOLDER, folder.path())
            .env(ROUND, round.to_string())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let mut note = |line: String| {
            let mut words = line.split_whitespace();
            if words.next() == Some("acknowledged") {
                let numbers: Vec<u32> = words.filter_map(|word| word.parse().ok()).collect();
                acknowledged.push((round, numbers[0], numbers[1]));
            }
        };
        // The first line means that the child has opened the database and writes.
        while let Some(line) = lines.next().transpose().unwrap() {
            let begun = line.starts_with("acknowledged");
            note(line);
            if begun {
                break;
            }
        }
        std::thread::sleep(Duration::from_millis(150));
        child.kill().unwrap();
        child.wait().unwrap();
        // A line truncated by the kill has no newline and is not counted.
        lines.map_while(Result::ok).filter(|line| line.ends_with('.')).for_each(&mut note);
        assert!(acknowledged.len() > before + 10, "round {round}: too few writes");

        let engine = SledEngine::open(folder.path(), &SledOptions::default()).unwrap();
        for (round, writer, number) in &acknowledged {
            for key in pair(*round, *writer, *number) {
                let value = engine.get(&key).unwrap();
                assert_eq!(value.as_deref(), Some(&key[..]), "{}", String::from_utf8_lossy(&key));
            }
        }
        // Commits are atomic: every left has its right.
        let n_left = engine.scan(b"left/", None, usize::MAX).unwrap().len();
        let n_right = engine.scan(b"right/", None, usize::MAX).unwrap().len();
        assert_eq!(n_left, n_right);
    }
}

#[test]
fn child_process_to_kill() {
    let Some(folder) = std::env::var_os(FOLDER) else { return };
    let round: u32 = std::env::var(ROUND).unwrap().parse().unwrap();
    let engine = SledEngine::open(folder.as_ref(), &SledOptions::default()).unwrap();
    std::thread::scope(|scope| {
        for writer in 0..WRITERS {
            let engine = &engine;
            scope.spawn(move || {
                for number in 0.. {
                    let commit = pair(round, writer, number)
                        .into_iter()
                        .fold(Commit::new(), |commit, key| commit.put(key.clone(), key));
                    engine.commit(commit).wait().unwrap();
                    let line = format!("acknowledged {writer} {number} .\n");
                    std::io::stdout().write_all(line.as_bytes()).unwrap();
                }
            });
        }
    });
}
