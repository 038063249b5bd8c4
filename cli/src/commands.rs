//! The subcommands, one file each.

pub(crate) mod analyses;
pub(crate) mod audit;
pub(crate) mod calibrate;
pub(crate) mod catalogues;
pub(crate) mod compact;
pub(crate) mod config;
pub(crate) mod copy;
pub(crate) mod demo;
pub(crate) mod draw;
pub(crate) mod experiment;
pub(crate) mod explore;
pub(crate) mod fleet;
pub(crate) mod forwarding;
pub(crate) mod fsck;
pub(crate) mod health;
pub(crate) mod jobs;
pub(crate) mod keys;
mod labels;
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
pub(crate) mod storage;
pub(crate) mod touch;
pub(crate) mod train;
pub(crate) mod webhooks;

use palpate_client::Client;

use crate::output::Output;

/// Context of a command that talks to a server.
#[derive(Clone)]
pub(crate) struct Context {
    /// Client of the server.
    pub(crate) client: Client,
    /// Output of answers.
    pub(crate) output: Output,
    /// The end of the key's id, if there is a key.
    pub(crate) key_end: Option<String>,
}

impl Context {
    /// Name of a simulated robot; with a key, one that no other key uses.
    pub(crate) fn robot(&self, name: &str) -> String {
        self.key_end.as_ref().map_or_else(|| name.to_owned(), |end| format!("{name}-{end}"))
    }
}
