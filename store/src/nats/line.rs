//! The line of servers on a cluster: core NATS messages, which no stream stores.
//!
//! Messages to all have one subject; each server has one for its questions, and one inbox for
//! their answers. A connection of its own keeps long answers from delaying commits. Who may
//! speak on these subjects is the cluster's decision.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use async_nats::{Client, Message, StatusCode, Subscriber};
use futures::StreamExt;
use tokio::sync::{mpsc, oneshot};
use uuid::Uuid;

use super::frames::{Frame, Gathering, Kind, frames};
use super::options::{NatsOptions, SPOKEN};
use super::setup::connect;
use crate::engine::line::{
    Asking, Line, LineError, MESSAGE_BYTES_MAX, Patience, Question, Speaker, Telling,
};

/// Number of messages to all that may wait. Chosen: far more than servers tell in a second.
const TOLD_MAX: usize = 1024;
/// Number of questions that may wait for this server. Chosen: more than it works on at a time.
const QUESTIONS_MAX: usize = 64;

/// Opens the line of a store's servers for the one with `id`.
pub(super) async fn open(options: &NatsOptions, id: Uuid) -> Result<Line, String> {
    let client = connect(options).await?;
    let subjects = Subjects(format!("{SPOKEN}.{}", options.stream));
    let fault = |error: async_nats::SubscribeError| error.to_string();
    let heard = client.subscribe(subjects.all()).await.map_err(fault)?;
    let asked = client.subscribe(subjects.of(id)).await.map_err(fault)?;
    let inbox = client.new_inbox();
    let answers = client.subscribe(format!("{inbox}.*")).await.map_err(fault)?;
    client.flush().await.map_err(|error| error.to_string())?;
    let waiting = Arc::new(Waiting::default());
    let (tell, told) = mpsc::channel(TOLD_MAX);
    let (ask, questions) = mpsc::channel(QUESTIONS_MAX);
    tokio::spawn(hear(heard, tell));
    tokio::spawn(take_questions(client.clone(), asked, ask));
    tokio::spawn(take_answers(answers, Arc::clone(&waiting)));
    let speaker = Arc::new(NatsSpeaker { client, subjects, inbox, waiting });
    Ok(Line { told, questions, speaker })
}

/// The subjects of a store's servers.
#[derive(Clone, Debug)]
struct Subjects(String);

impl Subjects {
    fn all(&self) -> String {
        format!("{}.all", self.0)
    }

    fn of(&self, server: Uuid) -> String {
        format!("{}.ask.{}", self.0, server.simple())
    }
}

#[derive(Debug)]
struct NatsSpeaker {
    client: Client,
    subjects: Subjects,
    inbox: String,
    waiting: Arc<Waiting>,
}

impl Speaker for NatsSpeaker {
    fn tell(&self, message: Vec<u8>) -> Telling {
        let (client, subject) = (self.client.clone(), self.subjects.all());
        Box::pin(async move {
            let max = client.max_payload();
            if message.len() > max {
                return Err(LineError::TooLarge { found: message.len(), max });
            }
            client.publish(subject, message.into()).await.map_err(failed)
        })
    }

    fn ask(&self, server: Uuid, question: Vec<u8>, patience: Patience) -> Asking {
        let (client, subject) = (self.client.clone(), self.subjects.of(server));
        let (inbox, waiting) = (self.inbox.clone(), Arc::clone(&self.waiting));
        Box::pin(async move {
            let id = Uuid::now_v7();
            let sent = frames(Kind::Question, id, &question, client.max_payload())?;
            drop(question);
            let (taken, is_taken) = oneshot::channel();
            let (done, is_done) = oneshot::channel();
            let _entry = Entry::new(&waiting, id, taken, done);
            let reply = format!("{inbox}.{}", id.simple());
            let asking = async {
                for frame in sent {
                    let sent =
                        client.publish_with_reply(subject.clone(), reply.clone(), frame.into());
                    sent.await.map_err(failed)?;
                }
                let mut is_done = is_done;
                let silent = tokio::time::sleep(patience.taken);
                tokio::select! {
                    biased;
                    answer = &mut is_done => return answer.unwrap_or_else(|_| Err(gone())),
                    taken = is_taken => if taken.is_err() {
                        return is_done.await.unwrap_or_else(|_| Err(gone()));
                    },
                    () = silent => return Err(LineError::Silent),
                }
                is_done.await.unwrap_or_else(|_| Err(gone()))
            };
            tokio::time::timeout(patience.answered, asking).await.unwrap_or(Err(LineError::Late))
        })
    }
}

fn failed(error: impl std::fmt::Display) -> LineError {
    LineError::Failed { detail: error.to_string() }
}

fn gone() -> LineError {
    LineError::Failed { detail: "it was closed".to_owned() }
}

/// An answer, as soon as it is known.
type Done = oneshot::Sender<Result<Vec<u8>, LineError>>;

/// What an asker waits for.
#[derive(Debug)]
struct Asker {
    /// Told that the other server has the question.
    taken: Option<oneshot::Sender<()>>,
    done: Done,
}

/// Questions that wait for their answers.
#[derive(Debug, Default)]
struct Waiting(Mutex<HashMap<Uuid, Asker>>);

impl Waiting {
    fn lock(&self) -> MutexGuard<'_, HashMap<Uuid, Asker>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn is_waited_for(&self, id: Uuid) -> bool {
        self.lock().contains_key(&id)
    }

    fn take(&self, id: Uuid) {
        if let Some(taken) = self.lock().get_mut(&id).and_then(|asker| asker.taken.take()) {
            // The asker may have gone.
            let _ = taken.send(());
        }
    }

    fn end(&self, id: Uuid, answer: Result<Vec<u8>, LineError>) {
        let ended = self.lock().remove(&id);
        if let Some(Asker { taken, done }) = ended {
            // The answer goes first, so that its taker needs no other word.
            let _ = done.send(answer);
            drop(taken);
        }
    }
}

/// A question's place among those that wait, which ends with the asker.
struct Entry<'waiting>(&'waiting Waiting, Uuid);

impl<'waiting> Entry<'waiting> {
    fn new(waiting: &'waiting Waiting, id: Uuid, taken: oneshot::Sender<()>, done: Done) -> Self {
        waiting.lock().insert(id, Asker { taken: Some(taken), done });
        Self(waiting, id)
    }
}

impl Drop for Entry<'_> {
    fn drop(&mut self) {
        self.0.lock().remove(&self.1);
    }
}

/// Hands on what servers tell all, until nobody hears it.
async fn hear(mut heard: Subscriber, tell: mpsc::Sender<Vec<u8>>) {
    while let Some(message) = heard.next().await {
        match tell.try_send(message.payload.to_vec()) {
            // Servers repeat what they tell.
            Ok(()) | Err(mpsc::error::TrySendError::Full(_)) => {}
            Err(mpsc::error::TrySendError::Closed(_)) => return,
        }
    }
}

/// Hands questions on and sends their answers, until nobody takes questions.
async fn take_questions(client: Client, mut asked: Subscriber, ask: mpsc::Sender<Question>) {
    let mut gathering = Gathering::default();
    while let Some(message) = asked.next().await {
        let Message { payload, reply: Some(reply), .. } = message else { continue };
        let Some(frame) = Frame::parse(&payload) else { continue };
        let id = frame.id;
        let Some(bytes) = gathering.add(&frame, Instant::now()) else { continue };
        let (answer, answered) = oneshot::channel();
        let kind = match ask.try_send(Question { bytes, answer }) {
            Ok(()) => Kind::Taken,
            Err(mpsc::error::TrySendError::Full(_)) => Kind::Busy,
            Err(mpsc::error::TrySendError::Closed(_)) => return,
        };
        let (client, reply) = (client.clone(), reply.to_string());
        tokio::spawn(async move {
            send(&client, &reply, kind, id, &[]).await;
            if let (Kind::Taken, Ok(answer)) = (kind, answered.await) {
                send(&client, &reply, Kind::Answer, id, &answer).await;
            }
        });
    }
}

/// Sends a message to an asker; one that cannot be sent is missed when the asker's patience ends.
async fn send(client: &Client, reply: &str, kind: Kind, id: Uuid, content: &[u8]) {
    let max = client.max_payload();
    let length = (content.len() as u64).to_le_bytes();
    let sent = frames(kind, id, content, max).or_else(|_| frames(Kind::TooLarge, id, &length, max));
    for frame in sent.unwrap_or_default() {
        if let Err(error) = client.publish(reply.to_owned(), frame.into()).await {
            tracing::debug!("Cannot answer another server: {error}");
            return;
        }
    }
}

/// Hands answers to those who asked.
async fn take_answers(mut answers: Subscriber, waiting: Arc<Waiting>) {
    let mut gathering = Gathering::default();
    while let Some(message) = answers.next().await {
        if message.status == Some(StatusCode::NO_RESPONDERS) {
            let id = message.subject.rsplit('.').next().and_then(|id| Uuid::try_parse(id).ok());
            if let Some(id) = id {
                waiting.end(id, Err(LineError::Nobody));
            }
            continue;
        }
        let Some(frame) = Frame::parse(&message.payload) else { continue };
        if !waiting.is_waited_for(frame.id) {
            continue;
        }
        match frame.kind {
            Kind::Question => {}
            Kind::Taken => waiting.take(frame.id),
            Kind::Busy => waiting.end(frame.id, Err(LineError::Busy)),
            Kind::TooLarge => {
                let (found, max) = (frame.length(), MESSAGE_BYTES_MAX);
                waiting.end(frame.id, Err(LineError::TooLarge { found, max }));
            }
            Kind::Answer => {
                // Whose answer comes has taken the question.
                waiting.take(frame.id);
                if let Some(answer) = gathering.add(&frame, Instant::now()) {
                    waiting.end(frame.id, Ok(answer));
                }
            }
        }
    }
}
