//! Small pictures of meshes, in files: made when a mesh is uploaded, so that a page with thousands of
//! objects needs no mesh.
//!
//! They are derived and may be missing or torn: then they are made again.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use palpate_sim::mesh::Mesh;
use palpate_sim::render::thumbnail_png;
use uuid::Uuid;

/// Width and height of a picture, pixels. Chosen: sharp on a card 190 pixels wide, at about 8 kB.
const SIZE: usize = 256;
/// The last bytes of a whole PNG file.
const PNG_END: [u8; 8] = *b"IEND\xaeB`\x82";

/// The folder of pictures, by upload.
#[derive(Debug)]
pub(crate) struct Thumbnails {
    folder: PathBuf,
}

impl Thumbnails {
    /// Pictures in a folder that is created with the first one.
    pub(crate) fn new(folder: PathBuf) -> Self {
        Self { folder }
    }

    /// Makes the picture of an uploaded mesh, and keeps it. Blocks.
    pub(crate) fn make(&self, upload: Uuid, mesh: &Mesh) -> Vec<u8> {
        let png = thumbnail_png(mesh, SIZE);
        let path = self.path(upload);
        let part = path.with_extension("part");
        let kept = fs::create_dir_all(&self.folder)
            .and_then(|()| fs::write(&part, &png))
            .and_then(|()| fs::rename(&part, &path));
        if let Err(error) = kept {
            tracing::warn!("Cannot keep a picture in {}: {error}", path.display());
        }
        png
    }

    /// The picture of an upload, if it is whole. Blocks.
    pub(crate) fn find(&self, upload: Uuid) -> Option<Vec<u8>> {
        fs::read(self.path(upload)).ok().filter(|png| png.ends_with(&PNG_END))
    }

    /// Removes the picture of an upload. Blocks.
    pub(crate) fn remove(&self, upload: Uuid) {
        remove(&self.path(upload));
    }

    /// Removes every file that is not the picture of an upload that stays. Blocks.
    pub(crate) fn tidy(&self, stays: impl Fn(Uuid) -> bool) {
        let Ok(files) = fs::read_dir(&self.folder) else { return };
        for file in files.flatten() {
            let path = file.path();
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            if !Uuid::try_parse(name).is_ok_and(&stays) {
                remove(&path);
            }
        }
    }

    fn path(&self, upload: Uuid) -> PathBuf {
        self.folder.join(upload.simple().to_string())
    }
}

fn remove(path: &Path) {
    if let Err(error) = fs::remove_file(path)
        && error.kind() != ErrorKind::NotFound
    {
        tracing::warn!("Cannot remove {}: {error}", path.display());
    }
}
