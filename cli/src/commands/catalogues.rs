//! `palpate catalogues`: list catalogues, recalibrate one, choose its version, remove unused ones.

mod compare;
pub(super) mod recalibrate;

use clap::{Args, Subcommand};
use palpate_client::schemas::Catalogue;

use super::Context;
use super::labels::{self, LabelArgs, WantedArgs};
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
    List(WantedArgs),
    /// Set the labels of a catalogue.
    Label(LabelArgs),
    /// Let an alias name a version. Sessions can be opened with it in place of a number.
    #[command(after_help = "Example:\n  palpate catalogues alias default candidate 4")]
    Alias {
        /// Name of the catalogue.
        catalogue: String,
        /// The alias.
        alias: String,
        /// Version that it names.
        #[arg(value_parser = clap::value_parser!(u32).range(1..))]
        version: u32,
    },
    /// Remove an alias; the version stays.
    Unalias {
        /// Name of the catalogue.
        catalogue: String,
        /// The alias.
        alias: String,
    },
    /// Recalibrate a catalogue from closed sessions whose true object is known.
    Recalibrate(recalibrate::RecalibrateArgs),
    /// Try a version on recorded sessions, beside the current one.
    Compare(compare::CompareArgs),
    /// Make a version current. New sessions use it.
    #[command(after_help = "Example:\n  palpate catalogues use default 3\n\n\
        Undoes a training or a recalibration. Running sessions keep their version.")]
    Use {
        /// Name of the catalogue.
        catalogue: String,
        /// Version to make current.
        #[arg(value_parser = clap::value_parser!(u32).range(1..))]
        version: u32,
    },
    /// Remove a catalogue or one version. Refused while something uses it.
    #[command(after_help = "Examples:\n  palpate catalogues remove letters\n  \
        palpate catalogues remove default --version 3\n\n\
        The current version and versions of stored sessions cannot be removed.")]
    Remove {
        /// Name of the catalogue.
        catalogue: String,
        /// Version to remove [default: the whole catalogue].
        #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
        version: Option<u32>,
    },
}

/// Runs the command.
pub(crate) async fn run(args: CataloguesArgs, context: &Context) -> anyhow::Result<()> {
    let (client, output) = (&context.client, context.output);
    match args.action {
        Action::List(wanted) => {
            let page = client.catalogues(&wanted.query()).await?;
            output.answer(&page, |page| table(&page.items))
        }
        Action::Label(args) => {
            let catalogue = args.thing.clone();
            let catalogue = client.set_catalogue_labels(&catalogue, &args.labels()).await?;
            output.answer(&catalogue, |catalogue| table(std::slice::from_ref(catalogue)))
        }
        Action::Alias { catalogue, alias, version } => {
            let catalogue = client.set_alias(&catalogue, &alias, version).await?;
            output.answer(&catalogue, |catalogue| table(std::slice::from_ref(catalogue)))
        }
        Action::Unalias { catalogue, alias } => {
            client.remove_alias(&catalogue, &alias).await?;
            output.answer(&(), |()| format!("removed alias {alias} of catalogue {catalogue}"))
        }
        Action::Recalibrate(args) => recalibrate::run(args, context).await,
        Action::Compare(args) => compare::run(args, context).await,
        Action::Use { catalogue, version } => {
            let now = client.current_version(&catalogue).await?;
            let current = client.set_current_version(&catalogue, version, now.revision).await?;
            output.answer(&current, |current| {
                format!("version {} of {catalogue} is current now", current.version)
            })
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
        ["name", "current", "newest", "since", "aliases", "labels"],
        catalogues.iter().map(|catalogue| {
            let current = catalogue.current.as_ref();
            [
                catalogue.name.clone(),
                current.map_or("–".to_owned(), |current| current.version.to_string()),
                catalogue.latest_version.to_string(),
                current.map_or("–".to_owned(), |current| current.changed_at.clone()),
                aliases(catalogue),
                labels::words(&catalogue.labels),
            ]
        }),
    )
}

fn aliases(catalogue: &Catalogue) -> String {
    let one = |(alias, version): (&String, &u32)| format!("{alias} = {version}");
    catalogue.aliases.iter().map(one).collect::<Vec<_>>().join(", ")
}
