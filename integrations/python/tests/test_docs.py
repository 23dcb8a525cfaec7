"""The code of README and tutorial runs."""

import os
import re
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


def test_the_package_is_typed_and_documented():
    import enfilade

    assert (Path(enfilade.__file__).parent / "py.typed").is_file()
    for name in enfilade.__all__:
        assert getattr(enfilade, name).__doc__, f"{name} has no docstring"
    for name, value in vars(enfilade.World).items():
        if not name.startswith("_"):
            assert (value.__func__ if isinstance(value, classmethod) else value).__doc__, name
    assert os.path.basename(enfilade._native.__file__).startswith("_native.abi3")
