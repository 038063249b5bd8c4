//! Questions to several members at once: one message to each with all its blocks, the first copy
//! first.
//!
//! When a member cannot answer or takes long, the next holder of its block is asked as well. The
//! first answer counts: all answers are equal bit for bit.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant};

use futures::StreamExt;
use futures::stream::FuturesUnordered;
use palpate_store::engine::line::{LineError, Patience, Speaker};
use uuid::Uuid;

use super::words::{Reply, question, replies};

/// Number of blocks in one message, and bytes of their requests. Chosen: long messages delay others.
const BLOCKS_PER_MESSAGE: usize = 64;
const BYTES_PER_MESSAGE: usize = 8 << 20;

/// How long an asker waits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pace {
    /// Until a member says that it has a question.
    pub(super) taken: Duration,
    /// Until the next member is asked as well.
    pub(super) patient: Duration,
    /// For all answers.
    pub(super) within: Duration,
}

impl Pace {
    /// The usual pace, with a time for all answers. Chosen: a hundred times what a message takes,
    /// and far more than an answer usually takes.
    pub(super) fn usual(within: Duration) -> Self {
        Self { taken: Duration::from_millis(500), patient: Duration::from_secs(1), within }
    }
}

/// A request to one block, and the members to ask in turn.
#[derive(Clone, Debug)]
pub(super) struct Request {
    pub(super) block: u32,
    pub(super) bytes: Arc<Vec<u8>>,
    pub(super) candidates: VecDeque<Uuid>,
}

/// Asks for blocks of a version until all have answered, no member is left to ask, or the time is up.
/// One result per request, in their order. `lost` hears of members that no longer listen.
pub(super) async fn gather(
    speaker: &dyn Speaker,
    version: (Uuid, u32),
    mut requests: Vec<Request>,
    pace: Pace,
    lost: impl Fn(Uuid),
) -> Vec<Option<Vec<u8>>> {
    let end = Instant::now() + pace.within;
    let n = requests.len();
    let (mut answers, mut n_asked) = (vec![None; n], vec![0_usize; n]);
    let mut ready: Vec<usize> = (0..n).collect();
    let (mut under_way, mut slow) = (FuturesUnordered::new(), FuturesUnordered::new());
    let time_is_up = tokio::time::sleep(pace.within);
    tokio::pin!(time_is_up);
    loop {
        for (member, places) in messages(&mut requests, &std::mem::take(&mut ready)) {
            places.iter().for_each(|place| n_asked[*place] += 1);
            let item = |place: &usize| (requests[*place].block, &requests[*place].bytes[..]);
            let items: Vec<(u32, &[u8])> = places.iter().map(item).collect();
            let asked = question(version, &items);
            let answered = end.saturating_duration_since(Instant::now());
            let asking = speaker.ask(member, asked, Patience { taken: pace.taken, answered });
            let later = places.clone();
            under_way.push(async move { (member, places, asking.await) });
            slow.push(async move {
                tokio::time::sleep(pace.patient).await;
                later
            });
        }
        if under_way.is_empty() || answers.iter().all(Option::is_some) {
            return answers;
        }
        tokio::select! {
            Some((member, places, outcome)) = under_way.next() => {
                if outcome == Err(LineError::Nobody) {
                    lost(member);
                }
                for (place, reply) in places.iter().zip(understood(outcome, places.len(), member)) {
                    n_asked[*place] -= 1;
                    match reply {
                        Some(answer) if answers[*place].is_none() => answers[*place] = Some(answer),
                        None if answers[*place].is_none() && n_asked[*place] == 0 => ready.push(*place),
                        _ => {}
                    }
                }
            }
            Some(places) = slow.next() => {
                ready.extend(places.into_iter().filter(|place| answers[*place].is_none()));
            }
            () = &mut time_is_up => return answers,
        }
    }
}

/// The next members to ask, each with the places of its requests.
fn messages(requests: &mut [Request], places: &[usize]) -> Vec<(Uuid, Vec<usize>)> {
    let mut by_member: BTreeMap<Uuid, Vec<usize>> = BTreeMap::new();
    for &place in places {
        if let Some(member) = requests[place].candidates.pop_front() {
            by_member.entry(member).or_default().push(place);
        }
    }
    let mut messages = Vec::new();
    for (member, places) in by_member {
        let (mut some, mut bytes) = (Vec::new(), 0);
        for place in places {
            let more = requests[place].bytes.len();
            if some.len() == BLOCKS_PER_MESSAGE || (bytes + more > BYTES_PER_MESSAGE && bytes > 0) {
                messages.push((member, std::mem::take(&mut some)));
                bytes = 0;
            }
            some.push(place);
            bytes += more;
        }
        messages.push((member, some));
    }
    messages
}

/// The answers of a member to `n` requests, `None` for each that it does not answer.
fn understood(outcome: Result<Vec<u8>, LineError>, n: usize, member: Uuid) -> Vec<Option<Vec<u8>>> {
    let (kind, answers) = match outcome {
        Ok(bytes) => match replies(&bytes, n) {
            Some(replies) => ("answered", replies.into_iter().map(answer_of).collect()),
            None => ("not_understood", vec![None; n]),
        },
        Err(error) => {
            tracing::debug!(member.id = %member, "Member {member} did not answer: {error}");
            (outcome_of(&error), vec![None; n])
        }
    };
    metrics::counter!("palpate_member_questions_total", "outcome" => kind).increment(1);
    answers
}

fn answer_of(reply: Reply) -> Option<Vec<u8>> {
    let kind = match reply {
        Reply::Answer(answer) => return Some(answer),
        Reply::NotHeld => "not_held",
        Reply::NotUnderstood => "not_understood",
        Reply::Overloaded => "overloaded",
    };
    metrics::counter!("palpate_member_blocks_refused_total", "reason" => kind).increment(1);
    None
}

fn outcome_of(error: &LineError) -> &'static str {
    match error {
        LineError::Nobody => "gone",
        LineError::Silent => "silent",
        LineError::Late => "late",
        LineError::Busy => "busy",
        LineError::TooLarge { .. } => "too_large",
        LineError::Failed { .. } => "failed",
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use palpate_store::engine::line::{Asking, Telling};

    use super::super::words::{Question, answer};
    use super::*;

    const PACE: Pace = Pace {
        taken: Duration::from_millis(40),
        patient: Duration::from_millis(40),
        within: Duration::from_secs(10),
    };

    /// What a member does with a question.
    #[derive(Clone, Copy, Debug)]
    enum Way {
        Answers,
        AnswersLate,
        HoldsOnly(u32),
        Gone,
        Sleeps,
    }

    /// Members by number, and the questions that they got.
    #[derive(Debug)]
    struct Stage(Vec<Way>, Mutex<Vec<(u128, Vec<u32>)>>);

    impl Speaker for Stage {
        fn tell(&self, _message: Vec<u8>) -> Telling {
            Box::pin(std::future::ready(Ok(())))
        }

        fn ask(&self, server: Uuid, question: Vec<u8>, patience: Patience) -> Asking {
            let question = Question::from_bytes(&question).expect("it is a question");
            let blocks: Vec<u32> = question.items.iter().map(|(block, _)| *block).collect();
            self.1.lock().unwrap().push((server.as_u128(), blocks.clone()));
            let way = self.0[server.as_u128() as usize];
            Box::pin(async move {
                let reply = |block: &u32| match way {
                    Way::HoldsOnly(held) if held != *block => Reply::NotHeld,
                    _ => Reply::Answer(vec![*block as u8]),
                };
                match way {
                    Way::Gone => return Err(LineError::Nobody),
                    Way::Sleeps => {
                        tokio::time::sleep(patience.taken).await;
                        return Err(LineError::Silent);
                    }
                    Way::AnswersLate => tokio::time::sleep(10 * PACE.patient).await,
                    Way::Answers | Way::HoldsOnly(_) => {}
                }
                Ok(answer(&blocks.iter().map(reply).collect::<Vec<_>>()))
            })
        }
    }

    fn request(block: u32, candidates: &[u128]) -> Request {
        let candidates = candidates.iter().copied().map(Uuid::from_u128).collect();
        Request { block, bytes: Arc::new(vec![0; 10]), candidates }
    }

    async fn asked(
        ways: &[Way],
        requests: Vec<Request>,
    ) -> (Vec<Option<Vec<u8>>>, Vec<(u128, Vec<u32>)>, Vec<u128>) {
        let (stage, lost) = (Stage(ways.to_vec(), Mutex::default()), Mutex::new(Vec::new()));
        let version = (Uuid::nil(), 1);
        let note = |member: Uuid| lost.lock().unwrap().push(member.as_u128());
        let answers = gather(&stage, version, requests, PACE, note).await;
        (answers, stage.1.into_inner().unwrap(), lost.into_inner().unwrap())
    }

    #[tokio::test]
    async fn each_member_gets_one_message_with_all_its_blocks() {
        let requests = vec![request(0, &[0]), request(1, &[1]), request(2, &[0])];
        let (answers, questions, _) = asked(&[Way::Answers; 2], requests).await;
        assert_eq!(answers, [0, 1, 2].map(|block| Some(vec![block])));
        assert_eq!(questions, [(0, vec![0, 2]), (1, vec![1])]);
    }

    #[tokio::test]
    async fn the_next_copy_answers_for_one_that_is_gone_or_asleep() {
        for (first, n_lost) in [(Way::Gone, 1), (Way::Sleeps, 0), (Way::HoldsOnly(9), 0)] {
            let (answers, questions, lost) =
                asked(&[first, Way::Answers], vec![request(3, &[0, 1])]).await;
            assert_eq!(answers, [Some(vec![3])]);
            assert_eq!((questions.len(), lost.len()), (2, n_lost));
        }
    }

    #[tokio::test]
    async fn a_slow_member_is_not_waited_for_where_another_answers() {
        let requests = vec![request(3, &[0, 1])];
        let (answers, questions, _) = asked(&[Way::AnswersLate, Way::Answers], requests).await;
        assert_eq!(answers, [Some(vec![3])]);
        assert_eq!(questions, [(0, vec![3]), (1, vec![3])], "asked before the first one answered");
        let (answers, ..) = asked(&[Way::AnswersLate], vec![request(3, &[0])]).await;
        assert_eq!(answers, [Some(vec![3])], "nobody else has it");
    }

    #[tokio::test]
    async fn blocks_that_nobody_has_stay_without_an_answer() {
        let requests = vec![request(0, &[0, 1]), request(1, &[0, 1]), request(2, &[])];
        let (answers, ..) = asked(&[Way::HoldsOnly(1), Way::Gone], requests).await;
        assert_eq!(answers, [None, Some(vec![1]), None]);
    }

    #[tokio::test]
    async fn many_blocks_are_split_into_messages() {
        let requests = (0..150).map(|block| request(block, &[0])).collect();
        let (answers, questions, _) = asked(&[Way::Answers], requests).await;
        assert!(answers.iter().all(Option::is_some));
        let sizes: Vec<usize> = questions.iter().map(|(_, blocks)| blocks.len()).collect();
        assert_eq!(sizes, [64, 64, 22]);
    }
}
