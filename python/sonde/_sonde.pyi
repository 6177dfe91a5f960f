from collections.abc import Sequence
from os import PathLike
from typing import Any, Literal, TypedDict

from typing_extensions import Buffer

__version__: str
Path = str | PathLike[str]
Pose = Sequence[float]
Triple = tuple[float, float, float]
Drive = Literal["pose", "twist", "force"]

class Rows(Buffer):
    """An array of a batch; numpy.asarray() makes a read-only view of it without a copy."""

class VeinPoint(TypedDict):
    vein_m: Triple
    pose: tuple[float, ...]
    along_m: float
    radius_m: float
    depth_m: float
    segment: str

class Leg:
    name: str
    nodes: int
    places: dict[str, tuple[float, ...]]
    vein: list[VeinPoint]
    segments: list[str]
    diagnosis: str | None
    @classmethod
    def limb(cls, seed: int = 1, /, **body: float | str) -> Leg: ...
    @classmethod
    def load(cls, path: Path, /) -> Leg: ...
    @classmethod
    def case(cls, path: Path, bundled: Path | None = None) -> Leg: ...
    def save(self, path: Path, /) -> None: ...
    def skin(self) -> tuple[Rows, Rows]: ...

class Batch:
    count: int
    pose: Rows
    wrench: Rows
    vessel: Rows
    time_s: Rows
    flags: Rows
    images: Rows | None
    vessel_names: tuple[str, ...]
    image_size_m: tuple[float, float]
    def __init__(self, legs: Leg | Sequence[Leg], count: int = 0, probe: str = "linear",
                 drive: Drive = "twist", ticks: int = 20, threads: int = 0, inside: bool = True,
                 size: tuple[int, int] | None = None, scanner: Path | None = None,
                 friction: float = 0.0, speed: float = 0.2, turning: float = 2.0,
                 force_limit_n: float = 40.0, admittance: float = 0.02) -> None: ...
    def reset(self, index: int, pose: Pose | None = None, pathology: str | None = None,
              extent_m: tuple[float, float] | None = None, venous_mmhg: float = ...,
              stiffness: float = 1.0, damping: float = 1.0, friction: float = 1.0,
              gain_db: float = ..., depth_mm: float = ..., frequency_mhz: float = ...) -> None: ...
    def step(self, actions: Buffer, mask: Buffer | None = None) -> None: ...
    def save(self, index: int, /) -> bytes: ...
    def restore(self, index: int, saved: Buffer, /) -> None: ...
    def start_pose(self, index: int, /) -> tuple[float, ...]: ...
    def hash(self) -> int: ...

class Exam:
    places: list[dict[str, Any]]
    def __init__(self, leg: Leg, protocol: Path) -> None: ...
    def restart(self) -> None: ...
    def feed(self, batch: Batch, index: int, /) -> None: ...
    def guidance(self) -> dict[str, Any]: ...
    def segments(self) -> dict[str, dict[str, Any]]: ...
    def decide(self, segment: str, decision: Literal["compressible", "clot", "not_seen"], /) -> None: ...
    def score(self) -> dict[str, Any]: ...

def press(leg: Leg, pose: Pose, force_n: float = ..., depth_mm: float = ...,
          probe: str = "linear") -> dict[str, Any]: ...
def image(leg: Leg, pose: Pose, force_n: float = ..., depth_mm: float = ..., probe: str = "linear",
          size: tuple[int, int] | None = None, scanner: Path | None = None,
          image_depth_mm: float = ...) -> dict[str, Any]: ...
def fit(surface: Path, measurements: Path, sites: Path, femur: Path | None = None,
        fat: Path | None = None, muscle: Path | None = None, stages: int = 3,
        threads: int = 0) -> dict[str, Any]: ...
def predict(leg: Leg, measurements: Path, sites: Path | None = None,
            full: bool = True) -> dict[str, Any]: ...
def pathologies() -> list[str]: ...
