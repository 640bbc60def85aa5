"""The notebook of the examples runs from top to bottom and shows what it says."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from places import EXAMPLES

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of the kernel's own packages
def test_the_notebook_solves_plots_and_embeds_the_replay(tmp_path, monkeypatch):
    source = Path(__file__).parents[1] / "src"
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, [str(source), os.environ.get("PYTHONPATH")])))
    notebook = nbformat.read(EXAMPLES / "08_look.ipynb", as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "outputs are not kept in the repository"
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    printed = "".join(output.text for output in outputs if output.output_type == "stream" and output.name == "stdout")
    shown = [set(output.data) for output in outputs if output.output_type == "execute_result"]
    assert "optimal after" in printed
    assert "properties hold" in printed
    assert [kind & {"image/png", "text/html"} for kind in shown] == [{"image/png"}, {"image/png"}, {"text/html"}]
    assert 'srcdoc="&lt;!DOCTYPE html&gt;' in outputs[-1].data["text/html"]
