"""The notebook runs from its own text, and says what is stored in it. OHMSTRAIN_STORE=1 stores what it says now."""

import os
from pathlib import Path

import pytest
from conftest import PROGRAM

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
NOTEBOOK = Path(__file__).parents[1] / "examples/ohmstrain.ipynb"


def outputs(notebook):
    return [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]


def texts(notebook):
    return [output.get("text", output.get("data", {}).get("text/plain")) for output in outputs(notebook)]


def test_notebook(monkeypatch):
    monkeypatch.setenv("OHMSTRAIN", PROGRAM)
    monkeypatch.setenv("PYTHONWARNINGS", "ignore")
    stored = nbformat.read(NOTEBOOK, as_version=4)
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbclient.NotebookClient(notebook, timeout=600, kernel_name="python3", record_timing=False).execute()
    if os.environ.get("OHMSTRAIN_STORE"):
        notebook.metadata.language_info = {"name": "python"}
        nbformat.write(notebook, NOTEBOOK)
        stored = notebook
    for one in (notebook, stored):
        assert sum("image/png" in output.get("data", {}) for output in outputs(one)) == 2
        assert any("Verdict" in text for text in texts(one))
    assert texts(stored) == texts(notebook)
    assert NOTEBOOK.stat().st_size < 200_000 and str(Path.home()) not in NOTEBOOK.read_text(encoding="utf-8")
