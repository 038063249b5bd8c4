//! `palpate openapi`: the committed description of the HTTP API.

use palpate_client::schemas::OPENAPI_JSON;

/// Prints the document.
pub(crate) fn run() -> anyhow::Result<()> {
    // Written directly, so that a closed pipe is an error and not a panic.
    use std::io::Write;
    std::io::stdout().write_all(OPENAPI_JSON.as_bytes())?;
    Ok(())
}
