//! Tests of the line of servers that share a cluster: what they tell, ask and answer.

use std::time::Duration;

use palpate_store::engine::Engine;
use palpate_store::engine::line::{Line, LineError, MESSAGE_BYTES_MAX, Patience};
use palpate_store::memory::MemoryEngine;
use palpate_store::nats::NatsEngine;
use uuid::Uuid;

use crate::cluster::store;

const PATIENCE: Patience =
    Patience { taken: Duration::from_secs(5), answered: Duration::from_secs(20) };

async fn open(engine: &NatsEngine, id: u128) -> Line {
    engine.line(Uuid::from_u128(id)).await.unwrap().expect("the store is shared")
}

#[tokio::test(flavor = "multi_thread")]
async fn servers_hear_each_other_and_answer_questions() {
    let Some(store) = store() else { return };
    let engine = tokio::task::spawn_blocking(move || (store.open(), store)).await.unwrap();
    let (mut one, mut two) = (open(&engine.0, 1).await, open(&engine.0, 2).await);
    // A NATS server drops a message while it does not know yet that another one has a listener, so
    // the word is repeated.
    let telling = async {
        loop {
            one.speaker.tell(b"here".to_vec()).await.unwrap();
            tokio::time::sleep(Duration::from_millis(200)).await;
        }
    };
    let hearing = async {
        for told in [&mut one.told, &mut two.told] {
            let told = tokio::time::timeout(PATIENCE.answered, told.recv()).await.unwrap();
            assert_eq!(told.as_deref(), Some(&b"here"[..]));
        }
    };
    tokio::select! {
        () = telling => {}
        () = hearing => {}
    }
    // Three and a half frames of the servers' largest payload, and nothing.
    for length in [3_670_016, 0] {
        let question: Vec<u8> = (0..length).map(|n: u32| n as u8).collect();
        let asking = one.speaker.ask(Uuid::from_u128(2), question.clone(), PATIENCE);
        let answering = async {
            let asked = two.questions.recv().await.unwrap();
            let reversed = asked.bytes.into_iter().rev().collect();
            asked.answer.send(reversed).unwrap();
        };
        let (answer, ()) = tokio::join!(asking, answering);
        let expected: Vec<u8> = question.into_iter().rev().collect();
        assert!(answer.unwrap() == expected, "another answer to {length} bytes");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_question_without_an_answer_says_why() {
    let Some(store) = store() else { return };
    let engine = tokio::task::spawn_blocking(move || (store.open(), store)).await.unwrap();
    let (one, mut two) = (open(&engine.0, 1).await, open(&engine.0, 2).await);
    let ask = |id, question, patience| one.speaker.ask(Uuid::from_u128(id), question, patience);
    assert_eq!(ask(3, b"?".to_vec(), PATIENCE).await, Err(LineError::Nobody));
    let (found, max) = (MESSAGE_BYTES_MAX + 1, MESSAGE_BYTES_MAX);
    let long = ask(2, vec![0; found], PATIENCE).await;
    assert_eq!(long, Err(LineError::TooLarge { found, max }));
    let short = Patience { answered: Duration::from_millis(300), ..PATIENCE };
    assert_eq!(ask(2, b"?".to_vec(), short).await, Err(LineError::Late));
    let answering = async {
        two.questions.recv().await.unwrap();
        let asked = two.questions.recv().await.unwrap();
        asked.answer.send(vec![0; found]).unwrap();
    };
    let (answer, ()) = tokio::join!(ask(2, b"!".to_vec(), PATIENCE), answering);
    assert_eq!(answer, Err(LineError::TooLarge { found, max }));
    // Questions that nobody takes up fill their queue, and are refused then.
    let hasty = Patience { answered: Duration::from_millis(500), ..PATIENCE };
    let asked = (0..300).map(|_| ask(2, b"?".to_vec(), hasty));
    let answers = futures::future::join_all(asked).await;
    let n_busy = answers.iter().filter(|answer| **answer == Err(LineError::Busy)).count();
    assert_eq!(n_busy, 300 - 64, "{answers:?}");
}

#[tokio::test]
async fn a_store_of_one_process_has_no_line() {
    let line = MemoryEngine::new().line(Uuid::nil()).await.unwrap();
    assert!(line.is_none());
    let Some(store) = store() else { return };
    let mut options = store.options.clone();
    options.is_shared = false;
    let engine = tokio::task::spawn_blocking(move || NatsEngine::open(&options)).await.unwrap();
    let engine = engine.unwrap();
    assert!(engine.line(Uuid::nil()).await.unwrap().is_none());
    tokio::task::spawn_blocking(move || drop(engine)).await.unwrap();
}
