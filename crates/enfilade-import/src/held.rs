//! Scenes of several files in memory, for programs without a disk.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Endings of files to which scenes refer, and that are none themselves: buffers, materials, pictures.
const REFERRED: [&str; 14] = [
    "bin", "mtl", "png", "jpg", "jpeg", "webp", "ktx2", "basis", "dds", "bmp", "gif", "tga",
    "avif", "wad",
];

/// Files in memory, by name: that of a dropped file, or a path with `/` below the dropped folder.
#[derive(Clone, Debug, Default)]
pub struct HeldFiles {
    files: BTreeMap<String, Vec<u8>>,
    /// Names of files of which all objects are detail.
    detail: BTreeSet<String>,
    /// IFC files as a reader of the program read them, by their names.
    ifc: BTreeMap<String, ConvertedIfc>,
}

/// An IFC file as a program read it, by the reader of the command: `ifc/ifc_model.mjs` with web-ifc.
#[derive(Clone, Debug, Default)]
pub struct ConvertedIfc {
    /// The GLB.
    pub glb: Vec<u8>,
    /// Notes for the user.
    pub notes: Vec<String>,
}

impl FromIterator<(String, Vec<u8>)> for HeldFiles {
    fn from_iter<T: IntoIterator<Item = (String, Vec<u8>)>>(files: T) -> Self {
        Self {
            files: files.into_iter().collect(),
            ..Self::default()
        }
    }
}

impl HeldFiles {
    /// Adds a file; all objects of a scene may be detail.
    pub fn add(&mut self, name: String, bytes: Vec<u8>, is_detail: bool) {
        if is_detail {
            self.detail.insert(name.clone());
        }
        self.files.insert(name, bytes);
    }

    /// Adds what a reader made of an IFC file, which is one of these files itself.
    pub fn add_converted(&mut self, name: String, converted: ConvertedIfc) {
        self.ifc.insert(name, converted);
    }

    /// Returns what a reader made of an IFC file.
    pub(crate) fn converted(&self, scene: &Path) -> Option<&ConvertedIfc> {
        self.ifc.get(&*scene.to_string_lossy())
    }

    /// Iterates over the scenes: all files but those that scenes refer to. If there are only such files, over all of them.
    pub(crate) fn scenes(&self) -> impl Iterator<Item = (&str, &[u8])> {
        let is_scene = |name: &str| {
            let ending = Path::new(name).extension().unwrap_or_default();
            let ending = ending.to_string_lossy().to_ascii_lowercase();
            !REFERRED.contains(&ending.as_str())
        };
        let has_scene = self.files.keys().any(|name| is_scene(name));
        let all = self.files.iter().map(|(name, bytes)| (&**name, &**bytes));
        all.filter(move |(name, _)| !has_scene || is_scene(name))
    }

    /// Returns `true` if all objects of a file are detail.
    pub(crate) fn is_detail(&self, name: &str) -> bool {
        self.detail.contains(name)
    }

    /// Returns the file that a scene refers to: beside it as named, or else the only one of that name in any folder.
    pub(crate) fn reference(
        &self,
        scene: &Path,
        reference: &str,
        limit: u64,
    ) -> Result<(PathBuf, Vec<u8>), String> {
        if reference.contains("://") {
            return Err(format!("refers to '{reference}'; only files are read"));
        }
        let decoded = percent_encoding::percent_decode_str(reference).decode_utf8_lossy();
        let folder = scene.parent().unwrap_or(Path::new("")).to_string_lossy();
        let beside = [&*decoded, reference].map(|name| tidy(&format!("{folder}/{name}")));
        let found = beside
            .iter()
            .find_map(|name| self.files.get_key_value(name));
        let (name, bytes) = found.or_else(|| self.alone(&decoded)).ok_or_else(|| {
            format!("refers to the file '{reference}', which is not there; give it, too")
        })?;
        if bytes.len() as u64 > limit {
            let n = bytes.len();
            return Err(format!(
                "refers to '{reference}' of {n} bytes, more than {limit}"
            ));
        }
        Ok((name.into(), bytes.clone()))
    }

    /// Returns the only file whose name without folders is that of a path, in letters of any case.
    fn alone(&self, path: &str) -> Option<(&String, &Vec<u8>)> {
        let last = |path: &str| {
            let path = path.replace('\\', "/");
            path.rsplit('/').next().unwrap_or_default().to_lowercase()
        };
        let wanted = last(path);
        let mut all = self.files.iter().filter(|(name, _)| last(name) == wanted);
        all.next().filter(|_| all.next().is_none())
    }
}

/// A path without `.`, and with `..` followed.
fn tidy(path: &str) -> String {
    let mut names: Vec<&str> = Vec::new();
    for name in path.split(['/', '\\']) {
        match name {
            "" | "." => {}
            ".." => {
                names.pop();
            }
            name => names.push(name),
        }
    }
    names.join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held(names: &[&str]) -> HeldFiles {
        let files = names
            .iter()
            .map(|name| ((*name).to_owned(), name.as_bytes().to_vec()));
        files.collect()
    }

    #[test]
    fn references_are_found_beside_their_scene_or_by_their_name_alone() {
        let files = held(&[
            "a/x.gltf",
            "a/x y.bin",
            "b/x.bin",
            "c/One.PNG",
            "d/t.png",
            "e/t.png",
        ]);
        let found = |reference| {
            let found = files.reference(Path::new("a/x.gltf"), reference, 100);
            found.map(|(path, _)| path.display().to_string())
        };
        assert_eq!(found("x%20y.bin").as_deref(), Ok("a/x y.bin"));
        assert_eq!(found("..\\b\\x.bin").as_deref(), Ok("b/x.bin"));
        assert_eq!(found("textures/one.png").as_deref(), Ok("c/One.PNG"));
        assert!(found("t.png").unwrap_err().contains("give it, too"));
        assert!(found("http://host/x.bin").is_err());
        assert!(files.reference(Path::new(""), "x.bin", 3).is_err());
    }
}
