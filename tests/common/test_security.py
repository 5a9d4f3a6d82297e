"""Files of strangers are data: reading them executes nothing."""

import pickle
from pathlib import Path

import numpy as np
import pytest

from skfem_textile.cases import case_from_file
from skfem_textile.solve import checksummed


class Touch:
    """An object whose unpickling creates a file."""

    def __init__(self, file):
        self.file = file

    def __reduce__(self):
        return Path.touch, (self.file,)


def test_a_checkpoint_with_a_pickled_object_is_refused(tmp_path):
    made = tmp_path / "made"
    pickle.loads(pickle.dumps(Touch(made)))
    assert made.exists()
    made.unlink()
    file, run = tmp_path / "run", "0" * 32
    content = np.array([Touch(made)], dtype=object)
    checksummed.write(file, run, "run", {}, {"u": content})
    with pytest.raises(ValueError, match="pickle"):
        checksummed.read(file, run)
    assert not made.exists()


@pytest.mark.parametrize(
    "line",
    ["fabric.tension_N_per_mm", "fabric.fibres_deg", "mesh.file", "scene", "run.name"],
)
def test_code_in_a_case_file_is_not_executed(tmp_path, line):
    made, file = tmp_path / "made", tmp_path / "case.toml"
    file.write_text(f"""{line} = "__import__('pathlib').Path('{made}').touch()"\n""")
    with pytest.raises(ValueError, match=r"case\.toml"):
        case_from_file(file)
    assert not made.exists()
