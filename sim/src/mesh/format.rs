//! The supported mesh formats, and what a file is by its first bytes.

use std::fmt;

use super::text;

/// Bytes of a file in which its first word is looked for.
const HEAD_BYTES: usize = 4096;

/// A mesh file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshFormat {
    /// Stereolithography, binary or ASCII.
    Stl,
    /// Wavefront OBJ.
    Obj,
    /// Polygon file format, ASCII or binary.
    Ply,
    /// Object file format of Geomview, ASCII.
    Off,
    /// glTF 2.0, binary with its buffer inside. In metres.
    Glb,
    /// 3D Manufacturing Format. Names its unit itself.
    ThreeMf,
}

/// Each format with its name, which is also its extension, and its media types, the usual first.
const FORMATS: [(MeshFormat, &str, &[&str]); 6] = [
    (
        MeshFormat::Stl,
        "STL",
        &["model/stl", "model/x.stl-binary", "model/x.stl-ascii", "application/sla"],
    ),
    (MeshFormat::Obj, "OBJ", &["model/obj", "application/x-tgif"]),
    (MeshFormat::Ply, "PLY", &["model/ply", "application/ply", "application/x-ply"]),
    (MeshFormat::Off, "OFF", &["model/off", "application/off", "application/x-off"]),
    (MeshFormat::Glb, "GLB", &["model/gltf-binary"]),
    (
        MeshFormat::ThreeMf,
        "3MF",
        &["model/3mf", "application/vnd.ms-package.3dmanufacturing-3dmodel+xml"],
    ),
];

/// Files that are no mesh that can be read, by their first bytes: what they are, what to do.
const OTHERS: [(&[u8], &str); 17] = [
    (b"PK", "a ZIP archive without a 3MF model: unpack it, and take the mesh inside"),
    (b"ISO-10303", "STEP, surfaces without triangles: export STL or 3MF from the CAD program"),
    (b"{", "JSON: glTF is read as one binary file, so export GLB"),
    (b"<!doctype html", "a web page: download the file itself"),
    (b"<html", "a web page: download the file itself"),
    (b"<", "XML, such as COLLADA, X3D, AMF or VTK: export GLB, 3MF or STL"),
    (b"#VRML", "VRML: export GLB, 3MF or STL"),
    (b"Kaydara FBX", "FBX: export GLB or STL"),
    (b"BLENDER", "a Blender file: export GLB or STL"),
    (b"3D Geometry File Format", "a Rhino file: export OBJ, 3MF or STL"),
    (b"DRACO", "Draco, compressed: export GLB without compression"),
    (b"xof ", "DirectX: export GLB or STL"),
    (b"\x1f\x8b", "compressed by gzip: unpack it"),
    (b"7z\xbc\xaf", "a 7z archive: unpack it"),
    (b"Rar!", "a RAR archive: unpack it"),
    (b"%PDF", "a PDF: export STL or 3MF from the CAD program"),
    (b"version https://git-lfs", "a pointer of Git LFS: fetch the file itself with `git lfs pull`"),
];

impl MeshFormat {
    /// All formats.
    pub const ALL: [Self; 6] =
        [Self::Stl, Self::Obj, Self::Ply, Self::Off, Self::Glb, Self::ThreeMf];

    /// The format of a file name's extension, with or without its dot, in any case.
    #[must_use]
    pub fn from_extension(extension: &str) -> Option<Self> {
        let extension = extension.trim_start_matches('.');
        let found = FORMATS.iter().find(|(_, name, _)| name.eq_ignore_ascii_case(extension));
        found.map(|(format, ..)| *format)
    }

    /// The format of a media type such as `model/stl`; parameters after `;` are ignored.
    #[must_use]
    pub fn from_media_type(media_type: &str) -> Option<Self> {
        let essence = media_type.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
        let found = FORMATS.iter().find(|(.., types)| types.contains(&essence.as_str()));
        found.map(|(format, ..)| *format)
    }

    /// The format that a file's first bytes show; `None` if they show none.
    ///
    /// Comments (`#`) show nothing, and neither does a binary STL: its header may begin with
    /// anything.
    #[must_use]
    pub fn from_content(bytes: &[u8]) -> Option<Self> {
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        if bytes.starts_with(b"PK") {
            // The names of an archive's parts stand in it uncompressed.
            let n = b"3D/3dmodel".len();
            let part = |at: &[u8]| at.eq_ignore_ascii_case(b"3D/3dmodel");
            return bytes.windows(n).any(part).then_some(Self::ThreeMf);
        }
        if bytes.starts_with(b"glTF") {
            return Some(Self::Glb);
        }
        let head = text::plain(&bytes[..bytes.len().min(HEAD_BYTES)]);
        let mut words = head.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let word = words.next()?.to_ascii_lowercase();
        match &word[..] {
            b"ply" => Some(Self::Ply),
            b"solid" => Some(Self::Stl),
            b"v" | b"vn" | b"vt" | b"o" | b"g" | b"mtllib" => Some(Self::Obj),
            word if word.len() <= 7 && word.ends_with(b"off") => Some(Self::Off),
            _ => None,
        }
    }

    /// Whether the format fixes the unit or every file states it, so no user needs to give one.
    #[must_use]
    pub fn knows_its_unit(self) -> bool {
        matches!(self, Self::Glb | Self::ThreeMf)
    }

    /// The media type of the format.
    #[must_use]
    pub fn media_type(self) -> &'static str {
        FORMATS[self as usize].2[0]
    }

    /// The extension of the format, in small letters; also its name in the API.
    #[must_use]
    pub fn extension(self) -> String {
        self.to_string().to_ascii_lowercase()
    }
}

impl fmt::Display for MeshFormat {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(FORMATS[*self as usize].1)
    }
}

/// What a file is that is of none of the formats, and what to do; `None` if it shows nothing.
#[must_use]
pub fn other_content(bytes: &[u8]) -> Option<&'static str> {
    let begins = |signature: &[u8]| {
        bytes.get(..signature.len()).is_some_and(|head| head.eq_ignore_ascii_case(signature))
    };
    OTHERS.iter().find(|(signature, _)| begins(signature)).map(|(_, what)| *what)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extensions_and_media_types_map_to_formats() {
        assert_eq!(MeshFormat::from_extension(".STL"), Some(MeshFormat::Stl));
        assert_eq!(MeshFormat::from_extension("dae"), None);
        for format in MeshFormat::ALL {
            assert_eq!(MeshFormat::from_media_type(format.media_type()), Some(format));
            assert_eq!(MeshFormat::from_extension(&format.extension()), Some(format));
        }
        assert_eq!(MeshFormat::from_media_type("model/PLY; charset=utf-8"), Some(MeshFormat::Ply));
    }
}
