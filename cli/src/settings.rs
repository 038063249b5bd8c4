//! Settings in layers: defaults, then a file, then the environment, then the command line.
//!
//! The file's values become defaults of the command line's options, so that one list of settings
//! and one validation serve all layers, and one place knows which layer won.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Command};
use serde::Serialize;
use toml::{Table, Value};

/// Environment variable that names the file.
const FILE_VARIABLE: &str = "PALPATE_CONFIG";
/// Tables of the file: for the server, and for the client commands.
const SERVE: &str = "serve";
const CLIENT: &str = "client";
/// Subcommands with the server's settings.
const HAVE_SERVE: [&str; 2] = [SERVE, "config"];
/// Settings of `[client]`. A key is not among them because it does not belong in a file.
const CLIENT_SETTINGS: [&str; 2] = ["server", "ca"];
/// Options of the server that are actions, not settings.
const NOT_SETTINGS: [&str; 3] = ["help", "new_admin_key", "config"];

/// A file's values by setting, as command-line words.
type Layer = BTreeMap<String, Vec<String>>;

/// A parsed configuration file.
#[derive(Debug, Default)]
pub(crate) struct File {
    path: PathBuf,
    serve: Layer,
    client: Layer,
}

/// An effective setting and its source.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Setting {
    /// Table and name of the setting in a file.
    pub(crate) name: String,
    /// Value of the setting; null if not set.
    pub(crate) value: Option<String>,
    /// `default`, `file`, `environment` or `flag`.
    pub(crate) source: &'static str,
    /// The file, the variable or the flag.
    pub(crate) from: Option<String>,
}

/// The file that the command line or the environment names, parsed and checked; `None` without one.
///
/// # Errors
///
/// When the file cannot be read, or holds an unknown setting or an invalid value.
pub(crate) fn file(command: &Command, typed: &[OsString]) -> anyhow::Result<Option<File>> {
    let Some(path) = named(typed).or_else(|| std::env::var_os(FILE_VARIABLE).map(PathBuf::from))
    else {
        return Ok(None);
    };
    let shown = path.display();
    let text = std::fs::read_to_string(&path)
        .with_context(|| format!("cannot read the configuration {shown}"))?;
    let read = read(command, &path, &text);
    read.map(Some).with_context(|| format!("the configuration {shown} is wrong"))
}

/// The command line with a file's values as defaults.
pub(crate) fn layered(command: Command, file: &File) -> Command {
    let mut command = with_defaults(command, &file.client);
    for name in HAVE_SERVE {
        command = command.mut_subcommand(name, |command| with_defaults(command, &file.serve));
    }
    command
}

/// Every effective setting with its source, for `palpate config`.
pub(crate) fn effective(
    command: &Command,
    matches: &ArgMatches,
    file: Option<&File>,
) -> Vec<Setting> {
    let none = Layer::new();
    let (serve, client) = file.map_or((&none, &none), |file| (&file.serve, &file.client));
    let Some((_, matches)) = matches.subcommand() else { return Vec::new() };
    let Some(config) = command.find_subcommand("config") else { return Vec::new() };
    let path = file.map(|file| file.path.display().to_string());
    let of_serve = settings(config).map(|arg| (SERVE, arg, serve));
    let globals = settings(command).filter(|arg| CLIENT_SETTINGS.contains(&key(arg).as_str()));
    let of_client = globals.map(|arg| (CLIENT, arg, client));
    let mut all: Vec<Setting> = of_serve
        .chain(of_client)
        .map(|(table, arg, layer)| setting(table, arg, layer, matches, path.as_deref()))
        .collect();
    all.sort_by(|a, b| a.name.cmp(&b.name));
    all
}

fn setting(
    table: &str,
    arg: &Arg,
    layer: &Layer,
    matches: &ArgMatches,
    path: Option<&str>,
) -> Setting {
    let id = arg.get_id().as_str();
    let raw = matches.try_get_raw(id).ok().flatten();
    let value = raw.map(|raw| {
        raw.map(|value| value.to_string_lossy().into_owned()).collect::<Vec<_>>().join(",")
    });
    let (source, from) = match matches.value_source(id) {
        Some(ValueSource::CommandLine) => ("flag", Some(format!("--{}", long(arg)))),
        Some(ValueSource::EnvVariable) => {
            ("environment", arg.get_env().map(|name| name.to_string_lossy().into_owned()))
        }
        _ if layer.contains_key(&key(arg)) => ("file", path.map(str::to_owned)),
        _ => ("default", None),
    };
    Setting { name: format!("{table}.{}", key(arg)), value, source, from }
}

/// The file that `--config` names.
fn named(typed: &[OsString]) -> Option<PathBuf> {
    let mut typed = typed.iter();
    while let Some(word) = typed.next() {
        let text = word.to_string_lossy();
        if text == "--config" {
            return typed.next().map(PathBuf::from);
        }
        if let Some(path) = text.strip_prefix("--config=") {
            return Some(PathBuf::from(path));
        }
    }
    None
}

fn read(command: &Command, path: &Path, text: &str) -> anyhow::Result<File> {
    let tables: Table = text.parse()?;
    let mut file = File { path: path.to_owned(), ..File::default() };
    for (name, table) in tables {
        let Value::Table(table) = table else {
            bail!("`{name}` stands outside of the tables [{SERVE}] and [{CLIENT}]");
        };
        match name.as_str() {
            SERVE => {
                let serve = command.find_subcommand(SERVE).context("there is no `serve`")?;
                let known: Vec<&Arg> = settings(serve).collect();
                file.serve = layer(SERVE, &known, table)?;
            }
            CLIENT => {
                let is_one = |arg: &&Arg| CLIENT_SETTINGS.contains(&key(arg).as_str());
                let known: Vec<&Arg> = settings(command).filter(is_one).collect();
                file.client = layer(CLIENT, &known, table)?;
            }
            _ => bail!("[{name}] is no table of settings: expected [{SERVE}] or [{CLIENT}]"),
        }
    }
    check(command, &file)?;
    Ok(file)
}

/// A table's values as command-line words.
fn layer(name: &str, known: &[&Arg], table: Table) -> anyhow::Result<Layer> {
    let mut layer = Layer::new();
    for (setting, value) in table {
        if !known.iter().any(|arg| key(arg) == setting) {
            let names: Vec<String> = known.iter().map(|arg| key(arg)).collect();
            let nearest = names.iter().max_by(|a, b| {
                let likeness = |name: &str| strsim::jaro_winkler(name, &setting);
                likeness(a).total_cmp(&likeness(b))
            });
            bail!(
                "{name}.{setting} is no setting: did you mean {}? There are {}",
                nearest.map_or("none", String::as_str),
                names.join(", ")
            );
        }
        let words = match value {
            Value::Array(values) => values.into_iter().map(word).collect(),
            one => word(one).map(|word| vec![word]),
        };
        let Some(words) = words else {
            bail!(
                "{name}.{setting} is neither a text, a number, true or false, nor a list of them"
            );
        };
        layer.insert(setting, words);
    }
    Ok(layer)
}

fn word(value: Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text),
        Value::Integer(n) => Some(n.to_string()),
        Value::Float(x) => Some(x.to_string()),
        Value::Boolean(is) => Some(is.to_string()),
        Value::Datetime(_) | Value::Array(_) | Value::Table(_) => None,
    }
}

/// Checks the values as if they had been given on the command line.
fn check(command: &Command, file: &File) -> anyhow::Result<()> {
    let mut typed = vec![command.get_name().to_owned()];
    let globals: Vec<&Arg> = settings(command).collect();
    typed.extend(words(&globals, &file.client)?);
    if let Some(serve) = command.find_subcommand(SERVE) {
        typed.push(SERVE.to_owned());
        let known: Vec<&Arg> = settings(serve).collect();
        typed.extend(words(&known, &file.serve)?);
    }
    command.clone().try_get_matches_from(typed).map(drop).map_err(|error| {
        let text = error.render().to_string();
        let said = text.lines().next().unwrap_or_default();
        anyhow::anyhow!("{}", said.trim_start_matches("error: "))
    })
}

/// A layer as a command line.
fn words(known: &[&Arg], layer: &Layer) -> anyhow::Result<Vec<String>> {
    let mut typed = Vec::new();
    for arg in known {
        let Some(values) = layer.get(&key(arg)) else { continue };
        let long = long(arg);
        if matches!(arg.get_action(), ArgAction::SetTrue) {
            match values.as_slice() {
                [is] if is == "true" => typed.push(format!("--{long}")),
                [is] if is == "false" => {}
                _ => bail!("{} came {values:?}, expected true or false", key(arg)),
            }
            continue;
        }
        typed.extend(values.iter().map(|value| format!("--{long}={value}")));
    }
    Ok(typed)
}

fn with_defaults(command: Command, layer: &Layer) -> Command {
    let ids: Vec<(String, Vec<String>)> = settings(&command)
        .filter_map(|arg| Some((arg.get_id().to_string(), layer.get(&key(arg))?.clone())))
        .collect();
    ids.into_iter().fold(command, |command, (id, values)| {
        command.mut_arg(id, |arg| arg.default_values(values))
    })
}

/// Options of a command that are settings.
fn settings(command: &Command) -> impl Iterator<Item = &Arg> {
    command
        .get_arguments()
        .filter(|arg| arg.get_long().is_some())
        .filter(|arg| !NOT_SETTINGS.contains(&arg.get_id().as_str()))
}

fn long(arg: &Arg) -> &str {
    arg.get_long().unwrap_or_default()
}

/// Name of a setting in a file.
fn key(arg: &Arg) -> String {
    long(arg).replace('-', "_")
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::args::Cli;

    fn file_of(text: &str) -> anyhow::Result<File> {
        read(&Cli::command(), Path::new("palpate.toml"), text)
    }

    fn effective_of(
        text: &str,
        typed: &[&str],
    ) -> BTreeMap<String, (Option<String>, &'static str)> {
        let file = file_of(text).unwrap();
        let command = layered(Cli::command(), &file);
        let words = ["palpate", "config"].iter().chain(typed);
        let matches = command.clone().try_get_matches_from(words).unwrap();
        let all = effective(&command, &matches, Some(&file));
        all.into_iter().map(|one| (one.name, (one.value, one.source))).collect()
    }

    #[test]
    fn a_flag_wins_over_the_file_and_the_file_over_the_default() {
        let text = "[serve]\nlisten = \"0.0.0.0:9\"\nrequests = 7\nmigrate = true\n\
            cors_origin = [\"https://a.example\", \"https://b.example\"]\n\
            [client]\nserver = \"http://there:1\"\n";
        let found = effective_of(text, &["--requests", "8"]);
        let is = |name: &str, value: &str, source: &str| {
            let (found_value, found_source) = &found[name];
            assert_eq!((found_value.as_deref(), *found_source), (Some(value), source), "{name}");
        };
        is("serve.listen", "0.0.0.0:9", "file");
        is("serve.requests", "8", "flag");
        is("serve.migrate", "true", "file");
        is("serve.cors_origin", "https://a.example,https://b.example", "file");
        is("serve.sessions_open", "10000", "default");
        is("client.server", "http://there:1", "file");
        assert_eq!(found["serve.tls_cert"], (None, "default"));
        assert!(!found.contains_key("serve.new_admin_key") && !found.contains_key("client.key"));
    }

    #[test]
    fn what_is_wrong_in_a_file_is_named() {
        for (text, expected) in [
            ("listen = \"x\"", "`listen` stands outside"),
            ("[server]\n", "[server] is no table of settings"),
            (
                "[serve]\nlisten_at = 1",
                "serve.listen_at is no setting: did you mean listen? There are data, store,",
            ),
            ("[serve]\nlisten = \"here\"", "invalid value 'here' for '--listen <ADDR>'"),
            ("[serve]\nrequests = 0", "invalid value '0' for '--requests <N>'"),
            ("[serve]\nmigrate = \"yes\"", "migrate came [\"yes\"], expected true or false"),
            ("[serve]\nlisten = { port = 1 }", "serve.listen is neither a text, a number"),
            ("[client]\nkey = \"palpate_x\"", "client.key is no setting"),
            ("[serve]\nrequests = ", "TOML parse error at line 2"),
        ] {
            let error = format!("{:#}", file_of(text).unwrap_err());
            assert!(error.contains(expected), "{text}: {error}");
        }
    }

    #[test]
    fn the_file_is_named_in_either_way() {
        let of = |line: &str| named(&line.split(' ').map(OsString::from).collect::<Vec<_>>());
        assert_eq!(of("palpate serve --config a.toml --listen x"), Some("a.toml".into()));
        assert_eq!(of("palpate --config=b.toml config"), Some("b.toml".into()));
        assert_eq!(of("palpate serve"), None);
    }
}
