"""Runs every notebook of this folder from top to bottom; what they assert must hold. With a folder as argument, writes them there with
their outputs."""

import pathlib
import sys

import nbclient
import nbformat

here = pathlib.Path(__file__).parent
notebooks = sorted(here.glob("*.ipynb"))
assert notebooks
for path in notebooks:
    notebook = nbformat.read(path, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), f"{path.name}: outputs are not kept in the repository"
    nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": here}}).execute()
    if len(sys.argv) > 1:
        nbformat.write(notebook, pathlib.Path(sys.argv[1]) / path.name)
    print(f"{path.name}: {sum(cell.cell_type == 'code' for cell in notebook.cells)} cells run")
