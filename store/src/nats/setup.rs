//! Opening: the connection, the servers' version, the stream, and a test of what commits rely on.

use std::time::Duration;

use async_nats::jetstream::context::ContextBuilder;
use async_nats::jetstream::stream::{Config, DiscardPolicy, Info, StorageType};
use async_nats::jetstream::{self, ErrorCode};
use async_nats::{Client, ConnectOptions};
use futures::future::join_all;
use uuid::Uuid;

use super::bucket::Bucket;
use super::message::{Message, encode};
use super::options::NatsOptions;
use super::plan::Outgoing;
use super::publish::{Publisher, Refused};
use crate::engine::opening::OpenError;

/// First version of the servers that has atomic batches.
const VERSION_MIN: (u32, u32) = (2, 12);
/// Copies that survive the loss of a server.
pub(super) const REPLICAS: usize = 3;
/// Bytes of a message's subject and headers, at most.
const HEADERS_BYTES: usize = 2048;
const CONNECT_WITHIN: Duration = Duration::from_secs(10);
/// Time to an answer after which a message is sent again.
pub(super) const ANSWER_WITHIN: Duration = Duration::from_secs(5);
/// Number of messages of the test that claim the same place.
const N_CLAIMS: usize = 8;
/// Time after which messages of the test vanish, as a header has it.
const TEST_TTL: &str = "60s";
/// Attempts to make the stream while a cluster elects its leaders.
const SETUP_ATTEMPTS: u32 = 40;

/// Connects, makes or checks the stream and the bucket, and tests the stream; returns the sequence
/// of the last message.
pub(super) async fn open(options: &NatsOptions) -> Result<(Publisher, Bucket, u64), OpenError> {
    let fault = |fault: String| OpenError::Cluster { servers: options.servers.join(","), fault };
    let client = connect(options).await.map_err(fault)?;
    let info = client.server_info();
    check_version(&info.version).map_err(fault)?;
    let context = ContextBuilder::new().timeout(ANSWER_WITHIN).max_ack_inflight(4096);
    let context = context.build(client);
    let (stream, found) = prepare(&context, options).await.map_err(fault)?;
    report(&found, info.cluster.is_some(), info.connect_urls.len());
    let payload_max = info.max_payload.saturating_sub(HEADERS_BYTES);
    if payload_max < 2 * HEADERS_BYTES {
        return Err(fault(format!("its max_payload is {}, expected 8 KB", info.max_payload)));
    }
    let bucket = Bucket::open(&context, options.bucket(), found.config.num_replicas);
    let bucket = bucket.await.map_err(fault)?;
    let publisher = Publisher::new(context, stream, options.stream.clone(), payload_max);
    let last = test(&publisher).await.map_err(fault)?;
    Ok((publisher, bucket, last))
}

/// A connection to the cluster.
pub(super) async fn connect(options: &NatsOptions) -> Result<Client, String> {
    let mut connecting = ConnectOptions::new().name("palpate").connection_timeout(CONNECT_WITHIN);
    if let Some(file) = &options.credentials {
        let read = connecting.credentials_file(file).await;
        connecting = read.map_err(|error| format!("{}: {error}", file.display()))?;
    }
    if let Some(file) = &options.certificate_authority {
        connecting = connecting.add_root_certificates(file.clone()).require_tls(true);
    }
    if let Some((certificate, key)) = &options.client_certificate {
        connecting = connecting.add_client_certificate(certificate.clone(), key.clone());
    }
    let servers: Result<Vec<async_nats::ServerAddr>, _> =
        options.servers.iter().map(|server| server.parse()).collect();
    let servers = servers.map_err(|error| error.to_string())?;
    connecting.connect(servers).await.map_err(|error| error.to_string())
}

fn check_version(version: &str) -> Result<(), String> {
    let mut numbers = version.split(['.', '-']).map(str::parse::<u32>);
    let found = match (numbers.next(), numbers.next()) {
        (Some(Ok(major)), Some(Ok(minor))) => (major, minor),
        _ => return Err(format!("it has version {version:?}, expected 2.12 or later")),
    };
    if found < VERSION_MIN {
        return Err(format!(
            "it has version {version}, expected 2.12 or later: earlier ones have no atomic \
             batches, and old ones do not check expected sequences in a cluster"
        ));
    }
    Ok(())
}

/// The stream, made if it is missing.
async fn prepare(
    context: &jetstream::Context,
    options: &NatsOptions,
) -> Result<(jetstream::stream::Stream, Info), String> {
    let mut fault = String::new();
    for _ in 0..SETUP_ATTEMPTS {
        match context.get_stream(&options.stream).await {
            Ok(stream) => {
                let info = stream.cached_info().clone();
                check(&info.config, options)?;
                return Ok((stream, info));
            }
            Err(error) => fault = error.to_string(),
        }
        let choices = options.replicas.map_or(vec![REPLICAS, 1], |replicas| vec![replicas]);
        for replicas in choices {
            let made = context.create_stream(config(options, replicas)).await;
            let Err(error) = made else { break };
            fault = error.to_string();
            // Only a server without a cluster has one copy by default.
            let jetstream::context::CreateStreamErrorKind::JetStream(error) = error.kind() else {
                break;
            };
            if error.error_code() != ErrorCode::STREAM_REPLICAS_NOT_SUPPORTED {
                break;
            }
        }
        tokio::time::sleep(ANSWER_WITHIN / 20).await;
    }
    Err(format!("cannot make or find the stream {}: {fault}", options.stream))
}

fn config(options: &NatsOptions, replicas: usize) -> Config {
    Config {
        name: options.stream.clone(),
        description: Some("The store of Palpate".to_owned()),
        subjects: vec![format!("{}.>", options.stream)],
        storage: StorageType::File,
        num_replicas: replicas,
        // What does not fit is refused; nothing old goes.
        discard: DiscardPolicy::New,
        max_bytes: -1,
        max_messages: -1,
        max_messages_per_subject: -1,
        max_consumers: -1,
        allow_rollup: true,
        allow_message_ttl: true,
        allow_atomic_publish: true,
        ..Config::default()
    }
}

/// Checks the stream that was found.
fn check(found: &Config, options: &NatsOptions) -> Result<(), String> {
    let wanted = [
        (found.storage == StorageType::File, "storage: file"),
        (found.allow_atomic_publish, "allow_atomic"),
        (found.allow_rollup, "allow_rollup_hdrs"),
        (found.allow_message_ttl, "allow_msg_ttl"),
        (found.discard == DiscardPolicy::New, "discard: new"),
        (found.max_age.is_zero(), "max_age: 0"),
        (found.max_messages_per_subject <= 0, "max_msgs_per_subject: -1"),
        (found.mirror.is_none() && found.sources.is_none(), "no mirror and no sources"),
        (found.subjects == [format!("{}.>", options.stream)], "the subjects NAME.>"),
    ];
    match wanted.iter().find(|(holds, _)| !holds) {
        None => Ok(()),
        Some((_, what)) => Err(format!("the stream {} lacks {what}", found.name)),
    }
}

/// Says what the cluster lacks.
fn report(info: &Info, is_cluster: bool, n_servers: usize) {
    let (name, replicas) = (&info.config.name, info.config.num_replicas);
    if !is_cluster {
        tracing::warn!(
            "The store is on one NATS server without a cluster: nothing survives the loss of its \
             disk, and there is no service while it is down"
        );
    } else if replicas < REPLICAS {
        tracing::warn!(
            "The stream {name} has {replicas} copies on a cluster of {n_servers} known servers: \
             three survive the loss of one"
        );
    }
    tracing::info!(
        "Store on NATS: stream {name}, {replicas} copies; acknowledged writes survive a power \
         failure only with `sync_interval: always` on every server, which a client cannot check"
    );
}

/// Tests that one of several claims of a place succeeds and that a batch is stored wholly or not.
async fn test(publisher: &Publisher) -> Result<u64, String> {
    // No commit has keys that begin with 0.
    let unit = |number: u8| [&[0, number][..], Uuid::now_v7().as_bytes()].concat();
    let (first, second) = (unit(1), unit(2));
    let claims = (0..N_CLAIMS).map(|_| async { publisher.publish(&[claim(&first)]).await });
    let claims = join_all(claims).await;
    let n_winners = claims.iter().filter(|claim| claim.is_ok()).count();
    if let Some(Err(Refused::NoRoom(detail))) = claims.iter().find(|claim| claim.is_err())
        && n_winners == 0
    {
        return Err(format!("the stream takes no messages: {detail}"));
    }
    if n_winners != 1 {
        return Err(format!(
            "{n_winners} of {N_CLAIMS} messages were stored that expected to be the first of \
             their subject, expected one: {claims:?}"
        ));
    }
    let batch = [claim(&second), claim(&first)];
    if !matches!(publisher.publish(&batch).await, Err(Refused::Changed | Refused::Busy)) {
        return Err("an atomic batch was not refused with a wrong expectation".to_owned());
    }
    // It expects that nothing of the batch was stored.
    let last = publisher.publish(&[claim(&second)]).await;
    last.map_err(|refused| format!("a refused batch was stored in part: {refused:?}"))
}

fn claim(unit: &[u8]) -> Outgoing {
    let (commit, unit) = (Uuid::now_v7(), unit.to_vec());
    let message = Message { commit, part: 0, n_parts: 1, unit, is_whole: true, writes: Vec::new() };
    let payload = encode(&message);
    let (unit, expected, ttl) = (message.unit, Some(0), Some(TEST_TTL));
    Outgoing { unit, expected, is_rollup: true, ttl, payload }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn old_servers_are_refused() {
        for version in ["2.12.0", "2.15.1", "3.0.0", "2.12.0-RC.1"] {
            assert_eq!(check_version(version), Ok(()));
        }
        for version in ["2.9.10", "2.10.29", "2.11.4", "1.4.1", "", "two"] {
            let fault = check_version(version).expect_err(version);
            assert!(fault.contains("expected 2.12"), "{fault}");
        }
    }
}
