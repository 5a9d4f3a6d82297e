"""Pictures of the plies of a stack in the folder of a run."""

from skfem_textile.cli.results import PICTURES, captions


def test_captions_name_the_ply_of_a_picture(tmp_path):
    for name in "ply_1_formed.png", "ply_12_formed.png", "ply_2_other.png":
        (tmp_path / name).touch()
    found = captions(tmp_path)
    assert set(found) - set(PICTURES) == {"ply_1_formed.png", "ply_12_formed.png"}
    assert found["ply_12_formed.png"].startswith("Ply 12: shear angle, fibres")
