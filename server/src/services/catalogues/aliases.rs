//! Labels of catalogues, names of versions besides the current one, such as `candidate`, and the version
//! that a new session gets.

use palpate_schemas as wire;
use palpate_store::catalogue::Catalogue;
use palpate_store::error::StoreError;
use palpate_store::model_codec::ModelPart;

use super::{CatalogueError, Catalogues, DEFAULT, Pinned};
use crate::cause::Cause;
use crate::wire::{self as convert, Invalid, labels};

/// Maximum number of aliases of a catalogue. Chosen: far more than stages of a release.
const ALIASES_MAX: usize = 16;
/// Maximum number of catalogues that an error names. Chosen: what fits a line.
const NAMED_MAX: usize = 8;
/// The name of the current version, which is set by itself.
const CURRENT: &str = "current";

impl Catalogues {
    /// Replaces a catalogue's labels.
    pub(crate) async fn label(
        &self,
        name: &str,
        asked: &wire::SetLabels,
    ) -> Result<Catalogue, Cause> {
        let catalogue = self.find(name)?;
        labels::checked(&asked.labels)?;
        let changed = self.table.update(catalogue.id, |now| {
            now.labels.clone_from(&asked.labels);
            Ok::<(), StoreError>(())
        });
        Ok(changed.await??)
    }

    /// Lets an alias name a version.
    pub(crate) async fn set_alias(
        &self,
        name: &str,
        alias: &str,
        version: u32,
    ) -> Result<Catalogue, CatalogueError> {
        let _using = self.using().await;
        let catalogue = self.find(name)?;
        // The alias stands in the path: a wrong one is named like a field of the request.
        convert::name(alias).map_err(|Invalid(mut errors)| {
            errors.iter_mut().for_each(|error| "/alias".clone_into(&mut error.pointer));
            Invalid(errors)
        })?;
        if alias == CURRENT || alias.chars().all(|c| c.is_ascii_digit()) {
            let detail =
                format!("came {alias:?}, expected a name other than `current` and numbers");
            return Err(Cause::field("/alias", detail).into());
        }
        self.manifest(&catalogue, version).map_err(|error| Cause::field("/version", error))?;
        let changed = self.table.update(catalogue.id, |now| {
            if now.aliases.len() >= ALIASES_MAX && !now.aliases.contains_key(alias) {
                let detail =
                    format!("the catalogue has {ALIASES_MAX} aliases, which is the maximum");
                return Err(Cause::field("/alias", detail));
            }
            now.aliases.insert(alias.to_owned(), version);
            Ok(())
        });
        let catalogue = changed.await??;
        tracing::info!("Alias {alias:?} of catalogue {name:?} names version {version} now");
        Ok(catalogue)
    }

    /// Removes an alias.
    pub(crate) async fn remove_alias(&self, name: &str, alias: &str) -> Result<(), Cause> {
        let catalogue = self.find(name)?;
        let changed = self.table.update(catalogue.id, |now| match now.aliases.remove(alias) {
            Some(_) => Ok(()),
            None => Err(Cause::unknown("alias", alias)),
        });
        changed.await??;
        Ok(())
    }

    /// The version for a new session: that of the requested number or alias, or the current one.
    pub(crate) fn pin(
        &self,
        name: &str,
        version: Option<u32>,
        alias: Option<&str>,
    ) -> Result<Pinned, CatalogueError> {
        let catalogue = self.table.find_by_name(name)?;
        let Some(catalogue) = catalogue else { return Err(self.unknown(name)?) };
        let manifest = match (version, alias) {
            (Some(_), Some(_)) => {
                let detail = "came with `version`, expected one of the two";
                return Err(Cause::field("/alias", detail).into());
            }
            (Some(version), None) => self
                .manifest(&catalogue, version)
                .map_err(|error| Cause::field("/version", error))?,
            (None, Some(alias)) => {
                let named = catalogue.aliases.get(alias).copied();
                let detail = || format!("catalogue {name:?} has no alias {alias:?}");
                let version = named.ok_or_else(|| Cause::field("/alias", detail()))?;
                self.manifest(&catalogue, version)?
            }
            (None, None) => {
                let current = catalogue.current;
                let untrained = || CatalogueError::Untrained { catalogue: name.to_owned() };
                self.manifest(&catalogue, current.ok_or_else(untrained)?)?
            }
        };
        let has_surfaces = manifest.has(ModelPart::Surface);
        Ok(Pinned { catalogue: catalogue.id, version: manifest.version, has_surfaces })
    }

    /// The error for a catalogue that does not exist. It names some of those that do.
    fn unknown(&self, name: &str) -> Result<CatalogueError, CatalogueError> {
        if name == DEFAULT {
            return Ok(CatalogueError::Untrained { catalogue: name.to_owned() });
        }
        let page = self.table.list(None, NAMED_MAX)?;
        let names: Vec<&str> = page.items.iter().map(|catalogue| &*catalogue.name).collect();
        let known = match names[..] {
            [] => "none is trained".to_owned(),
            _ if page.next.is_some() => format!("there are {} and others", names.join(", ")),
            _ => format!("expected one of {}", names.join(", ")),
        };
        Ok(Cause::field("/catalogue", format!("there is no catalogue {name:?}: {known}")).into())
    }
}
