//! Files of JSON that a command reads.

use std::path::PathBuf;

use anyhow::Context as _;

/// Reads a JSON file; `-` reads standard input.
pub(crate) fn read_json<T: serde::de::DeserializeOwned>(path: PathBuf) -> anyhow::Result<T> {
    let text = if path.as_os_str() == "-" {
        std::io::read_to_string(std::io::stdin())?
    } else {
        std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?
    };
    serde_json::from_str(&text)
        .with_context(|| format!("{} has unexpected content", path.display()))
}
