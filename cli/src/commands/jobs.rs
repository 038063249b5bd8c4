//! `palpate jobs`: trainings and recalibrations, from this client or others.

use clap::{Args, Subcommand};
use palpate_client::schemas::{Job, PageQuery};
use uuid::Uuid;

use super::{Context, catalogues, train};
use crate::output;

/// Arguments of `palpate jobs`.
#[derive(Debug, Args)]
pub(crate) struct JobsArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// List the jobs.
    List,
    /// Show one job.
    Show {
        /// Id of the job.
        job: Uuid,
    },
    /// Wait for a job and show its progress.
    Follow {
        /// Id of the job.
        job: Uuid,
    },
    /// Cancel a job.
    Cancel {
        /// Id of the job.
        job: Uuid,
    },
    /// Remove an ended job. The version it created stays.
    Remove {
        /// Id of the job.
        job: Uuid,
    },
}

/// Runs the command.
pub(crate) async fn run(args: JobsArgs, context: &Context) -> anyhow::Result<()> {
    let (client, output) = (&context.client, context.output);
    match args.action {
        Action::List => {
            let page = client.jobs(&PageQuery { limit: Some(1000), cursor: None }).await?;
            output.answer(&page, |page| table(&page.items))
        }
        Action::Show { job } => {
            let job = client.job(job).await?;
            output.answer(&job, |job| table(std::slice::from_ref(job)))
        }
        Action::Follow { job } => {
            let job = client.job(job).await?;
            match job.recalibration {
                Some(_) => catalogues::recalibrate::wait(&job, context).await,
                None => train::wait(&job, context).await,
            }
        }
        Action::Cancel { job } => {
            let job = client.cancel_job(job).await?;
            output.answer(&job, |job| table(std::slice::from_ref(job)))
        }
        Action::Remove { job } => {
            client.delete_job(job).await?;
            output.answer(&(), |()| format!("removed job {job}"))
        }
    }
}

fn table(jobs: &[Job]) -> String {
    output::table(
        ["id", "catalogue", "state", "progress", "version", "created", "reason"],
        jobs.iter().map(|job| {
            [
                job.id.to_string(),
                job.catalogue.clone(),
                job.state.name().to_owned(),
                if job.total > 0 { format!("{}/{}", job.done, job.total) } else { String::new() },
                job.version.map(|version| version.to_string()).unwrap_or_default(),
                job.created_at.clone(),
                job.reason.clone().unwrap_or_default(),
            ]
        }),
    )
}
