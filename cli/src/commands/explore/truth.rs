//! What was touched, as far as the command line or a file says, and whether a session can be
//! right about it.

use palpate_client::Error as ClientError;
use palpate_client::schemas::Session;

use crate::commands::Context;
use crate::verdict::{self, NONE, Verdict};

/// What was touched: an object's name, or none of the catalogue's.
pub(super) struct Truth(Option<String>);

impl Truth {
    /// The truth by its name on the command line.
    pub(super) fn named(object: &str) -> Self {
        Self((object != NONE).then(|| object.to_owned()))
    }

    /// The truth that the command line says, when the session can be right about it.
    ///
    /// # Errors
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

    /// The object that a recording names. `None`, with a message, when the session's version
    /// lacks that object: the recording may belong to another catalogue.
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

    /// What was touched, for people.
    pub(super) fn name(&self) -> &str {
        verdict::name(self.0.as_deref())
    }

    /// Whether a verdict says it.
    pub(super) fn is_told_by(&self, verdict: Verdict<'_>) -> bool {
        verdict.is_right(self.0.as_deref())
    }
}
