"""The code of README and tutorial runs."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parent.parent


@pytest.mark.parametrize("page", ["README.md", "TUTORIAL.md"])
def test_the_code_of_a_page_runs(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = (FOLDER / page).read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    assert blocks
    names = {"__name__": page}
    for block in blocks:
        # Lines of an error are those of the page.
        line = text[: text.index(block)].count("\n")
        exec(compile("\n" * line + block, str(FOLDER / page), "exec"), names)
    said = capsys.readouterr().out
    if page == "README.md":
        promised = re.search(r"# (<Cells.*)$", text, re.MULTILINE)[1].strip()
        assert said.splitlines()[0] == promised


def test_the_notebook_runs(tmp_path, monkeypatch, capsys):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    cells = json.loads((FOLDER / "ROOMS.ipynb").read_text(encoding="utf-8"))["cells"]
    blocks = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    assert sum(block.count("\n") + 1 for block in blocks) <= 20
    names = {"__name__": "notebook"}
    for block in blocks:
        exec(compile(block, "ROOMS.ipynb", "exec"), names)
    assert "trust: good" in capsys.readouterr().out
    assert len(names["axes"]) == len(names["world"].storeys)


def test_programs_that_use_it_are_checked_strictly(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(
        "import enfilade\n\n"
        "def largest(path: str) -> enfilade.Room:\n"
        "    world = enfilade.bake(path)\n"
        "    return max(world.rooms, key=lambda room: room.floor_area)\n"
    )
    run = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(tmp_path), str(program), str(FOLDER / "python/enfilade")]
    done = subprocess.run(run, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_the_package_is_typed_and_documented():
    import enfilade

    assert (Path(enfilade.__file__).parent / "py.typed").is_file()
    for name in enfilade.__all__:
        assert getattr(enfilade, name).__doc__, f"{name} has no docstring"
    for name, value in vars(enfilade.World).items():
        if not name.startswith("_"):
            assert (value.__func__ if isinstance(value, classmethod) else value).__doc__, name
    assert os.path.basename(enfilade._native.__file__).startswith("_native.abi3")
