"""Moving pictures as files: GIF by pillow, MP4 where the program ffmpeg is there."""

import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from equimorph.errors import InputError

COLOURS = 64
"""Size of the palette that all pictures share."""
PAUSE_FIRST, PAUSE_LAST = 0.8, 1.6
"""Seconds for which the first and the last picture are shown."""
HUNDREDTHS = 10
"""Milliseconds in a hundredth of a second, the unit of time in GIF files."""
EVEN = "pad=ceil(iw/2)*2:ceil(ih/2)*2"
"""Filter of ffmpeg: players expect even numbers of pixels."""


def film_file(path: str | Path) -> Path:
    """Return the path of a film that can be written here.

    Raises
    ------
    InputError
        If it is neither a GIF nor, with ffmpeg at hand, an MP4.
    """
    file = Path(path)
    kinds = suffixes()
    if file.suffix.lower() not in kinds:
        missing = "" if len(kinds) > 1 else " (.mp4 needs the program ffmpeg)"
        raise InputError(
            f"`path` of a film must end in {' or '.join(kinds)}{missing}; got {file.name!r}."
        )
    return file


def suffixes() -> tuple[str, ...]:
    """Kinds of files that films can be written to on this machine."""
    return (".gif", ".mp4") if shutil.which("ffmpeg") else (".gif",)


def write_film(pictures: Sequence[Image.Image], file: Path, fps: int) -> None:
    """Write pictures as a film; the first and the last one stay longer.

    Parameters
    ----------
    pictures
        All of one size.
    file
        What `film_file` returned.
    fps
        Pictures per second, at most 50.
    """
    each = max(2, round(100 / fps)) * HUNDREDTHS
    shown = [int(1000 * PAUSE_FIRST), *[each] * (len(pictures) - 2), int(1000 * PAUSE_LAST)]
    if file.suffix.lower() == ".gif":
        _write_gif(pictures, file, shown)
        return
    with tempfile.TemporaryDirectory() as folder:
        still = Path(folder, "film.gif")
        _write_gif(pictures, still, shown)
        convert(still, file)


def convert(gif: Path, mp4: Path) -> None:
    """Write a GIF as an MP4 by ffmpeg.

    Raises
    ------
    OSError
        If ffmpeg cannot, with its last line.
    """
    command = ["ffmpeg", "-y", "-loglevel", "error", "-i", str(gif), "-vf", EVEN]
    command += ["-pix_fmt", "yuv420p", "-movflags", "+faststart", str(mp4)]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    if ran.returncode:
        raise OSError(f"ffmpeg cannot write {mp4.name}: {ran.stderr.strip().splitlines()[-1]}")


def _write_gif(pictures: Sequence[Image.Image], file: Path, durations: list[int]) -> None:
    """Write an endless GIF with one palette, so that still parts cost nothing."""
    # The palette is made from pictures all along the way: none of the colours is missed.
    sample = [np.asarray(pictures[k]) for k in np.linspace(0, len(pictures) - 1, 4).astype(int)]
    palette = Image.fromarray(np.concatenate(sample)).quantize(COLOURS, Image.Quantize.MAXCOVERAGE)
    reduced = [each.quantize(palette=palette, dither=Image.Dither.NONE) for each in pictures]
    reduced[0].save(
        file, save_all=True, append_images=reduced[1:], duration=durations, loop=0, optimize=False
    )
