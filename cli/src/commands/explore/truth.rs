//! The true object of an exploration, and whether a session can answer it.

use palpate_client::Error as ClientError;
use palpate_client::schemas::Session;

use crate::commands::Context;
use crate::verdict::{self, NONE, Verdict};

/// The true object: its name, or none of the catalogue's.
pub(super) struct Truth(Option<String>);

impl Truth {
    /// The truth named on the command line.
    pub(super) fn named(object: &str) -> Self {
        Self((object != NONE).then(|| object.to_owned()))
    }

    /// The truth named on the command line, checked against the session.
    ///
    /// # Errors
    ///
    /// When the version does not have the object, or the method cannot answer "none of these".
    pub(super) async fn told(
        object: &str,
        session: &Session,
        context: &Context,
    ) -> anyhow::Result<Self> {
        if object == NONE {
            verdict::can_answer_none(session.method)?;
            return Ok(Self(None));
        }
        let (catalogue, version) = (&session.catalogue, session.version);
        let objects = context.client.catalogue_version(catalogue, version).await?.report.objects;
        if objects.iter().any(|known| known.name == object) {
            return Ok(Self::named(object));
        }
        Err(verdict::not_trained(object, objects.iter().map(|known| known.name.as_str())))
    }

    /// The object named in a recording. `None`, with a message, if the session's version lacks that
    /// object: the recording may belong to another catalogue.
    pub(super) async fn of_file(
        object: &str,
        session: &Session,
        context: &Context,
    ) -> anyhow::Result<Option<Self>> {
        match Self::told(object, session, context).await {
            Ok(truth) => Ok(Some(truth)),
            Err(error) if error.is::<ClientError>() => Err(error),
            Err(reason) => {
                context.output.say(format!("no verdict: {reason}"));
                Ok(None)
            }
        }
    }

    /// Name of the true object, for people.
    pub(super) fn name(&self) -> &str {
        verdict::name(self.0.as_deref())
    }

    /// Whether a verdict is right.
    pub(super) fn is_told_by(&self, verdict: Verdict<'_>) -> bool {
        verdict.is_right(self.0.as_deref())
    }
}
