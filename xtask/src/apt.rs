//! System packages that tests need: reports missing ones, and installs those that apt-get provides.

use std::process::Command;

use anyhow::bail;

use crate::run_to_end;

/// A system requirement, and the packages that provide it.
pub(crate) struct Need {
    pub(crate) what: &'static str,
    pub(crate) why: &'static str,
    pub(crate) packages: &'static [&'static str],
    pub(crate) is_there: fn() -> bool,
}

/// Software that draws the pictures of the tests, and the display on which windows open. Only Linux has these;
/// elsewhere the window's test is not built.
pub(crate) const NEEDS: [Need; 4] = [
    Need {
        what: "a C++ compiler",
        why: "builds the library that makes levels of detail",
        packages: &["g++"],
        is_there: || has_tool("c++"),
    },
    Need {
        what: "a software Vulkan driver",
        why: "draws the pictures of the tests, the same on every machine",
        packages: &["mesa-vulkan-drivers", "libvulkan1"],
        is_there: has_driver,
    },
    Need {
        what: "Xvfb",
        why: "is the display that the window's test opens",
        packages: &["xvfb"],
        is_there: || has_tool("Xvfb"),
    },
    Need {
        what: "xdotool",
        why: "presses the keys of the window's test",
        packages: &["xdotool"],
        is_there: || has_tool("xdotool"),
    },
];

/// Software that tests use if present, and pass without: not every system has a package of it.
pub(crate) const WANTS: [Need; 1] = [Need {
    what: "Chromium",
    why: "opens the page that `report` writes, and points at it",
    packages: &["chromium"],
    is_there: || has_tool("chromium") || has_tool("chromium-browser"),
}];

/// Installs the missing ones of `wants`, or reports that they are missing.
pub(crate) fn try_install(wants: &[Need], apt: impl FnMut(&[&str]) -> anyhow::Result<()>) {
    if let Err(why) = install(wants, apt) {
        println!("{why:#}\nits test skips itself");
    }
}

fn has_driver() -> bool {
    [
        "/usr/share/vulkan/icd.d",
        "/etc/vulkan/icd.d",
        "/usr/local/share/vulkan/icd.d",
    ]
    .iter()
    .filter_map(|dir| std::fs::read_dir(dir).ok())
    .flat_map(|entries| entries.flatten())
    .any(|e| e.file_name().to_string_lossy().contains("lvp"))
}

/// Returns `true` if a program is on the path.
pub(crate) fn has_tool(name: &str) -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path).any(|dir| dir.join(name).is_file())
}

/// Installs the missing ones of `needs` and reports them, or the command to install them.
///
/// `apt` runs apt-get with its arguments.
pub(crate) fn install(
    needs: &[Need],
    mut apt: impl FnMut(&[&str]) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let missing: Vec<&Need> = needs.iter().filter(|n| !(n.is_there)()).collect();
    if missing.is_empty() {
        return Ok(());
    }
    let packages: Vec<&str> = missing.iter().flat_map(|n| n.packages).copied().collect();
    for need in &missing {
        println!("missing: {}, which {}", need.what, need.why);
    }
    println!("installing {}", packages.join(" "));
    let mut args = vec!["install", "-y", "-qq", "--no-install-recommends"];
    args.extend(&packages);
    let done = apt(&["update", "-qq"]).and_then(|()| apt(&args));
    let left: Vec<&str> = missing
        .iter()
        .filter(|n| !(n.is_there)())
        .map(|n| n.what)
        .collect();
    match done {
        // An update may fail for one of many sources, and the install still succeed.
        _ if left.is_empty() => Ok(()),
        Ok(()) => bail!(
            "still missing after apt-get installed {}: {}",
            packages.join(" "),
            left.join(", ")
        ),
        Err(why) => bail!(
            "missing: {}; `apt-get install {}` or equivalent ({why:#})",
            left.join(", "),
            packages.join(" ")
        ),
    }
}

/// Runs apt-get without prompts.
pub(crate) fn apt_get(args: &[&str]) -> anyhow::Result<()> {
    let mut command = Command::new("apt-get");
    run_to_end(command.args(args).env("DEBIAN_FRONTEND", "noninteractive"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicBool, Ordering};

    fn need(is_there: fn() -> bool) -> Need {
        Need {
            what: "a thing",
            why: "is needed",
            packages: &["thing", "libthing"],
            is_there,
        }
    }

    #[test]
    fn what_is_there_is_not_installed() {
        install(&[need(|| true)], |_| panic!("nothing to install")).unwrap();
    }

    #[test]
    fn what_is_missing_is_installed_after_an_update() {
        static IS_THERE: AtomicBool = AtomicBool::new(false);
        let mut ran = Vec::new();
        install(
            &[need(|| true), need(|| IS_THERE.load(Ordering::Relaxed))],
            |args| {
                ran.push(args.join(" "));
                if args[0] == "install" {
                    IS_THERE.store(true, Ordering::Relaxed);
                }
                Ok(())
            },
        )
        .unwrap();
        assert_eq!(ran.len(), 2);
        assert!(ran[0].starts_with("update"), "{ran:?}");
        assert!(ran[1].ends_with("thing libthing"), "{ran:?}");
    }

    #[test]
    fn what_cannot_be_installed_is_said_with_what_to_type() {
        let why = install(&[need(|| false)], |_| bail!("no right to")).unwrap_err();
        let why = why.to_string();
        assert!(
            why.contains("a thing") && why.contains("no right to"),
            "{why}"
        );
        assert!(why.contains("apt-get install thing libthing"), "{why}");
        // apt reports success, but the tool is still missing.
        assert!(install(&[need(|| false)], |_| Ok(())).is_err());
    }

    #[test]
    fn what_is_only_wanted_stops_nothing() {
        let mut n_tried = 0;
        try_install(&[need(|| false)], |_| {
            n_tried += 1;
            bail!("no right to")
        });
        assert_eq!(n_tried, 1);
    }

    #[test]
    fn tools_are_looked_for_on_the_path() {
        assert!(has_tool("sh") && !has_tool("no-such-tool-anywhere"));
    }
}
