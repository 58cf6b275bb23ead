"""Print the lower bounds of pyproject.toml as constraints for pip: `pip install -c lowest.txt`."""

import re
from pathlib import Path

text = (Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8")
bounds = re.findall(
    r'"([A-Za-z0-9_-]+)(?:\[\w+\])?>=([0-9.]+)', text.split("[project]")[1].split("[project.scripts]")[0]
)
# What only makes the docs or checks the code is not what users run.
print("\n".join(f"{name}=={bound}" for name, bound in bounds if name not in {"pytest", "ruff", "mypy", "setuptools"}))
