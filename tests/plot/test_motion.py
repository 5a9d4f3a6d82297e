"""Animations: frames, videos by ffmpeg, and what is missing."""

import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("pyvista")
Image = pytest.importorskip("PIL.Image")
plot = pytest.importorskip("skfem_textile.plot")
pictures = pytest.importorskip("skfem_textile.plot.pictures")
sheet = pytest.importorskip("skfem_textile.plot.sheet")

SIZE = 41  # mm: an odd number of pixels, which codecs refuse


@pytest.fixture
def recorded(tmp_path, monkeypatch):
    """A program named ffmpeg that writes its input, or fails with a reason."""

    def record(then="cat > ${@: -1}"):
        folder = tmp_path / "bin"
        folder.mkdir(exist_ok=True)
        program = folder / "ffmpeg"
        program.write_text(f'#!/bin/bash\necho "$@" > {tmp_path}/arguments\n{then}\n')
        program.chmod(0o755)
        monkeypatch.setenv("PATH", str(folder), prepend=":")

    return record


def test_a_video_has_all_frames_and_rests_on_the_last_one(result, tmp_path, recorded):
    recorded()
    file = tmp_path / "x.webm"
    result = replace(result, states=result.states[::4])
    plot.animation(result, file, size=SIZE)
    arguments = (tmp_path / "arguments").read_text().split()
    width, height = map(int, arguments[arguments.index("-s") + 1].split("x"))
    assert width % 2 == height % 2 == 0
    assert width == pytest.approx(SIZE / 25.4 * 300, abs=2)
    frames = np.frombuffer(file.read_bytes(), np.uint8).reshape(-1, height, width, 3)
    states = len(result.states)
    assert len(frames) > states
    moving, resting = frames[:states], frames[states - 1 :]
    assert len({frame.tobytes() for frame in moving}) == states
    assert len({frame.tobytes() for frame in resting}) == 1


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not installed")
@pytest.mark.parametrize(("suffix", "codec"), [("webm", "vp9"), ("mp4", "h264")])
def test_ffmpeg_writes_the_codec_of_the_suffix(result, tmp_path, suffix, codec):
    file = tmp_path / f"x.{suffix}"
    plot.animation(result, file, size=SIZE)
    asked = ["ffprobe", "-v", "error", "-show_entries", "stream=codec_name,pix_fmt"]
    shown = subprocess.run([*asked, file], capture_output=True, text=True, check=True)
    assert f"codec_name={codec}" in shown.stdout
    assert "pix_fmt=yuv420p" in shown.stdout
    assert [x.name for x in tmp_path.iterdir()] == [file.name]


def test_the_reason_of_ffmpeg_is_the_error(result, tmp_path, recorded, monkeypatch):
    pixels = [np.zeros((8, 8, 3), np.uint8)]
    monkeypatch.setattr(pictures, "_drawn", lambda *_: pixels)
    recorded('cat > /dev/null; echo "Unknown encoder" >&2; exit 1')
    with pytest.raises(RuntimeError, match=r"ffmpeg failed: Unknown encoder$"):
        plot.animation(result, tmp_path / "x.webm", size=SIZE)
    assert not (tmp_path / "x.webm").exists()


@pytest.mark.parametrize(("states", "duration"), [(5, 120), (50, 80)])
def test_many_states_are_shown_faster(result, tmp_path, states, duration, monkeypatch):
    pixels = [np.full((8, 8, 3), i, np.uint8) for i in range(states)]
    monkeypatch.setattr(pictures, "_drawn", lambda *_: pixels)
    many = replace(result, states=(10 * result.states)[:states])
    plot.animation(many, tmp_path / "x.gif")
    with Image.open(tmp_path / "x.gif") as moving:
        assert moving.info["duration"] == duration
        moving.seek(states - 1)
        assert moving.info["duration"] == duration + 1000


def test_fibres_on_a_field_are_dark_and_have_one_key(result, sheets):
    plot.field(result, fibres=True)
    drawn = sheets[-1][0]
    lines = sheet.lines_of(drawn.panels[0], 1.0, None)
    assert [x.colour for x in lines[-2:]] == [sheet.THREAD] * 2
    assert drawn.legends[0].keys == sheet.THREADS
    plot.field(result)
    assert sheets[-1][0].panels[0].fibres is None
    assert not sheets[-1][0].legends[0].keys
