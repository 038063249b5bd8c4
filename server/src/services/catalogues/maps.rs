//! Trained maps of contact: shown, exported, and merged with those of other robots.
//!
//! A merged version is the first one with additional evidence. Object frames are not assumed
//! to be equal: both maps are moved to the frame of the training readings or the mesh.

use std::sync::Arc;

use palpate_core::stop::Stop;
use palpate_dissertation::geometric::model::{GeometricMap, GeometricModel};
use palpate_schemas as wire;
use palpate_schemas::PlyForm;
use palpate_sim::render::occupancy::{cloud_ply, layer_png, surface_ply};
use palpate_store::catalogue::Draft;
use palpate_store::model::TrainedModel;
use palpate_store::model_codec::{ModelPart, model_to_blocks};
use uuid::Uuid;

use super::{CatalogueError, Catalogues, Model};
use crate::asker::Asker;
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::compute::Pool;
use crate::wire::{geometry, training};

/// Approximate length of an image's longer side, in pixels.
const PNG_PIXELS: usize = 600;
/// Maximum number of pixels along a cell.
const CELL_PIXELS_MAX: usize = 16;
/// Probability from which a cell is exported as occupied.
const OCCUPIED: f64 = 0.75;

/// The geometry of one object of a version.
pub(crate) struct Mapped {
    model: Arc<Model>,
    map: Arc<GeometricMap>,
    place: usize,
}

impl Mapped {
    /// Tag of the version: maps of a version never change.
    pub(crate) fn tag(&self) -> String {
        format!("\"{}-{}\"", self.model.catalogue.simple(), self.model.version)
    }

    pub(crate) fn occupancy(&self, slice: Option<u32>) -> Result<wire::OccupancyMap, Cause> {
        Ok(geometry::occupancy_map(&self.model.objects[self.place], &self.map, slice)?)
    }

    /// A layer of cells as a PNG; the middle one unless named.
    pub(crate) async fn png(&self, pool: &Pool, slice: Option<u32>) -> Result<Vec<u8>, Cause> {
        let [x, y, n_slices] = self.map.occupancy.shape().n();
        let slice = match slice {
            Some(slice) => geometry::slice_number(&self.map.occupancy, slice)?,
            None => n_slices / 2,
        };
        let cell_pixels = (PNG_PIXELS / x.max(y)).clamp(1, CELL_PIXELS_MAX);
        let map = Arc::clone(&self.map);
        let draw = move || layer_png(&map.occupancy, slice, cell_pixels);
        let png = pool.place()?.run_long(draw).await?;
        png.ok_or_else(|| Cause::unknown("slice", slice))
    }

    /// The cells that are likely occupied, or the surface around them.
    pub(crate) async fn ply(&self, pool: &Pool, form: PlyForm) -> Result<Vec<u8>, Cause> {
        let map = Arc::clone(&self.map);
        let write = move || match form {
            PlyForm::Points => Some(cloud_ply(&map.occupancy, OCCUPIED)),
            PlyForm::Mesh => surface_ply(&map.occupancy, OCCUPIED),
        };
        let ply = pool.place()?.run_long(write).await?;
        ply.ok_or_else(|| {
            let detail = "came `mesh`, but the map is planar or has no occupied cell: it has no \
                          surface, ask for `points`";
            Cause::field("?form", detail)
        })
    }
}

impl Catalogues {
    /// The geometry of one object, by the segments of a path.
    pub(crate) async fn mapped(
        &self,
        name: &str,
        version: &str,
        object: &str,
    ) -> Result<Mapped, CatalogueError> {
        let (model, place) = self.object_of(name, version, object, ModelPart::Geometric).await?;
        let map = Arc::clone(&model.geometric()?.maps[place]);
        Ok(Mapped { model, map, place })
    }

    /// Creates a version of `name` whose maps of contact include another version's evidence.
    pub(crate) async fn merge(
        &self,
        name: &str,
        request: &wire::MergeMaps,
    ) -> Result<wire::CatalogueVersion, CatalogueError> {
        let _using = self.using().await;
        let catalogue = self.find(name)?;
        let ours = self.pin(name, request.version, None)?;
        let ours = self.whole(ours.catalogue, ours.version).await?;
        let with = self
            .find(&request.with.catalogue)
            .map_err(|error| Cause::field("/with/catalogue", error))?;
        let theirs = self
            .manifest(&with, request.with.version)
            .map_err(|error| Cause::field("/with/version", error))?;
        let theirs = self.whole(with.id, theirs.version).await?;
        let manifest = self.manifest(&catalogue, ours.version)?;
        let mut parameters = training::parameters(&catalogue, &manifest)?;
        parameters.merged_from = vec![reference(&ours), reference(&theirs)];
        let stop = Asker::current().overdue().clone();
        let merging = move || {
            let geometry = merge(&ours, &theirs, &stop)?;
            let core = TrainedModel { geometric: Some(Arc::new(geometry)), ..(*ours.core).clone() };
            let ids: Vec<Uuid> = ours.objects.iter().map(|object| object.id).collect();
            Ok::<_, CatalogueError>((model_to_blocks(&core, &ids), core))
        };
        let (blocks, core) = self.pool.place()?.run_long(merging).await??;
        let maps = core.geometric.iter().flat_map(|geometry| &geometry.maps);
        for (object, map) in parameters.report.objects.iter_mut().zip(maps) {
            object.geometric = Some(geometry::report(map));
        }
        let draft = Draft {
            job: None,
            parameters: serde_json::to_string(&parameters)
                .expect("a report consists of finite numbers and strings"),
            objects: manifest.objects,
            shared: Vec::new(),
            blocks,
            created_at_ms: now_ms(),
        };
        let version = self.publish(name, draft, request.activate.unwrap_or(true)).await?;
        tracing::info!("Merged maps into version {version} of catalogue {name:?}");
        let catalogue = self.find(name)?;
        Ok(training::version(&catalogue, &self.manifest(&catalogue, version)?)?)
    }
}

fn reference(model: &Model) -> wire::VersionReference {
    wire::VersionReference { catalogue: model.name.clone(), version: model.version }
}

/// The geometry of `ours` with the evidence of `theirs`. Objects missing in `theirs` keep
/// their maps.
fn merge(ours: &Model, theirs: &Model, stop: &Stop) -> Result<GeometricModel, CatalogueError> {
    let (our_geometry, their_geometry) = (ours.geometric()?, theirs.geometric()?);
    let mut n_shared = 0;
    let mut maps = Vec::with_capacity(ours.objects.len());
    for (place, object) in ours.objects.iter().enumerate() {
        let map = &our_geometry.maps[place];
        let Some(other) = theirs.objects.iter().position(|other| other.id == object.id) else {
            maps.push(Arc::clone(map));
            continue;
        };
        n_shared += 1;
        let origin =
            |model: &Model, place: usize| model.core.sva.objects[place].origin_in_training();
        let theirs_from_ours = origin(ours, place) - origin(theirs, other);
        let occupancy = map
            .occupancy
            .merge_shifted(&their_geometry.maps[other].occupancy, theirs_from_ours, stop)
            .map_err(|error| Cause::field("/with", format!("object {:?}: {error}", object.name)))?;
        maps.push(Arc::new(GeometricMap { occupancy, mosaic: map.mosaic.clone() }));
    }
    if n_shared == 0 {
        let detail = format!(
            "version {} of catalogue {:?} knows none of the objects of version {} of {:?}",
            theirs.version, theirs.name, ours.version, ours.name
        );
        return Err(Cause::field("/with", detail).into());
    }
    let mut gains = our_geometry.gains.clone();
    let known = |sensor| gains.iter().any(|known| known.sensor == sensor);
    let others: Vec<_> =
        their_geometry.gains.iter().filter(|other| !known(other.sensor)).cloned().collect();
    gains.extend(others);
    Ok(GeometricModel { table: our_geometry.table.clone(), gains, maps })
}
