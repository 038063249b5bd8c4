//! Small pictures of meshes, in files: made when a mesh is uploaded, so that a page with thousands of
//! objects needs no mesh. One that is missing or torn is made again.

use std::path::PathBuf;

use palpate_sim::mesh::Mesh;
use palpate_sim::render::{EXTENT, thumbnail_png};
use uuid::Uuid;

use crate::derived::DerivedFiles;

/// Width and height of a picture, pixels. Chosen: sharp on a card 190 pixels wide, at about 8 kB.
const SIZE: usize = 256;
/// Maximum length of a picture, bytes: all of its pixels without compression, and more.
const BYTES_MAX: u64 = 1 << 19;
/// The last bytes of a whole PNG file.
const PNG_END: [u8; 8] = *b"IEND\xaeB`\x82";

/// The pictures, by upload.
#[derive(Debug)]
pub(crate) struct Thumbnails(DerivedFiles);

impl Thumbnails {
    /// Pictures in a folder that is created with the first one.
    pub(crate) fn new(folder: PathBuf) -> Self {
        Self(DerivedFiles::new(folder, "a picture", BYTES_MAX))
    }

    /// Makes the picture of an uploaded mesh, and keeps it. Blocks.
    pub(crate) fn make(&self, upload: Uuid, mesh: &Mesh) -> Vec<u8> {
        let png = thumbnail_png(mesh, SIZE);
        self.0.keep(upload, &png);
        png
    }

    /// The picture of an upload, if it is whole and states the mesh's extent. Blocks.
    pub(crate) fn find(&self, upload: Uuid) -> Option<Vec<u8>> {
        let states = |png: &[u8]| png.windows(EXTENT.len()).any(|part| part == EXTENT.as_bytes());
        self.0.find(upload).filter(|png| png.ends_with(&PNG_END) && states(png))
    }

    /// Removes the picture of an upload. Blocks.
    pub(crate) fn remove(&self, upload: Uuid) {
        self.0.remove(upload);
    }

    /// Removes every file that is not the picture of an upload that stays. Blocks.
    pub(crate) fn tidy(&self, stays: impl Fn(Uuid) -> bool) {
        self.0.tidy(stays);
    }
}
