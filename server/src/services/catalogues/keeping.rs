//! What a member does beside its requests: it tells the others what it has, hears them, answers
//! their questions, and reads the blocks that it should hold.
//!
//! Questions are answered on threads of their own. Those of readings wait for the answers of other
//! members, whose threads may wait for this one's.

use std::sync::Arc;
use std::time::Duration;

use palpate_schemas as wire;
use palpate_store::engine::line::Question as Asked;
use tokio::sync::{Semaphore, watch};
use uuid::Uuid;

use super::Catalogues;
use super::blocks::Blocks;
use crate::cause::Cause;
use crate::compute::{Pool, Size, Urgency};
use crate::members::{Block, Heard, HeldVersion, Member, Question, Reply, answer};
use crate::wire::{count, time};

/// Interval at which a member tells what it has. Chosen: a member that is silent for five of them
/// is gone.
const TELL_EVERY: Duration = Duration::from_secs(1);
/// Number of questions that are answered or wait for a thread.
const QUESTIONS_MAX: usize = 64;

impl Catalogues {
    /// The members that are alive with their blocks. Reads the store.
    pub(crate) fn show_members(&self) -> Result<wire::Members, Cause> {
        let Some(blocks) = &self.blocks else {
            return Ok(wire::Members { copies: None, members: Vec::new(), n_foreign: 0 });
        };
        let name = |id: Uuid| self.name(id).unwrap_or_else(|_removed| id.to_string());
        let of_version = |version: &HeldVersion| wire::MemberBlocks {
            catalogue: name(version.catalogue),
            version: version.version,
            n_held: count(version.held.len()),
            n_blocks: version.n_blocks,
            is_used: version.is_used,
        };
        let member = |member: Member| wire::Member {
            id: member.id,
            since: time(member.since_ms),
            is_self: member.is_self,
            blocks: member.versions.iter().map(of_version).collect(),
        };
        let members = blocks.members();
        Ok(wire::Members {
            copies: Some(count(members.copies())),
            members: members.all(blocks.held()).into_iter().map(member).collect(),
            n_foreign: count(members.n_foreign()),
        })
    }

    /// Takes part in the division until the server stops.
    pub(crate) async fn take_part(
        self: Arc<Self>,
        heard: Heard,
        pool: Pool,
        mut stopping: watch::Receiver<bool>,
    ) {
        let Some(blocks) = self.blocks.clone() else { return };
        drop(self);
        let Heard { mut told, mut questions } = heard;
        let mut tick = tokio::time::interval(TELL_EVERY);
        tick.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
        let places = Arc::new(Semaphore::new(QUESTIONS_MAX));
        let mut tidying: Option<tokio::task::JoinHandle<()>> = None;
        loop {
            tokio::select! {
                _ = tick.tick() => {
                    tell(&blocks, false).await;
                    if tidying.as_ref().is_none_or(tokio::task::JoinHandle::is_finished) {
                        let blocks = Arc::clone(&blocks);
                        tidying = Some(tokio::task::spawn_blocking(move || while blocks.tidy() {}));
                    }
                }
                Some(bytes) = told.recv() => {
                    if blocks.members().hear(&bytes) {
                        // The new one need not wait for the next tick.
                        tell(&blocks, false).await;
                    }
                }
                Some(asked) = questions.recv() => {
                    let (blocks, pool) = (Arc::clone(&blocks), pool.clone());
                    let Ok(place) = Arc::clone(&places).try_acquire_owned() else {
                        refuse(asked);
                        continue;
                    };
                    tokio::spawn(async move {
                        reply(blocks, pool, asked).await;
                        drop(place);
                    });
                }
                () = stopped(&mut stopping) => break,
            }
        }
        tell(&blocks, true).await;
    }
}

/// Waits until the server stops.
async fn stopped(stopping: &mut watch::Receiver<bool>) {
    // A sender that is gone has stopped, too.
    let _ = stopping.wait_for(|stopping| *stopping).await;
}

/// Tells all what this member has.
async fn tell(blocks: &Arc<Blocks>, is_leaving: bool) {
    let looking = Arc::clone(blocks);
    let held = if is_leaving {
        Vec::new()
    } else {
        tokio::task::spawn_blocking(move || looking.held()).await.unwrap_or_default()
    };
    let n_held: usize = held.iter().map(|version| version.held.len()).sum();
    metrics::gauge!("palpate_blocks_held").set(n_held as f64);
    metrics::gauge!("palpate_members").set(blocks.members().all(Vec::new()).len() as f64);
    if let Err(error) = blocks.members().tell(held, is_leaving).await {
        tracing::warn!("The other members do not hear this one: {error}");
    }
}

/// Answers a question of another member.
async fn reply(blocks: Arc<Blocks>, pool: Pool, asked: Asked) {
    let Some(question) = Question::from_bytes(&asked.bytes) else {
        tracing::warn!("A question of another member is not understood");
        return;
    };
    let n = question.items.len();
    let work = move || {
        let Question { catalogue, version, items } = &question;
        let block = |number| Block { catalogue: *catalogue, version: *version, number };
        let requests = items.iter().map(|(number, request)| (block(*number), &request[..]));
        blocks.replies(&requests.collect::<Vec<_>>())
    };
    let replies = match pool.place_in_time().await {
        Ok(place) => place.run_as((Urgency::Reading, Size::Large), work).await.ok(),
        Err(_closed) => None,
    };
    let replies = replies.unwrap_or_else(|| vec![Reply::Overloaded; n]);
    // The asker may have gone.
    let _ = asked.answer.send(answer(&replies));
}

/// Answers a question beyond what this member can do now.
fn refuse(asked: Asked) {
    if let Some(question) = Question::from_bytes(&asked.bytes) {
        let _ = asked.answer.send(answer(&vec![Reply::Overloaded; question.items.len()]));
    }
}
