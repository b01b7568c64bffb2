"""The first block of the documentation runs as it stands, where nothing but the wheel is installed."""

import re
import subprocess
import sys

import pytest
from conftest import ROOT

#: What `pip install` of the wheel alone does not bring.
OTHERS = ("dask", "matplotlib", "pandas", "polars", "pyspark", "ray", "sklearn")
WITHOUT = f"""
import sys

class Without:
    def find_spec(self, name, *_):
        if name.split(".")[0] in {OTHERS!r}:
            raise ModuleNotFoundError(name)

sys.meta_path.insert(0, Without())
"""


@pytest.mark.parametrize("page", ["docs/python.md", "crates/python/README.md"])
def test_first_block(page, tmp_path):
    block = re.search(r"```python\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)[1]
    done = subprocess.run([sys.executable, "-W", "error", "-c", WITHOUT + block], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "Verdict" in done.stdout and (tmp_path / "sensor.toml").is_file()
