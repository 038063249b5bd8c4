//! Servers that divide the objects of catalogues, on the wire.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

/// The servers that divide the objects of catalogues among them.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[schema(as = MemberServers)]
pub struct Members {
    /// Number of servers that hold each object; null if this server holds whole catalogues.
    pub copies: Option<u32>,
    /// The servers that are alive, the one that answers first; empty if it holds whole catalogues.
    pub members: Vec<Member>,
    /// Number of servers that are alive but run another program, whose beliefs might differ in
    /// their last bits; they are not asked.
    pub n_foreign: u32,
}

/// A server that holds objects of catalogues.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Member {
    /// Id of the server's process.
    pub id: Uuid,
    /// Time of its start, RFC 3339.
    pub since: String,
    /// Whether it is the server that answers.
    pub is_self: bool,
    /// What it holds of each divided version.
    pub blocks: Vec<MemberBlocks>,
}

/// Blocks of a version in the memory of one server. A block is 64 consecutive objects.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct MemberBlocks {
    /// Name of the catalogue; its id if it was removed.
    pub catalogue: String,
    /// Number of the version.
    pub version: u32,
    /// Number of blocks that the server holds.
    pub n_held: u32,
    /// Number of blocks of the version.
    pub n_blocks: u32,
    /// Whether sessions of the server use the version.
    pub is_used: bool,
}
