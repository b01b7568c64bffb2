"""The notebook runs from its own text."""

from pathlib import Path

import pytest
from conftest import PROGRAM

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")


def test_notebook(monkeypatch):
    monkeypatch.setenv("OHMSTRAIN", PROGRAM)
    monkeypatch.setenv("PYTHONWARNINGS", "ignore")
    notebook = nbformat.read(Path(__file__).parents[1] / "examples/ohmstrain.ipynb", as_version=4)
    nbclient.NotebookClient(notebook, timeout=600, kernel_name="python3").execute()
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 2
    assert any("Verdict" in output.get("data", {}).get("text/plain", "") for output in outputs)
