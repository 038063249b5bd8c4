//! Maps of a version's objects: interest points; contact maps to show, export and merge.

use palpate_schemas::{
    CatalogueVersion, InterestMap, MergeMaps, OccupancyMap, PlyForm, SliceQuery,
};

use crate::client::Client;
use crate::error::Error;
use crate::request::Request;

impl Client {
    /// Returns what a touch at each place of an object of a version tells about its identity.
    /// `object` is its id, or its name when it was trained.
    ///
    /// # Errors
    /// [`Error`]; status 409 if the version was trained without surfaces.
    pub async fn interest(
        &self,
        name: &str,
        version: u32,
        object: &str,
    ) -> Result<InterestMap, Error> {
        self.send(map_request(name, version, object, "interest")).await
    }

    /// Returns the contact map of an object of a version, with the log-odds of the slice in
    /// `query`. `object` is its id, or its name when it was trained.
    ///
    /// # Errors
    /// [`Error`]; status 409 if the version was trained without geometry.
    pub async fn occupancy(
        &self,
        name: &str,
        version: u32,
        object: &str,
        query: SliceQuery,
    ) -> Result<OccupancyMap, Error> {
        let request = map_request(name, version, object, "occupancy");
        self.send(request.query("slice", query.slice)).await
    }

    /// Returns a slice of the map as a PNG file; the middle one if `query` names none.
    ///
    /// # Errors
    /// As [`Client::occupancy`].
    pub async fn occupancy_png(
        &self,
        name: &str,
        version: u32,
        object: &str,
        query: SliceQuery,
    ) -> Result<Vec<u8>, Error> {
        let request = map_request(name, version, object, "occupancy.png");
        self.send_for_file(request.query("slice", query.slice)).await
    }

    /// Returns the map as a PLY file, in metres in the object frame.
    ///
    /// # Errors
    /// As [`Client::occupancy`].
    pub async fn occupancy_ply(
        &self,
        name: &str,
        version: u32,
        object: &str,
        form: PlyForm,
    ) -> Result<Vec<u8>, Error> {
        let form = match form {
            PlyForm::Points => "points",
            PlyForm::Mesh => "mesh",
        };
        let request = map_request(name, version, object, "occupancy.ply");
        self.send_for_file(request.query("form", Some(form))).await
    }

    /// Creates a version of a catalogue that merges the contact maps of two versions.
    ///
    /// # Errors
    /// [`Error`]; status 422 names what does not match.
    pub async fn merge_maps(
        &self,
        name: &str,
        merge: &MergeMaps,
    ) -> Result<CatalogueVersion, Error> {
        self.send(Request::post(["v1", "catalogues", name, "merges"]).json(merge)).await
    }
}

fn map_request(name: &str, version: u32, object: &str, file: &str) -> Request {
    let version = version.to_string();
    Request::get(["v1", "catalogues", name, "versions", &version, "objects", object, file])
}
