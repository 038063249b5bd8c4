//! The command line: subcommands and global options.

use std::path::PathBuf;

use clap::{Parser, Subcommand, ValueEnum};

use crate::commands::{
    analyses::AnalysesArgs, audit::AuditArgs, catalogues::CataloguesArgs, compact::CompactArgs,
    config::ConfigArgs, copy::CopyArgs, demo::DemoArgs, draw::DrawArgs, experiment::ExperimentArgs,
    explore::ExploreArgs, fleet::FleetArgs, fsck::FsckArgs, jobs::JobsArgs, keys::KeysArgs,
    letters::LettersArgs, load::LoadArgs, maps::MapsArgs, migrate::MigrateArgs,
    next_touch::NextTouchArgs, objects::ObjectsArgs, report::ReportArgs, robots::RobotsArgs,
    sensors::SensorsArgs, serve::ServeArgs, sessions::SessionsArgs, snapshot::SnapshotArgs,
    touch::TouchArgs, train::TrainArgs, webhooks::WebhooksArgs,
};

use crate::help::GLOBAL;

const EXAMPLES: &str = "\
Examples:
  palpate demo                                see it all, with simulated robots
  palpate serve --data ./palpate-data         run the service
  palpate objects example mug --out .         write an example mesh, mug.stl
  palpate objects add mug --mesh mug.stl --unit mm
                                              add it to the service
  palpate train                               train all objects
  palpate touch --object mug --mesh mug.stl --readings 15 --seed 7

Exit codes: 0 done, 1 failed, 2 wrong usage, 3 server unreachable, 4 object not recognised,
5 stored data damaged, 6 bound exceeded, 130 interrupted.";

/// Recognises objects by touch, for fleets of robots.
#[derive(Debug, Parser)]
#[command(name = "palpate", version, after_help = EXAMPLES, max_term_width = 100)]
pub(crate) struct Cli {
    /// Address of the server.
    #[arg(
        long,
        global = true,
        help_heading = GLOBAL,
        env = "PALPATE_SERVER",
        default_value = "http://127.0.0.1:7411",
        value_name = "URL"
    )]
    pub(crate) server: String,
    /// API key, if the server requires one. Prefer the environment variable to the command line.
    #[arg(
        long = "key",
        global = true,
        help_heading = GLOBAL,
        env = "PALPATE_KEY",
        hide_env_values = true,
        value_name = "KEY"
    )]
    // Not `key`: subcommands have arguments of that name, and clap shares names with them.
    pub(crate) api_key: Option<String>,
    /// File with the API key, such as one written by `palpate serve --admin-key-file` or a mounted
    /// secret.
    #[arg(
        long = "key-file",
        global = true,
        help_heading = GLOBAL,
        env = "PALPATE_KEY_FILE",
        value_name = "FILE",
        conflicts_with = "api_key"
    )]
    pub(crate) api_key_file: Option<PathBuf>,
    /// Certificate authority to trust for https: a PEM file [default: the system's].
    #[arg(long, global = true, help_heading = GLOBAL, env = "PALPATE_CA", value_name = "FILE")]
    pub(crate) ca: Option<PathBuf>,
    /// Configuration file (TOML), also PALPATE_CONFIG. `[serve]` holds settings of the server,
    /// `[client]` those of the other commands, named like the flags; see `palpate config`.
    #[arg(long, global = true, help_heading = GLOBAL, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    /// Log format.
    #[arg(
        long,
        global = true,
        help_heading = GLOBAL,
        env = "PALPATE_LOG_FORMAT",
        value_name = "FORMAT",
        default_value = "human"
    )]
    pub(crate) log_format: LogFormat,
    /// Print JSON to standard output and everything else to standard error.
    #[arg(long, global = true, help_heading = GLOBAL)]
    pub(crate) json: bool,
    /// Also log normal events.
    #[arg(long, short, global = true, help_heading = GLOBAL)]
    pub(crate) verbose: bool,
    /// The subcommand.
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Log format.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum LogFormat {
    /// For people.
    Human,
    /// One JSON object per line, with the request id.
    Json,
}

/// A subcommand.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run the service.
    Serve(ServeArgs),
    /// Show the server's effective settings and where each comes from.
    Config(ConfigArgs),
    /// Run a demonstration: a server, ten objects, four simulated robots.
    Demo(DemoArgs),
    /// Manage sensors.
    Sensors(SensorsArgs),
    /// Compare sensor coverings.
    Analyses(AnalysesArgs),
    /// Manage objects: meshes and training readings.
    Objects(ObjectsArgs),
    /// Write raised letters as meshes, or press them with a simulated rig.
    Letters(LettersArgs),
    /// Draw pictures, such as the tactile image of one press.
    Draw(DrawArgs),
    /// Train a catalogue of objects.
    Train(TrainArgs),
    /// List, follow and cancel training jobs.
    Jobs(JobsArgs),
    /// Show the appearance report of a version.
    Report(ReportArgs),
    /// List catalogues and remove unused ones.
    Catalogues(CataloguesArgs),
    /// Show, export and merge contact maps.
    Maps(MapsArgs),
    /// Touch a mesh with a simulated robot and see whether it is recognised.
    Touch(TouchArgs),
    /// Explore an unknown object with a simulated arm.
    Explore(ExploreArgs),
    /// Show where a robot would learn most about a session's object.
    NextTouch(NextTouchArgs),
    /// List the open sessions, those that need attention first.
    Fleet(FleetArgs),
    /// Inspect and manage sessions.
    Sessions(SessionsArgs),
    /// Load a server with many simulated robots and measure it.
    Load(LoadArgs),
    /// Manage API keys.
    Keys(KeysArgs),
    /// Show which key holds each robot name.
    Robots(RobotsArgs),
    /// Manage webhooks: signed events for other programs.
    Webhooks(WebhooksArgs),
    /// Check that the server is ready; the exit code tells supervisors.
    Health,
    /// Show the key and role that the server sees.
    Whoami,
    /// Show the audit log.
    Audit(AuditArgs),
    /// Take, verify and restore snapshots.
    Snapshot(SnapshotArgs),
    /// Show what a cell has to forward to the central service, and the state of the line.
    Forwarding,
    /// Show the stored bytes per key, and the things that take most.
    Storage,
    /// Free the disk space of removed records.
    Compact(CompactArgs),
    /// Copy all stored data between a folder and a NATS cluster, and compare both.
    Copy(CopyArgs),
    /// Check a folder of stored data for damage.
    Fsck(FsckArgs),
    /// Migrate a folder of stored data to the current layout.
    Migrate(MigrateArgs),
    /// Rerun the tables and figures of docs/results; `--help` lists the experiments.
    Experiment(ExperimentArgs),
    /// Print the OpenAPI 3.1 description of the HTTP API.
    Openapi,
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;
    use clap::error::ErrorKind;

    use super::*;

    fn parse(line: &str) -> Result<Cli, clap::Error> {
        Cli::try_parse_from(line.split_whitespace())
    }

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    /// Command lines as in the documentation.
    const LINES: &[&str] = &[
        "palpate serve --data ./d --listen 0.0.0.0:7411",
        "palpate serve --model-memory-mb 250",
        "palpate serve --config palpate.toml --log-format json",
        "palpate config --requests 100 --json",
        "palpate serve --migrate --disk-reserve-mb 256",
        "palpate fsck --data ./d --json",
        "palpate fsck --data ./d --collect",
        "palpate fsck --data ./d --accept",
        "palpate migrate --data ./d",
        "palpate compact",
        "palpate compact --data ./d --json",
        "palpate serve --store-slack-mb 8",
        "palpate serve --store-quota-mb 500",
        "palpate storage --json",
        "palpate snapshot create monday.snapshot",
        "palpate snapshot verify monday.snapshot --json",
        "palpate snapshot restore monday.snapshot --data ./restored",
        "palpate snapshot restore monday.snapshot --data ./restored --keys drop",
        "palpate snapshot restore monday.snapshot --data ./r --keys newer --current ./d",
        "palpate serve --access keys --admin-key-file admin.key",
        "palpate demo",
        "palpate demo --once --json --trials 40",
        "palpate objects add mug --mesh mug.stl",
        "palpate objects add mug --mesh mug.stl --unit m",
        "palpate objects example --all --out meshes",
        "palpate objects readings add mug --file readings.json",
        "palpate letters list",
        "palpate letters mesh --all --out letters",
        "palpate letters press A --out a.json --repetition 1 --seed 3 --noise harsh",
        "palpate letters press q --out q.json --pose -5,3.5,120 --readings 9",
        "palpate draw press --object mug --from 90,0 --out mug.svg",
        "palpate draw press --mesh p.stl --sensor tekscan-26x26 --from -30,45 --turn 90 --out p.svg",
        "palpate draw press --object mug --pose 0,0,-27.8,1,0,0,0 --out bottom.svg",
        "palpate sensors add finger --preset digitacts-6x6",
        "palpate train --readings-per-object 500 --surface-readings 900 --seed 3 --sensor digitacts-6x6 mug cup",
        "palpate touch --object mug --mesh mug.stl --readings 15 --seed 7",
        "palpate explore --object mug --readings 40 --out mug.json",
        "palpate explore --mesh part.stl --readings 100 --offline --out part.json",
        "palpate explore --replay mug.json --session 0198a0d0-0000-7000-8000-000000000000",
        "palpate explore --object mug --local 1 --links 6 --perturb --noise 0.4",
        "palpate explore --object mug --perturb --method appearance --readings 40",
        "palpate touch --object A --mesh A.stl --method geometric --sensor digitacts-6x6-thin",
        "palpate train --geometric planar --cell-mm 0.5 A E I O U",
        "palpate train --geometric solid",
        "palpate maps show --object A",
        "palpate maps export --object A --png A.png --slice 0 --ply A.ply --form mesh",
        "palpate maps merge --catalogue lab-1 --with-catalogue lab-2 --with-version 3",
        "palpate sessions marginals 0198a0d0-0000-7000-8000-000000000000 --object A",
        "palpate sessions list --json",
        "palpate next-touch 0198a0d0-0000-7000-8000-000000000000 -n 3 --recenters",
        "palpate next-touch 0198a0d0-0000-7000-8000-000000000000 --workspace -0.1,0,0,0.2",
        "palpate jobs cancel 0198a0d0-0000-7000-8000-000000000000",
        "palpate sensors indent finger --out indentation.json --seed 3",
        "palpate sensors calibrate finger --file indentation.json",
        "palpate sensors calibration finger --number 1 --json",
        "palpate sensors reference ridge --out ridge.stl",
        "palpate sensors commission finger --reference cube --simulate --mistake mirror --apply",
        "palpate sensors commission finger --object mug --readings - --touches 24",
        "palpate sensors passport finger --json",
        "palpate analyses covering --element-width-mm 2 --thickness-mm 1,2.5",
        "palpate load --prepare --rate 100 --duration-s 30",
        "palpate load --prepare --steps 100,200,400,800 --min-share 0.8 --picture load.svg",
        "palpate load --catalogue default --mix readings=8,beliefs=2 --poisson --polite",
        "palpate load --steps 200,400 --soak 10 --overload 2 --pid 1 --max-growth-mb 50",
        "palpate openapi",
        "palpate serve --access keys --listen 0.0.0.0:7411 --tls-cert c.pem --tls-key k.pem",
        "palpate serve --cors-origin https://a.example --cors-origin http://b.example:3000",
        "palpate serve --new-admin-key --open-metrics --audit-entries 1000",
        "palpate keys create arm-3 --role robot --expires-days 90",
        "palpate keys list --json",
        "palpate keys revoke arm-3",
        "palpate keys rotate arm-3 --grace-s 3600",
        "palpate robots list",
        "palpate robots bind arm-3 --to arm-3-new",
        "palpate robots release arm-3",
        "palpate webhooks create https://mes.example/x --events session.decided,snapshot.made",
        "palpate webhooks deliveries 0198a0d0-0000-7000-8000-000000000000 --failed -n 5",
        "palpate serve --webhook-allow-private",
        "palpate serve --forward-to https://hub:7411 --forward-key-file hub.key --cell cell-7",
        "palpate forwarding --json",
        "palpate audit --ring refused",
        "palpate whoami --key palpate_x --ca ca.pem",
        "palpate whoami --key-file admin.key",
        "palpate audit --since 2026-05-01T00:00:00Z --by arm-3 --operation delete_object -n 20",
        "palpate experiment sva-objects --meshes DIR --size-mm 80 --seed 3 --trials 10 --out DIR",
        "palpate experiment server-throughput --help",
        "palpate --server http://host:1 objects list",
    ];

    #[test]
    fn the_lines_of_the_documentation_are_understood() {
        for line in LINES {
            assert!(parse(line).is_ok(), "{line}: {}", parse(line).unwrap_err());
        }
    }

    #[test]
    fn what_is_not_meant_is_refused() {
        for line in [
            "palpate",
            "palpate touch --mesh mug.stl",
            "palpate snapshot restore monday.snapshot",
            "palpate snapshot restore monday.snapshot --data ./restored --keys newer",
            "palpate fsck",
            "palpate serve --model-memory-mb 0",
            "palpate objects add mug --mesh mug.stl --unit inch",
            "palpate objects example --out meshes",
            "palpate objects example mug --all --out meshes",
            "palpate letters mesh A --all",
            "palpate letters press AB --out a.json",
            "palpate letters press A --out a.json --pose 5,3",
            "palpate letters press A --out a.json --readings 193",
            "palpate draw press --object mug --out mug.svg",
            "palpate draw press --from 90,0 --out mug.svg",
            "palpate draw press --object mug --from 90,95 --out mug.svg",
            "palpate draw press --object mug --from 90,0 --pose 0,0,60,1,0,0,0 --out mug.svg",
            "palpate jobs cancel not-an-id",
            "palpate demo --trials 0",
            "palpate serve --tls-cert c.pem",
            "palpate serve --access never",
            "palpate serve --forward-to https://hub:7411",
            "palpate serve --audit-entries 0",
            "palpate keys create arm-3",
            "palpate keys create arm-3 --role boss",
            "palpate robots bind arm-3",
            "palpate webhooks create https://mes.example/x",
            "palpate webhooks create https://mes.example/x --events ping",
            "palpate audit --ring all",
            "palpate explore",
            "palpate next-touch",
            "palpate next-touch 0198a0d0-0000-7000-8000-000000000000 --workspace 1,2,3",
            "palpate explore --object mug --offline",
            "palpate explore --object mug --method geometric",
            "palpate explore --object mug --offline --out mug.json --method sva",
            "palpate explore --object mug --local 1.5",
            "palpate explore --object mug --links 2",
            "palpate explore --object mug --replay mug.json",
            "palpate sensors calibrate finger",
            "palpate analyses covering --thickness-mm 1 --spread-mm 2",
            "palpate train --cell-mm 0.5",
            "palpate train --geometric flat",
            "palpate train --geometric planar --cell-mm 0",
            "palpate maps export --object A",
            "palpate maps merge",
            "palpate load --rate 0",
            "palpate load --rate 5 --steps 5,6",
            "palpate load --mix beliefs=1",
            "palpate load --min-share 2",
        ] {
            let error = parse(line).expect_err(line);
            assert_eq!(error.exit_code(), 2, "{line}");
        }
    }

    #[test]
    fn help_shows_examples_and_exit_codes() {
        let error = parse("palpate --help").unwrap_err();
        assert_eq!(error.kind(), ErrorKind::DisplayHelp);
        let help = error.to_string();
        assert!(help.contains("palpate demo") && help.contains("Exit codes"), "{help}");
    }
}
