//! Calls the subcommand that was typed.

use anyhow::Context as _;
use palpate_client::{Client, ClientOptions};

use crate::args::{Cli, Command};
use crate::commands::{
    Context, analyses, audit, catalogues, compact, config, copy, demo, draw, experiment, explore,
    fleet, forwarding, fsck, health, jobs, keys, letters, load, maps, migrate, next_touch, objects,
    openapi, report, robots, sensors, serve, sessions, snapshot, storage, touch, train, webhooks,
};
use crate::output::Output;

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
        Command::Draw(args) => draw::run(args, output),
        Command::Catalogues(args) => catalogues::run(args, &context()?).await,
        Command::Train(args) => train::run(args, &context()?).await,
        Command::Maps(args) => maps::run(args, &context()?).await,
        Command::Report(args) => report::run(args, &context()?).await,
        Command::Jobs(args) => jobs::run(args, &context()?).await,
        Command::Touch(args) => touch::run(args, &context()?).await,
        Command::Explore(args) => explore::run(args, &context()?).await,
        Command::NextTouch(args) => next_touch::run(args, &context()?).await,
        Command::Fleet(args) => fleet::run(args, &context()?).await,
        Command::Sessions(args) => sessions::run(args, &context()?).await,
        Command::Load(args) => load::run(args, &context()?).await,
        Command::Keys(args) => keys::run(args, &context()?).await,
        Command::Robots(args) => robots::run(args, &context()?).await,
        Command::Webhooks(args) => webhooks::run(args, &context()?).await,
        Command::Health => health::run(&context()?).await,
        Command::Whoami => keys::whoami(&context()?).await,
        Command::Audit(args) => audit::run(args, &context()?).await,
        Command::Snapshot(args) => snapshot::run(args, output, context).await,
        Command::Forwarding => forwarding::run(&context()?).await,
        Command::Storage => storage::run(&context()?).await,
        Command::Compact(args) => compact::run(args, output, context).await,
        Command::Copy(args) => copy::run(args, output).await,
        Command::Fsck(args) => fsck::run(args, output).await,
        Command::Migrate(args) => migrate::run(args, output).await,
        Command::Experiment(args) => experiment::run(args, output),
        Command::Openapi => openapi::run(),
    }
}

/// The last eight digits of a key's id, which are random.
fn key_end(key: &str) -> Option<String> {
    let id = key.strip_prefix("palpate_")?.get(..32)?;
    Some(id[24..].to_owned())
}
