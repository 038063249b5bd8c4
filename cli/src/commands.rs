//! The subcommands, one file each, and where each of them is called.

pub(crate) mod analyses;
pub(crate) mod calibrate;
pub(crate) mod demo;
pub(crate) mod experiment;
pub(crate) mod explore;
pub(crate) mod fsck;
pub(crate) mod jobs;
pub(crate) mod letters;
pub(crate) mod maps;
pub(crate) mod migrate;
pub(crate) mod next_touch;
pub(crate) mod objects;
pub(crate) mod openapi;
pub(crate) mod report;
pub(crate) mod sensors;
pub(crate) mod serve;
pub(crate) mod sessions;
pub(crate) mod snapshot;
pub(crate) mod touch;
pub(crate) mod train;

use palpate_client::Client;

use crate::args::{Cli, Command};
use crate::output::Output;

/// What every command that talks to a server needs.
#[derive(Clone)]
pub(crate) struct Context {
    /// The server.
    pub(crate) client: Client,
    /// Where answers go.
    pub(crate) output: Output,
}

/// Does what was typed.
pub(crate) async fn run(cli: Cli) -> anyhow::Result<()> {
    let output = Output { json: cli.json };
    let context = || Ok::<_, anyhow::Error>(Context { client: Client::new(&cli.server)?, output });
    match cli.command {
        Command::Serve(args) => serve::run(args, output).await,
        Command::Demo(args) => demo::run(args, output).await,
        Command::Sensors(args) => sensors::run(args, &context()?).await,
        Command::Analyses(args) => analyses::run(args, &context()?).await,
        Command::Objects(args) => objects::run(args, &context()?).await,
        Command::Letters(args) => letters::run(args, output),
        Command::Train(args) => train::run(args, &context()?).await,
        Command::Maps(args) => maps::run(args, &context()?).await,
        Command::Report(args) => report::run(args, &context()?).await,
        Command::Jobs(args) => jobs::run(args, &context()?).await,
        Command::Touch(args) => touch::run(args, &context()?).await,
        Command::Explore(args) => explore::run(args, &context()?).await,
        Command::NextTouch(args) => next_touch::run(args, &context()?).await,
        Command::Sessions(args) => sessions::run(args, &context()?).await,
        Command::Snapshot(args) => snapshot::run(args, output, context).await,
        Command::Fsck(args) => fsck::run(args, output).await,
        Command::Migrate(args) => migrate::run(args, output).await,
        Command::Experiment(args) => experiment::run(args, output).await,
        Command::Openapi => openapi::run(),
    }
}
