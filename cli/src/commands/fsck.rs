//! `palpate fsck`: checks a folder of stored data for damage.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use palpate_store::engine::Engine;
use palpate_store::fsck::{Finding, Report, Severity, check, collect};
use palpate_store::sled::{OnDamage, SledEngine, SledOptions};
use serde_json::{Value, json};

use crate::exit::Ended;
use crate::output::Output;

/// Arguments of `palpate fsck`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  palpate fsck --data /var/lib/palpate\n  \
    palpate fsck --data /var/lib/palpate --collect\n\nExit codes: 0 no damage, 1 not \
    checked, 5 damage found.")]
pub(crate) struct FsckArgs {
    /// Folder to check, which no server may have open.
    #[arg(long, env = "PALPATE_DATA", value_name = "DIR")]
    data: PathBuf,
    /// Remove unreferenced records, which crashes leave behind.
    #[arg(long)]
    collect: bool,
    /// Accept the present data as complete although commits or records are missing. What is lost
    /// stays lost, and a server starts again.
    #[arg(long, conflicts_with = "collect")]
    accept: bool,
}

/// Runs the command.
pub(crate) async fn run(args: FsckArgs, output: Output) -> anyhow::Result<()> {
    let FsckArgs { data, collect: collects, accept } = args;
    require_data(&data)?;
    let work = move || checked(&data, collects, accept);
    let (answer, is_whole) = tokio::task::spawn_blocking(work).await??;
    output.answer(&answer, words)?;
    if is_whole { Ok(()) } else { Err(Ended::Damaged.into()) }
}

/// Refuses a folder without stored data, which the engine would otherwise initialise.
pub(crate) fn require_data(data: &Path) -> anyhow::Result<()> {
    if !data.join("sled").join("db").is_file() && !data.join("current").is_file() {
        bail!("{} holds no stored data: there is no sled/db and no current in it", data.display());
    }
    Ok(())
}

fn checked(data: &Path, collects: bool, accept: bool) -> anyhow::Result<(Value, bool)> {
    let on_damage = if accept { OnDamage::Accept } else { OnDamage::Inspect };
    let engine = SledEngine::open(data, &SledOptions { on_damage, ..SledOptions::default() })?;
    let lost = engine.damage().map(ToString::to_string);
    let report = check(&engine)?;
    let n_collected = match collects {
        true => {
            if let Some(lost) = &lost {
                bail!("{lost}: nothing is removed");
            }
            futures::executor::block_on(collect(&engine, &report))?
        }
        false => 0,
    };
    let bytes = engine.stats().context("cannot measure the folder")?.bytes;
    let is_accepted = accept && lost.is_some();
    let is_whole = (lost.is_none() || is_accepted) && report.n_damaged == 0;
    let answer = json!({
        "whole": is_whole,
        "layout": report.layout,
        "bytes": bytes,
        "lost": lost,
        "accepted": is_accepted,
        "records": report.records,
        "n_damaged": report.n_damaged,
        "n_leftovers": report.n_leftovers,
        "n_collected": n_collected,
        "findings": findings(&report),
    });
    Ok((answer, is_whole))
}

/// Findings as JSON.
pub(crate) fn findings(report: &Report) -> Vec<Value> {
    let finding = |found: &Finding| {
        let severity = match found.severity {
            Severity::Damage => "damage",
            Severity::Leftover => "leftover",
        };
        json!({"severity": severity, "space": found.space, "key": found.key,
            "fault": found.fault, "means": found.means})
    };
    report.findings.iter().map(finding).collect()
}

/// The answer for people.
pub(crate) fn words(answer: &Value) -> String {
    let mut lines = Vec::new();
    if let Some(lost) = answer["lost"].as_str() {
        lines.push(format!("damaged: {lost}"));
    }
    if answer["accepted"] == json!(true) {
        lines.push("accepted: what is there is the whole from now on".to_owned());
    }
    for finding in answer["findings"].as_array().into_iter().flatten() {
        let word = |field: &str| finding[field].as_str().unwrap_or_default();
        let (severity, space, key) = (word("severity"), word("space"), word("key"));
        let (fault, means) = (word("fault"), word("means"));
        lines.push(format!("{severity}: {space} {key}: {fault}; it means: {means}"));
    }
    let n_records: u64 = answer["records"]
        .as_object()
        .map_or(0, |records| records.values().filter_map(Value::as_u64).sum());
    let (n_damaged, n_leftovers) = (&answer["n_damaged"], &answer["n_leftovers"]);
    lines.push(format!("{n_records} records, {n_damaged} damaged, {n_leftovers} leftovers"));
    if let Some(n @ 1..) = answer["n_collected"].as_u64() {
        lines.push(format!("removed {n} leftovers"));
    }
    lines.join("\n")
}
