//! Formats of the outputs, and the file extensions of each.

use std::path::Path;

use anyhow::bail;

/// The content of an output file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    World,
    PortalFile,
    Plan,
    Page,
    Picture,
    Cameras,
    Choices,
    Leak,
    Visible,
    Pairs,
    Statistics,
    Evidence,
    Search,
    Manual,
    Sound,
    Living,
    Walk,
    Packed,
    PortalTextures,
    PlainData,
    FloorMap,
    Ifc,
}

struct Row {
    format: Format,
    /// In words, with an article.
    name: &'static str,
    /// Extensions in lower case; the first is the usual one.
    extensions: &'static [&'static str],
    /// `true` if it may go to standard output.
    is_streamed: bool,
}

const fn row(format: Format, name: &'static str, extensions: &'static [&'static str]) -> Row {
    Row {
        format,
        name,
        extensions,
        // These are read again.
        is_streamed: !matches!(
            format,
            Format::Search | Format::Walk | Format::Packed | Format::FloorMap
        ),
    }
}

/// The outputs of all commands.
const TABLE: [Row; 22] = [
    row(Format::World, "a world, one GLB", &["glb"]),
    row(Format::PortalFile, "a Quake portal file", &["prt"]),
    row(
        Format::Plan,
        "a floor plan as SVG, PNG or PDF",
        &["svg", "png", "pdf"],
    ),
    row(Format::Page, "a page of HTML", &["html", "htm"]),
    row(Format::Picture, "a picture as PNG", &["png"]),
    row(Format::Sound, "a sound as WAV", &["wav"]),
    row(Format::Cameras, "cameras as text", &["txt", "path"]),
    row(Format::Choices, "decisions as TOML", &["toml"]),
    row(
        Format::Leak,
        "a path as lines of text",
        &["pts", "lin", "txt"],
    ),
    row(Format::Visible, "visible sets as text", &["pvs", "txt"]),
    row(Format::Pairs, "pairs as text", &["txt"]),
    row(Format::Statistics, "statistics as JSON", &["json"]),
    row(Format::Living, "what lives in a world, as JSON", &["json"]),
    row(Format::Evidence, "evidence", &["ev", "evidence"]),
    row(Format::Search, "a saved search", &["search", "checkpoint"]),
    row(Format::Walk, "a map of floors", &["walk"]),
    row(Format::Packed, "a packed world", &["enf"]),
    row(Format::PortalTextures, "portal textures", &["ptx"]),
    row(Format::Manual, "a manual page", &["1"]),
    row(
        Format::PlainData,
        "plain data as JSON, GraphML, DOT, CSV, OBJ, gbXML, HBJSON or IndoorGML",
        &[
            "json", "graphml", "dot", "gv", "csv", "obj", "gbxml", "hbjson", "gml",
        ],
    ),
    row(Format::FloorMap, "a map for robots as PGM", &["pgm"]),
    row(Format::Ifc, "a model as IFC", &["ifc"]),
];

/// Extensions of formats that no command writes: pictures, models, sounds, films, documents, archives, programs.
const FOREIGN: [&str; 150] = [
    "3ds", "3mf", "7z", "aac", "abc", "ac3", "aif", "aiff", "amr", "ape", "au", "avi", "avif",
    "bam", "blend", "bmp", "bsp", "bz2", "c", "cpp", "css", "cub", "dae", "dds", "dll", "doc",
    "docx", "dwg", "dxf", "e57", "eps", "epub", "exe", "exr", "fbx", "flac", "flv", "gif", "gltf",
    "gz", "h", "hdr", "heic", "ico", "ini", "jar", "jfif", "jpeg", "jpg", "js", "jxl", "ktx",
    "ktx2", "las", "laz", "lwo", "lz4", "m4a", "m4v", "map", "md", "mdl", "mid", "midi", "mkv",
    "mov", "mp2", "mp3", "mp4", "mpeg", "mpg", "mtl", "odp", "ods", "odt", "off", "oga", "ogg",
    "ogv", "opus", "pak", "pbm", "pcd", "pcx", "php", "pk3", "ply", "pnm", "ppm", "ppt", "pptx",
    "ps", "psd", "py", "rar", "raw", "rm", "rs", "rst", "rtf", "sh", "skp", "sldprt", "so", "spx",
    "sql", "step", "stl", "stp", "svgz", "swf", "tar", "tex", "tga", "tgz", "tif", "tiff", "ts",
    "tsv", "tta", "usd", "usda", "usdc", "usdz", "vmf", "vox", "vrml", "vtk", "wad", "wasm",
    "webm", "webp", "wma", "wmv", "woff", "woff2", "wrl", "wv", "x3d", "xcf", "xhtml", "xls",
    "xlsx", "xml", "xyz", "xz", "yaml", "yml", "zip", "zst",
];

impl Format {
    fn row(self) -> &'static Row {
        let row = TABLE.iter().find(|row| row.format == self);
        row.expect("each format has a row")
    }

    /// Refuses a name whose extension belongs to another format. Unknown extensions are accepted: a temporary name is
    /// as good as any.
    pub(crate) fn check(self, option: &str, path: &Path) -> anyhow::Result<()> {
        let row = self.row();
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        let extension = extension.to_ascii_lowercase();
        let is_known = |e: &str| {
            let mut ours = TABLE.iter().flat_map(|row| row.extensions);
            FOREIGN.contains(&e) || ours.any(|other| *other == e)
        };
        if row.extensions.contains(&&*extension) || !is_known(&extension) {
            return Ok(());
        }
        let fit: Vec<String> = row.extensions.iter().map(|e| format!(".{e}")).collect();
        bail!(
            "{}: {option} writes {}, which .{extension} contradicts; {} fits",
            path.display(),
            row.name,
            fit.join(" or ")
        );
    }

    /// Refuses standard output for formats that are of no use there.
    pub(crate) fn check_stream(self, option: &str) -> anyhow::Result<()> {
        let row = self.row();
        if !row.is_streamed {
            bail!(
                "{option} writes {}, which is read again; give it a file, not '-'",
                row.name
            );
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_extension_that_contradicts_is_refused_with_those_that_fit() {
        let refused = |format: Format, path: &str| {
            let error = format.check("-o", Path::new(path)).err();
            error.map(|e| e.to_string())
        };
        for (format, path) in [
            (Format::Plan, "x.SVG"),
            (Format::Plan, "x.png"),
            (Format::Plan, "x-{}.pdf"),
            (Format::Plan, "x"),
            (Format::Plan, "/dev/stdout"),
            (Format::Plan, "tmp.Xq3kf"),
            (Format::Page, "x.htm"),
            (Format::Visible, "v1.2"),
            (Format::Cameras, "walk.txt"),
        ] {
            assert_eq!(refused(format, path), None);
        }
        for (format, path, fits) in [
            (Format::Plan, "x.jpg", ".svg or .png or .pdf fits"),
            (Format::World, "x.glb.OBJ", ".glb fits"),
            (Format::World, "x.txt", ".glb fits"),
            (Format::Page, "x.svg", ".html or .htm fits"),
            (Format::Picture, "x.jpg", ".png fits"),
            (Format::Statistics, "x.txt", ".json fits"),
            (Format::Page, "x.docx", ".html or .htm fits"),
            (Format::Sound, "x.MP3", ".wav fits"),
            (Format::Visible, "x.mp3", ".pvs or .txt fits"),
        ] {
            let error = refused(format, path).unwrap();
            assert!(error.ends_with(fits), "{error}");
        }
    }
}
