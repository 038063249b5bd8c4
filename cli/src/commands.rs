//! The subcommands, one file each, and their dispatch.

pub(crate) mod analyses;
pub(crate) mod audit;
pub(crate) mod calibrate;
pub(crate) mod catalogues;
pub(crate) mod compact;
pub(crate) mod config;
pub(crate) mod demo;
pub(crate) mod experiment;
pub(crate) mod explore;
pub(crate) mod fsck;
pub(crate) mod health;
pub(crate) mod jobs;
pub(crate) mod keys;
pub(crate) mod letters;
pub(crate) mod load;
pub(crate) mod maps;
pub(crate) mod migrate;
pub(crate) mod next_touch;
pub(crate) mod objects;
pub(crate) mod openapi;
pub(crate) mod report;
pub(crate) mod robots;
pub(crate) mod sensors;
pub(crate) mod serve;
pub(crate) mod sessions;
pub(crate) mod snapshot;
pub(crate) mod touch;
pub(crate) mod train;

use anyhow::Context as _;
use palpate_client::{Client, ClientOptions};

use crate::args::{Cli, Command};
use crate::output::Output;

/// Context of a command that talks to a server.
#[derive(Clone)]
pub(crate) struct Context {
    /// Client of the server.
    pub(crate) client: Client,
    /// Output of answers.
    pub(crate) output: Output,
    /// End of the key's id, if there is a key.
    key_end: Option<String>,
}

impl Context {
    /// Name of a simulated robot; with a key, one that no other key uses.
    pub(crate) fn robot(&self, name: &str) -> String {
        self.key_end.as_ref().map_or_else(|| name.to_owned(), |end| format!("{name}-{end}"))
    }
}

/// The last eight digits of a key's id, which are random.
fn key_end(key: &str) -> Option<String> {
    let id = key.strip_prefix("palpate_")?.get(..32)?;
    Some(id[24..].to_owned())
}

/// Runs the parsed command.
pub(crate) async fn run(cli: Cli) -> anyhow::Result<()> {
    let output = Output { json: cli.json };
    let context = || {
        let authority_pem = cli.ca.as_ref().map(|path| {
            std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))
        });
        let key = match &cli.api_key_file {
            Some(path) => Some(
                std::fs::read_to_string(path)
                    .with_context(|| format!("cannot read {}", path.display()))?
                    .trim()
                    .to_owned(),
            ),
            None => cli.api_key.clone(),
        };
        let key = key.filter(|key| !key.is_empty());
        let authority_pem = authority_pem.transpose()?;
        let key_end = key.as_deref().and_then(key_end);
        let options = ClientOptions { key, authority_pem, ..ClientOptions::default() };
        Ok::<_, anyhow::Error>(Context {
            client: Client::with_options(&cli.server, options)?,
            output,
            key_end,
        })
    };
    match cli.command {
        Command::Serve(args) => serve::run(args, output).await,
        Command::Config(args) => config::run(&args, output),
        Command::Demo(args) => demo::run(args, output).await,
        Command::Sensors(args) => sensors::run(args, &context()?).await,
        Command::Analyses(args) => analyses::run(args, &context()?).await,
        Command::Objects(args) => objects::run(args, &context()?).await,
        Command::Letters(args) => letters::run(args, output),
        Command::Catalogues(args) => catalogues::run(args, &context()?).await,
        Command::Train(args) => train::run(args, &context()?).await,
        Command::Maps(args) => maps::run(args, &context()?).await,
        Command::Report(args) => report::run(args, &context()?).await,
        Command::Jobs(args) => jobs::run(args, &context()?).await,
        Command::Touch(args) => touch::run(args, &context()?).await,
        Command::Explore(args) => explore::run(args, &context()?).await,
        Command::NextTouch(args) => next_touch::run(args, &context()?).await,
        Command::Sessions(args) => sessions::run(args, &context()?).await,
        Command::Load(args) => load::run(args, &context()?).await,
        Command::Keys(args) => keys::run(args, &context()?).await,
        Command::Robots(args) => robots::run(args, &context()?).await,
        Command::Health => health::run(&context()?).await,
        Command::Whoami => keys::whoami(&context()?).await,
        Command::Audit(args) => audit::run(args, &context()?).await,
        Command::Snapshot(args) => snapshot::run(args, output, context).await,
        Command::Compact(args) => compact::run(args, output, context).await,
        Command::Fsck(args) => fsck::run(args, output).await,
        Command::Migrate(args) => migrate::run(args, output).await,
        Command::Experiment(args) => experiment::run(args, output),
        Command::Openapi => openapi::run(),
    }
}
