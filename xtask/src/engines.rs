//! Integrations with engines, which are workspaces and packages of their own: their tests, and their figures.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::Context;

use crate::apt::{self, Need, has_tool};
use crate::python;
use crate::steps::Steps;
use crate::{
    GATE, Profile, RELEASE, cargo, engine_builds, integration, name_of, output_of, run_to_end,
    scenes, target_dir, world_of,
};

/// Compilers, engines and browsers.
const NEEDS: [Need; 9] = [
    python::NEED,
    Need {
        what: "a C# compiler",
        why: "builds the reader for Unity",
        packages: &["mono-mcs", "mono-runtime"],
        is_there: || has_tool("mcs") && has_tool("mono"),
    },
    Need {
        what: "Newtonsoft.Json",
        why: "reads JSON for the reader for Unity",
        packages: &["libnewtonsoft-json5.0-cil"],
        is_there: || Path::new("/usr/lib/cli/Newtonsoft.Json-5.0").is_dir(),
    },
    Need {
        what: "nlohmann/json",
        why: "reads JSON for the reader in C++",
        packages: &["nlohmann-json3-dev"],
        is_there: || Path::new("/usr/include/nlohmann/json.hpp").is_file(),
    },
    Need {
        what: "Godot's server",
        why: "runs the reader for Godot",
        packages: &["godot3-server"],
        is_there: || has_tool("godot3-server"),
    },
    Need {
        what: "a compiler for WebAssembly with its standard library",
        why: "builds the run-time for browsers",
        packages: &["rustc-web", "rust-web-src"],
        is_there: || Path::new("/usr/lib/rustlib/src").is_dir(),
    },
    Need {
        what: "wasm-ld",
        why: "links the run-time for browsers",
        packages: &["lld-19"],
        is_there: || has_tool("wasm-ld-19"),
    },
    Need {
        what: "wasm-opt",
        why: "shrinks the run-time for browsers",
        packages: &["binaryen"],
        is_there: || has_tool("wasm-opt"),
    },
    Need {
        what: "Chromium",
        why: "runs the tests of the package for browsers",
        packages: &["chromium"],
        is_there: || has_tool("chromium"),
    },
];

/// Number of baked scenes on which the gate tries the integrations, beside the demo.
const N_SCENES: usize = 3;

/// Scenes on which they are measured, those of `docs/benchmarks/engines.md`.
const MEASURED: [&str; 3] = ["duplex", "fzk-haus", "institute"];

/// Runs the tests of the integrations, on the demo and on worlds that are baked already.
pub(crate) fn run_steps(steps: &mut Steps) -> anyhow::Result<()> {
    steps.step("tools of engines", tools)?;
    let worlds = worlds();
    steps.step("readers", || run_to_end(&mut readers(GATE, &worlds)))?;
    steps.step("abi", || abi(&worlds))?;
    steps.step("web", || {
        build_web(GATE.0)?;
        run_to_end(&mut web("npm", GATE, &["test"]))
    })?;
    steps.step("python", || python::test(&worlds))
}

/// Lints the page's module that bakes, which checks the bake once more.
pub(crate) fn lint_page(steps: &mut Steps) -> anyhow::Result<()> {
    steps.step("lint of the page's module", || {
        let clippy = ["clippy", "--locked", "--all-targets"];
        let mut lint = in_workspace("web", &clippy);
        lint.args(["--", "-D", "warnings"]);
        run_to_end(lint.current_dir(integration("web").join("bake")))
    })
}

/// Lints the plugin for Bevy, runs its tests, on whatever card or software driver there is, and builds its documentation. To compile
/// the engine takes longer than the gate may.
pub(crate) fn test_bevy(steps: &mut Steps) -> anyhow::Result<()> {
    steps.step("lint of bevy", || {
        let clippy = ["--all-targets", "--", "-D", "warnings"];
        run_to_end(bevy("clippy").args(clippy))
    })?;
    steps.step("tests of bevy", || {
        let test = ["--all-targets", "--", "--test-threads", "2"];
        run_to_end(bevy("test").args(test))
    })?;
    steps.step("docs of bevy", || {
        run_to_end(
            bevy("doc")
                .arg("--no-deps")
                .env("RUSTDOCFLAGS", "-D warnings"),
        )
    })
}

/// Returns a cargo command for the plugin, always with the same features: with others, the engine is built once more.
fn bevy(command: &str) -> Command {
    in_workspace("bevy", &[command, "--locked", "--features", "bake"])
}

/// Prints the figures of all integrations, as JSON lines or as a table.
pub(crate) fn bench(args: &[String]) -> anyhow::Result<()> {
    if !matches!(args, [] | [_]) || args.iter().any(|a| a != "--json") {
        anyhow::bail!("usage: cargo xtask bench engines [--json]");
    }
    if cfg!(target_os = "linux") {
        tools()?;
    }
    run_to_end(RELEASE.cargo("build", &["-p", "enfilade-cli"]).arg("-q"))?;
    let worlds = fresh_worlds()?;
    build_web("gate")?;
    // The institute, by the order of names.
    let last = &worlds[worlds.len() - 1..];
    let measured = [
        readers(RELEASE, &worlds),
        web("node", RELEASE, &["measure.mjs"]),
        bevy_figures(&["--views", "25"], &worlds),
        bevy_figures(&["--views", "5", "--no-sun", "--furnish", "820000"], last),
    ];
    print_rows(measured, args.is_empty())
}

/// Prints the figures of the page that bakes; a name chooses rows.
pub(crate) fn bench_web(args: &[String]) -> anyhow::Result<()> {
    let is_option = |arg: &&String| arg.starts_with('-');
    if let Some(unknown) = args.iter().filter(is_option).find(|arg| *arg != "--json") {
        anyhow::bail!("unknown {unknown}; usage: cargo xtask bench web [--json] [ROW...]");
    }
    if cfg!(target_os = "linux") {
        tools()?;
    }
    run_to_end(RELEASE.cargo("build", &["-p", "enfilade-cli"]).arg("-q"))?;
    build_web("release")?;
    let mut measured = web("node", RELEASE, &["measure-bake.mjs"]);
    measured.args(args.iter().filter(|arg| !is_option(arg)));
    print_rows([measured], !args.iter().any(|arg| arg == "--json"))
}

fn print_rows(measured: impl IntoIterator<Item = Command>, is_table: bool) -> anyhow::Result<()> {
    for mut command in measured {
        // Short rows end with a status, but are rows.
        let said = command.stderr(Stdio::inherit()).output()?;
        for line in String::from_utf8_lossy(&said.stdout).lines() {
            print_row(line, is_table)?;
        }
    }
    Ok(())
}

fn print_row(line: &str, is_table: bool) -> anyhow::Result<()> {
    if !is_table {
        println!("{line}");
        return Ok(());
    }
    let row: serde_json::Value =
        serde_json::from_str(line).with_context(|| format!("'{line}' is not JSON"))?;
    let text = |name: &str| row[name].to_string().replace('"', "");
    let ok = if row["ok"] == true { "" } else { "  short" };
    println!(
        "{:<28} {:<20} {:>12} of {}{ok}",
        text("row"),
        text("scene"),
        text("value"),
        text("bar")
    );
    Ok(())
}

/// Installs what the integrations need.
fn tools() -> anyhow::Result<()> {
    if cfg!(target_os = "linux") {
        apt::install(&NEEDS, apt::apt_get)?;
    }
    Ok(())
}

fn demo_world() -> PathBuf {
    target_dir().join("demo").join("world.glb")
}

/// Returns the demo's world, and those of the first scenes.
fn worlds() -> Vec<PathBuf> {
    let baked = scenes().into_iter().map(|scene| world_of(&name_of(&scene)));
    std::iter::once(demo_world())
        .chain(baked.filter(|world| world.is_file()).take(N_SCENES))
        .collect()
}

/// Makes the demo and bakes the measured scenes, those that are there; returns their worlds.
fn fresh_worlds() -> anyhow::Result<Vec<PathBuf>> {
    let mut demo = Command::new(RELEASE.binary("enfilade"));
    let dir = target_dir().join("demo");
    let _ = std::fs::remove_dir_all(&dir);
    output_of(demo.arg("demo").arg("-o").arg(&dir))?;
    std::fs::create_dir_all(target_dir().join("scenes"))?;
    let mut worlds = vec![demo_world()];
    for scene in scenes() {
        let name = name_of(&scene);
        if MEASURED.contains(&name.as_str()) {
            output_of(&mut RELEASE.bake_command(&scene, &world_of(&name)))?;
            worlds.push(world_of(&name));
        }
    }
    Ok(worlds)
}

/// Compares readers in other languages with the command.
fn readers(profile: Profile, worlds: &[PathBuf]) -> Command {
    let mut node = Command::new("node");
    node.arg(integration("readers").join("check.mjs"));
    node.arg(profile.binary("enfilade")).args(worlds);
    node
}

/// Tests the C library on the worlds, its header, and programs in C.
fn abi(worlds: &[PathBuf]) -> anyhow::Result<()> {
    let worlds = std::env::join_paths(worlds)?;
    for (command, more) in [
        ("clippy", &["--all-targets", "--", "-D", "warnings"][..]),
        // With the optimization of the library that others link: the same build makes the oracle of the browser's tests.
        ("test", &["--release"]),
    ] {
        let mut cargo = in_workspace("abi", &[command]);
        run_to_end(cargo.args(more).env("ENFILADE_WORLDS", &worlds))?;
    }
    Ok(())
}

/// Measures culling in Bevy: pictures of the worlds, and the gain in those that are furnished first.
fn bevy_figures(args: &[&str], worlds: &[PathBuf]) -> Command {
    let mut command = bevy("run");
    command.args(["--example", "measure", "--"]);
    command.args(["--size", "160x100"]).args(args).args(worlds);
    command
}

/// Installs the packages of the browser's package, and builds it anew: module, code, walk.
/// The module that bakes is built with a profile of its own.
fn build_web(profile: &str) -> anyhow::Result<()> {
    // Worlds of an earlier build.
    let _ = std::fs::remove_dir_all(integration("web").join("dist"));
    for args in [
        &["ci", "--silent"][..],
        &["run", "-s", "wasm"],
        &["run", "-s", "bake"],
        &["run", "-s", "build"],
    ] {
        // Rows alone go to standard output.
        let mut npm = web("npm", GATE, args);
        npm.env("BAKE_PROFILE", profile);
        run_to_end(npm.stdout(std::io::stderr()))?;
    }
    Ok(())
}

/// Returns a command in the folder of the browser's package, which takes worlds from the command of a profile.
fn web(program: &str, profile: Profile, args: &[&str]) -> Command {
    let mut command = Command::new(program);
    command.current_dir(integration("web")).args(args);
    command.env("ENFILADE", profile.binary("enfilade"));
    command.env("CARGO_TARGET_DIR", engine_builds());
    command
}

/// Returns a cargo command in the workspace of an integration.
fn in_workspace(name: &str, args: &[&str]) -> Command {
    let mut command = cargo(args);
    command.current_dir(integration(name));
    command.env("CARGO_TARGET_DIR", engine_builds());
    command
}
