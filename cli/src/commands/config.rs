//! `palpate config`: the effective settings and the layer each comes from.

use clap::Args;

use super::serve::ServeArgs;
use crate::output::{self, Output};
use crate::settings::Setting;

/// Arguments of `palpate config`: those of `palpate serve`.
#[derive(Debug, Args)]
#[command(
    after_help = "Layers, of which the last wins: defaults, the file (--config or PALPATE_CONFIG), \
    the environment, flags.\n\nExamples:\n  palpate config --config palpate.toml\n  \
    palpate config --requests 100 --json"
)]
pub(crate) struct ConfigArgs {
    #[command(flatten)]
    _serve: ServeArgs,
    /// The effective settings, computed when the command line was parsed.
    #[arg(skip)]
    pub(crate) effective: Vec<Setting>,
}

/// Prints the settings.
pub(crate) fn run(args: &ConfigArgs, output: Output) -> anyhow::Result<()> {
    output.answer(&args.effective, |settings| {
        output::table(
            ["setting", "value", "source", "from"],
            settings.iter().map(|setting| {
                [
                    setting.name.clone(),
                    setting.value.clone().unwrap_or_else(|| "–".to_owned()),
                    setting.source.to_owned(),
                    setting.from.clone().unwrap_or_default(),
                ]
            }),
        )
    })
}
