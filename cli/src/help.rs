//! Order in the help of commands, and options that have no meaning for some of them.

use anyhow::bail;
use clap::parser::ValueSource;
use clap::{ArgMatches, Command};

/// Heading of the options that every command accepts.
pub(crate) const GLOBAL: &str = "Server and output";

/// Options of `palpate serve` by heading; those not named are limits.
const SERVE: [(&str, &[&str]); 3] = [
    ("Cells", &["forward_", "cell"]),
    ("Store", &["data", "store", "migrate", "disk_reserve", "keep_sessions"]),
    (
        "Address and access",
        &[
            "listen",
            "insecure",
            "host_names",
            "access",
            "new_admin",
            "admin_key",
            "first_admin",
            "open_metrics",
            "webhook",
            "tls",
            "cors",
            "otlp",
        ],
    ),
];

/// Commands that talk to no server, and options that name one.
const LOCAL: [&str; 9] =
    ["serve", "demo", "letters", "draw", "copy", "fsck", "migrate", "experiment", "openapi"];
const OF_CLIENTS: [(&str, &str); 4] =
    [("server", "--server"), ("api_key", "--key"), ("api_key_file", "--key-file"), ("ca", "--ca")];

/// The command line with the options of `serve` in groups.
pub(crate) fn grouped(command: Command) -> Command {
    command.mut_subcommand("serve", |serve| {
        serve.mut_args(|arg| {
            let id = arg.get_id().to_string();
            let named = |(_, begins): &&(&str, &[&str])| begins.iter().any(|it| id.starts_with(it));
            let heading = SERVE.iter().find(named).map_or("Limits", |(heading, _)| *heading);
            arg.help_heading(heading)
        })
    })
}

/// Refuses an option of clients that was typed for a command without a server.
pub(crate) fn check(matches: &ArgMatches) -> anyhow::Result<()> {
    let Some((name, own)) = matches.subcommand().filter(|(name, _)| LOCAL.contains(name)) else {
        return Ok(());
    };
    let is_typed = |id: &str| own.value_source(id) == Some(ValueSource::CommandLine);
    match OF_CLIENTS.iter().find(|(id, _)| is_typed(id)) {
        Some((_, option)) => {
            bail!("{option} has no meaning for `palpate {name}`: it asks no server")
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::args::Cli;

    #[test]
    fn the_help_of_serve_has_its_options_in_groups() {
        let mut command = grouped(Cli::command());
        command.build();
        let help = command.find_subcommand_mut("serve").unwrap().render_long_help().to_string();
        let headings: Vec<&str> = help.lines().filter(|line| line.ends_with(':')).collect();
        for heading in ["Limits:", "Store:", "Cells:", "Address and access:", "Server and output:"]
        {
            let n = headings.iter().filter(|found| **found == heading).count();
            assert_eq!(n, 1, "{heading} in {headings:?}");
        }
    }

    #[test]
    fn options_without_a_meaning_are_refused() {
        let typed = |line: &str| {
            let matches = Cli::command().try_get_matches_from(line.split_whitespace()).unwrap();
            check(&matches)
        };
        for (_, option) in OF_CLIENTS {
            let error = typed(&format!("palpate fsck --data d {option} x")).unwrap_err();
            assert!(error.to_string().contains(option), "{error}");
        }
        assert!(typed("palpate fleet --server http://a:1").is_ok());
    }
}
