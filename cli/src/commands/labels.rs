//! Labels in commands: those to set, and those to search for.

use clap::Args;
use palpate_client::schemas::{LabelledQuery, Labels};

/// Number of things per request.
const PER_REQUEST: u32 = 1000;

/// A thing and its new labels.
#[derive(Debug, Args)]
pub(crate) struct LabelArgs {
    /// The thing's id or name.
    pub(crate) thing: String,
    /// New labels, `key=value`, which replace all earlier ones; none removes all.
    #[arg(value_parser = label, value_name = "KEY=VALUE")]
    labels: Vec<(String, String)>,
}

impl LabelArgs {
    pub(crate) fn labels(self) -> Labels {
        self.labels.into_iter().collect()
    }
}

/// A search by labels.
#[derive(Debug, Args)]
pub(crate) struct WantedArgs {
    /// Only those with all these labels: `key` or `key:value`, separated by commas.
    #[arg(long)]
    labels: Option<String>,
}

impl WantedArgs {
    pub(crate) fn query(self) -> LabelledQuery {
        LabelledQuery { limit: Some(PER_REQUEST), cursor: None, labels: self.labels }
    }
}

/// Labels in a cell of a table.
pub(crate) fn words(labels: &Labels) -> String {
    let one = |(key, value): (&String, &String)| format!("{key}={value}");
    labels.iter().map(one).collect::<Vec<_>>().join(", ")
}

fn label(text: &str) -> Result<(String, String), String> {
    let pair = text.split_once('=').ok_or("expected KEY=VALUE, such as site=oslo")?;
    Ok((pair.0.to_owned(), pair.1.to_owned()))
}
