"""Sonde: a simulator of the compression-ultrasound examination of the leg.

    import numpy as np, sonde
    leg = sonde.Leg.limb(seed=3, bmi=24)
    found = sonde.press(leg, leg.places["popliteal"], force_n=8)
    batch = sonde.Batch(leg, count=16, drive="force", size=(128, 128))
    batch.step(np.zeros((16, 7)))
    images = np.asarray(batch.images)        # no copy: the batch's own memory

Legs are synthetic. Lengths are metres, forces newtons; names say where it is otherwise. A pose is
x y z and a quaternion w x y z that takes the probe's frame to the leg's: x along the face, z into
the tissue. docs/python.md tells more.
"""
import os as _os

from ._sonde import (Batch, Exam, Leg, Rows, __version__, fit, image, pathologies, predict,
                     press)

__all__ = ["Batch", "Exam", "Leg", "Rows", "__version__", "cases", "data_file", "fit", "image",
           "pathologies", "predict", "press", "protocols", "scanners", "thigh"]

_DATA = _os.path.join(_os.path.dirname(_os.path.abspath(__file__)), "data")


def data_file(*names: str) -> str:
    """Path of a file that comes with the package, e.g. data_file("scanners", "venous.yaml")."""
    path = _os.path.join(_DATA, *names)
    if not _os.path.exists(path):
        raise FileNotFoundError(f"{path}: not part of this build of the package sonde")
    return path


def _list(folder: str) -> dict[str, str]:
    names = sorted(_os.listdir(data_file(folder)))
    return {n[:-5]: _os.path.join(_DATA, folder, n) for n in names if n.endswith(".yaml")}


def cases() -> dict[str, str]:
    """Cases that come with the package: name to path."""
    return _list("cases")


def protocols() -> dict[str, str]:
    """Protocols of an examination: name to path."""
    return _list("protocols")


def scanners() -> dict[str, str]:
    """Scanners for Batch(scanner=...) and image(scanner=...): name to path."""
    return _list("scanners")


def thigh() -> Leg:
    """The bundled synthetic thigh, fitted to synthetic indentation data. It is small and fast."""
    return Leg.load(data_file("thigh.sonde"))
