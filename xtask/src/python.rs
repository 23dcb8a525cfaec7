//! The package for Python: linted and built as a wheel, installed into an environment of its own, and tested there.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, bail};

use crate::apt::Need;
use crate::{GATE, engine_builds, integration, lint, output_of, run_to_end, tools_dir};

/// The language itself.
pub(crate) const NEED: Need = Need {
    what: "Python 3.9 or later with venv",
    why: "builds and tests the package for Python",
    packages: &["python3", "python3-venv"],
    is_there: || {
        let program = "import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 9))";
        let found = Command::new("python3").args(["-c", program]).output();
        found.is_ok_and(|done| done.status.success())
    },
};

/// Builds the wheel and runs the tests on what it installs, with the command and worlds to compare answers with.
pub(crate) fn test(worlds: &[PathBuf]) -> anyhow::Result<()> {
    let python = environment()?;
    let wheel = build(&python)?;
    let pip = [
        "-m",
        "pip",
        "install",
        "--quiet",
        "--force-reinstall",
        "--no-deps",
    ];
    run_to_end(Command::new(&python).args(pip).arg(wheel))?;
    let mut pytest = Command::new(&python);
    // In the folder of the tests: above them, the package's sources would hide what is installed.
    pytest.current_dir(integration("python").join("tests"));
    pytest.args(["-m", "pytest", "-q", "-p", "no:cacheprovider", "."]);
    pytest.env("PYTHONDONTWRITEBYTECODE", "1");
    pytest.env("ENFILADE", GATE.binary("enfilade"));
    pytest.env("ENFILADE_WORLDS", std::env::join_paths(worlds)?);
    run_to_end(&mut pytest)
}

/// Returns the Python of an environment that has the tools, and installs them if it has not.
fn environment() -> anyhow::Result<PathBuf> {
    let dir = tools_dir().join("python");
    let bin = if cfg!(windows) { "Scripts" } else { "bin" };
    let python = dir.join(bin).join("python");
    let wanted = std::fs::read_to_string(integration("python").join("requirements.txt"))?;
    let installed = dir.join("installed.txt");
    if std::fs::read_to_string(&installed).is_ok_and(|has| has == wanted) {
        return Ok(python);
    }
    println!("installing packages of Python into {}", dir.display());
    let _ = std::fs::remove_dir_all(&dir);
    run_to_end(Command::new("python3").args(["-m", "venv"]).arg(&dir))?;
    let mut pip = Command::new(&python);
    pip.args([
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
        "-r",
    ]);
    run_to_end(pip.arg(integration("python").join("requirements.txt")))?;
    // Last, so that an installation that was cut off is made again.
    std::fs::write(&installed, wanted)?;
    Ok(python)
}

/// Builds the wheel, and returns its path.
fn build(python: &Path) -> anyhow::Result<PathBuf> {
    let dir = engine_builds().join("wheels");
    // A wheel of an earlier version would be a second one.
    let _ = std::fs::remove_dir_all(&dir);
    let mut maturin = Command::new(python);
    maturin.current_dir(integration("python"));
    maturin.args([
        "-m",
        "maturin",
        "build",
        "--quiet",
        "--locked",
        "--profile",
        GATE.0,
    ]);
    maturin.arg("--out").arg(&dir);
    maturin.env("CARGO_TARGET_DIR", engine_builds());
    lint(&mut maturin);
    // Its progress is of interest only if it fails.
    output_of(&mut maturin)?;
    let found = std::fs::read_dir(&dir)?.next();
    let Some(wheel) = found.transpose()? else {
        bail!("maturin left no wheel in {}", dir.display());
    };
    let size = wheel.metadata().context("a wheel")?.len();
    println!("{}, {:.1} MB", wheel.path().display(), size as f64 / 1e6);
    Ok(wheel.path())
}
