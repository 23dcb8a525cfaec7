//! `cargo xtask test`: all checks that must pass before a change lands.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use anyhow::{bail, ensure};

use crate::steps::Steps;
use crate::{
    GATE, add_scene_files, api, apt, cargo, dependencies, engines, features, installed, name_of,
    node_path, output_of, root, run_to_end, scenes, suites, target_dir, tidy, tools_dir, world_of,
};

/// Segments and rays tested on each scene; the full 10⁷ are run by hand.
const RAYS: &str = "200000";

/// Views of each scene in which the run-time's answer, details included, is compared with what rays hit.
const SIGHT_VIEWS: &str = "200";

/// Extent of a test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Checks {
    /// Every step.
    All,
    /// The integrations with engines, on the demo and on the worlds that were baked last.
    Engines,
}

/// Runs all steps, stops at the first failure, and prints `N passed, N failed` last.
pub(crate) fn run(what: Checks) -> anyhow::Result<()> {
    let start = Instant::now();
    let mut steps = Steps::default();
    let result = match what {
        Checks::All => run_steps(&mut steps).and_then(|()| engines::run_steps(&mut steps)),
        Checks::Engines => run_engines(&mut steps),
    };
    println!("all of it took {:.0} s", start.elapsed().as_secs_f64());
    if let Err(error) = &result {
        println!("{error:#}");
    }
    let n_failed = usize::from(result.is_err());
    println!("{} passed, {n_failed} failed", steps.passed);
    result
}

fn run_steps(steps: &mut Steps) -> anyhow::Result<()> {
    steps.step("tools", tools)?;
    steps.step("tidy", tidy::run)?;
    steps.step("dependencies", dependencies::run_with_tool)?;
    steps.step("format", || {
        run_to_end(&mut cargo(&["fmt", "--all", "--check"]))
    })?;
    steps.step("features", features::run)?;
    // Builds what the steps below run, too: a build without the features of tests compiles half of all once more.
    steps.step("lint and tests", suites::run)?;
    steps.step("lint without features", || {
        // As a server that only bakes builds it.
        let args = ["--package=enfilade-cli", "--no-default-features"];
        run_to_end(GATE.cargo("clippy", &args).args(["--", "-D", "warnings"]))
    })?;
    steps.step("docs", || {
        run_to_end(
            GATE.cargo("doc", &api::DOC)
                .env("RUSTDOCFLAGS", "-D warnings"),
        )
    })?;
    steps.step("api", || api::run(false))?;
    steps.step("fuzz", || {
        // A separate workspace, which no step above builds.
        let mut check = cargo(&[
            "check",
            "--manifest-path",
            "fuzz/Cargo.toml",
            "--all-targets",
        ]);
        run_to_end(check.arg("--target-dir").arg(target_dir().join("fuzz")))
    })?;
    steps.step("package", package)?;
    steps.step("demo", demo)?;
    steps.step("installed", || installed::run(&demo_world()))?;
    let scenes = scenes();
    for scene in &scenes {
        let name = name_of(scene);
        steps.step(&format!("scene {name}"), || check_scene(scene, &name))?;
    }
    if scenes.is_empty() {
        println!("no real scenes: set ENFILADE_SCENES to their folder to run them too");
    } else {
        steps.step("score", || check_scores(&scenes))?;
    }
    Ok(())
}

/// Runs the steps of the integrations, and before them those that they cannot do without.
fn run_engines(steps: &mut Steps) -> anyhow::Result<()> {
    steps.step("tools", tools)?;
    steps.step("build", || {
        run_to_end(&mut GATE.cargo("build", &["-p", "enfilade-cli"]))
    })?;
    steps.step("demo", demo)?;
    engines::run_steps(steps)?;
    engines::lint_page(steps)?;
    engines::test_bevy(steps)
}

/// Packages of node that tests run: the Khronos glTF validator, and a reader of IFC.
const NODE_PACKAGES: [(&str, &str); 2] =
    [("gltf-validator", "2.0.0-dev.3.10"), ("web-ifc", "0.0.78")];

/// Reports missing tools, a line each, and installs those it can: packages of node, below the target folder, and those of
/// `apt`.
fn tools() -> anyhow::Result<()> {
    let has = |name: &str| {
        Command::new(name)
            .arg("--version")
            .output()
            .is_ok_and(|o| o.status.success())
    };
    let needed = [
        ("git", "lists the files to check", "apt-get install git"),
        (
            "node",
            "runs the glTF validator and web-ifc",
            "apt-get install nodejs",
        ),
        ("npm", "installs packages of node", "apt-get install npm"),
    ];
    let missing: Vec<String> = needed
        .iter()
        .filter(|n| !has(n.0))
        .map(|(name, why, how)| format!("missing: {name}, which {why}; `{how}` or equivalent"))
        .collect();
    if !missing.is_empty() {
        bail!("{}", missing.join("\n"));
    }
    if cfg!(target_os = "linux") {
        apt::install(&apt::NEEDS, apt::apt_get)?;
        apt::try_install(&apt::WANTS, apt::apt_get);
    }
    let missing = NODE_PACKAGES.iter();
    let missing: Vec<String> = missing
        .filter(|(name, _)| !node_path().join(name).is_dir())
        .map(|(name, version)| format!("{name}@{version}"))
        .collect();
    if !missing.is_empty() {
        std::fs::create_dir_all(tools_dir())?;
        let names = missing.join(" ");
        println!("installing {names} into {}", tools_dir().display());
        let npm = ["install", "--no-audit", "--no-fund", "--prefix", "."];
        run_to_end(
            Command::new("npm")
                .current_dir(tools_dir())
                .args(npm)
                .args(missing),
        )?;
    }
    Ok(())
}

fn validate(world: &Path) -> anyhow::Result<()> {
    let mut node = Command::new("node");
    node.current_dir(root())
        .env("NODE_PATH", node_path())
        .arg("scripts/validate_gltf.mjs")
        .arg(world);
    let said = output_of(&mut node)?;
    print!(
        "{}",
        said.lines()
            .next()
            .map(|l| format!("{l}\n"))
            .unwrap_or_default()
    );
    Ok(())
}

/// Tests the promises of a world. With the folder of its scene, the triangles of the scene's files block, not those
/// that the world contains.
fn verify(world: &Path, scene: Option<&Path>) -> anyhow::Result<()> {
    let mut command = Command::new(GATE.binary("enfilade"));
    command.arg("verify").arg(world).args(["--rays", RAYS]);
    if let Some(scene) = scene {
        command.args(["--sight", SIGHT_VIEWS]);
        add_scene_files(&mut command, scene, Some("--source"));
    }
    print!("{}", output_of(&mut command)?);
    Ok(())
}

/// Packs every crate that will be published, as if its dependencies were published already; builds none of them. A warning
/// is an error.
fn package() -> anyhow::Result<()> {
    // Packages of an earlier version.
    let _ = std::fs::remove_dir_all(target_dir().join("package"));
    let args = [
        "package",
        "--workspace",
        "--exclude=xtask",
        "--exclude=enfilade-bench",
        "--exclude=enfilade-testkit",
        "--no-verify",
        "--allow-dirty",
        "--quiet",
    ];
    let mut packages = cargo(&args);
    let done = packages.output()?;
    let said = String::from_utf8_lossy(&done.stderr);
    ensure!(
        done.status.success() && !said.contains("warning"),
        "{packages:?}:\n{said}"
    );
    Ok(())
}

fn demo() -> anyhow::Result<()> {
    let dir = target_dir().join("demo");
    // Files of an earlier version would be in the way.
    let _ = std::fs::remove_dir_all(&dir);
    let mut demo = Command::new(GATE.binary("enfilade"));
    print!("{}", output_of(demo.arg("demo").arg("-o").arg(&dir))?);
    let world = demo_world();
    validate(&world)?;
    verify(&world, None)
}

/// Path of the world that the step `demo` makes.
fn demo_world() -> PathBuf {
    target_dir().join("demo").join("world.glb")
}

fn check_scene(scene: &Path, name: &str) -> anyhow::Result<()> {
    let world = world_of(name);
    std::fs::create_dir_all(target_dir().join("scenes"))?;
    print!("{}", output_of(&mut GATE.bake_command(scene, &world))?);
    validate(&world)?;
    verify(&world, Some(scene))?;
    check_order(scene, name, &world)
}

/// Bakes the scene again with its triangles, vertices, nodes and all other lists shuffled: the bytes must not differ.
fn check_order(scene: &Path, name: &str, world: &Path) -> anyhow::Result<()> {
    let folder = target_dir().join("scenes").join(format!("{name}-shuffled"));
    let mut generate = Command::new(GATE.binary("examples/generate"));
    generate
        .arg(scene)
        .args(["--shuffle", "1", "-o"])
        .arg(&folder);
    output_of(&mut generate)?;
    let other = folder.join("world.glb");
    output_of(&mut GATE.bake_command(&folder, &other))?;
    if std::fs::read(world)? != std::fs::read(&other)? {
        bail!(
            "{} and {}, of the same scene in another order, differ",
            world.display(),
            other.display()
        );
    }
    Ok(())
}

/// Scores the freshly baked worlds; fails if a figure lies below its floor.
fn check_scores(scenes: &[PathBuf]) -> anyhow::Result<()> {
    let mut known = scenes
        .iter()
        .filter(|s| s.join("truth.json").is_file())
        .peekable();
    if known.peek().is_some() {
        let mut score = Command::new(GATE.binary("enfilade-bench"));
        score.arg("score").args(known);
        score.arg("--baked").arg(target_dir().join("scenes"));
        print!("{}", output_of(&mut score)?);
    }
    Ok(())
}
