//! Reports on a version's appearance, from held-out readings.

use palpate_schemas as wire;
use palpate_store::model_codec::{APPEARANCE_BLOCK, ModelPart};

use super::error::CatalogueError;
use super::{Catalogues, number};
use crate::wire::appearance;

impl Catalogues {
    /// The report of a version's appearance.
    pub(crate) async fn appearance_report(
        &self,
        name: &str,
        version: &str,
    ) -> Result<wire::AppearanceReport, CatalogueError> {
        let catalogue = self.find(name)?;
        let manifest = self.manifest(&catalogue, number(version)?)?;
        let model = self.load(catalogue.id, manifest.version, ModelPart::Appearance).await?;
        let trained = model.appearance()?;
        let block = manifest.blocks.iter().find(|block| block.name == APPEARANCE_BLOCK);
        let hash = block.map_or([0; 32], |block| block.hash);
        Ok(appearance::report(trained, &model.objects, &hash, &model.name, model.version))
    }
}
