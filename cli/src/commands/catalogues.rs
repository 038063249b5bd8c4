//! `palpate catalogues`: what is trained, and what is not needed any more.

use clap::{Args, Subcommand};
use palpate_client::schemas::{Catalogue, PageQuery};

use super::Context;
use crate::output;

/// Arguments of `palpate catalogues`.
#[derive(Debug, Args)]
pub(crate) struct CataloguesArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// List the catalogues.
    List,
    /// Remove a catalogue with all its versions, or one version, that nothing needs.
    #[command(after_help = "Examples:\n  palpate catalogues remove letters\n  \
        palpate catalogues remove default --version 3\n\n\
        The current version stays, and so does what a kept session began with.")]
    Remove {
        /// Its name.
        catalogue: String,
        /// The version; the whole catalogue when not given.
        #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
        version: Option<u32>,
    },
}

/// Does what was asked.
pub(crate) async fn run(args: CataloguesArgs, context: &Context) -> anyhow::Result<()> {
    let (client, output) = (&context.client, context.output);
    match args.action {
        Action::List => {
            let page = client.catalogues(&PageQuery { limit: Some(1000), cursor: None }).await?;
            output.answer(&page, |page| table(&page.items))
        }
        Action::Remove { catalogue, version: Some(version) } => {
            client.delete_version(&catalogue, version).await?;
            output.answer(&(), |()| format!("removed version {version} of catalogue {catalogue}"))
        }
        Action::Remove { catalogue, version: None } => {
            client.delete_catalogue(&catalogue).await?;
            output.answer(&(), |()| format!("removed catalogue {catalogue}"))
        }
    }
}

fn table(catalogues: &[Catalogue]) -> String {
    output::table(
        ["name", "current", "newest", "since"],
        catalogues.iter().map(|catalogue| {
            let current = catalogue.current.as_ref();
            [
                catalogue.name.clone(),
                current.map_or("–".to_owned(), |current| current.version.to_string()),
                catalogue.latest_version.to_string(),
                current.map_or("–".to_owned(), |current| current.changed_at.clone()),
            ]
        }),
    )
}
