# SPDX-License-Identifier: Apache-2.0
"""Patient positioning from hand-held RGB-D sweeps. Research use only."""
from os import PathLike
from typing import Any, Callable, Dict, Iterator, List, Optional, Sequence, Union

import numpy as np
from numpy.typing import NDArray

Path = Union[str, "PathLike[str]"]
Progress = Callable[[str, float], None]
__version__: str

class DataError(ValueError):
    """Input that is missing, damaged or contradictory."""

class IoError(OSError):
    """The system refused a read or a write."""

class Frame:
    index: int
    color_time_s: float
    depth_time_s: float
    @property
    def color(self) -> NDArray[np.uint8]: ...
    @property
    def depth_m(self) -> NDArray[np.float32]: ...

class Recording:
    def __init__(self, folder: Path) -> None: ...
    camera_matrix: NDArray[np.float64]
    marker_length_m: float
    warnings: List[str]
    def __iter__(self) -> Iterator[Frame]: ...
    def __next__(self) -> Frame: ...

class SceneParts:
    def __init__(self, cloud: bool = True, height_map: bool = True, mesh: bool = True) -> None: ...

class Scene:
    @staticmethod
    def load(folder: Path, parts: SceneParts = ...) -> Scene: ...
    def save(self, folder: Path) -> None: ...
    preset: str
    frame: str
    markers: Dict[int, NDArray[np.float64]]
    marker_sigmas_m: Dict[int, float]
    keyframe_poses: NDArray[np.float64]
    keyframe_times_s: NDArray[np.float64]
    poses: NDArray[np.float64]
    times_s: NDArray[np.float64]
    frames_total: int
    frames_tracked: int
    points: NDArray[np.float32]
    normals: NDArray[np.float32]
    colors: NDArray[np.uint8]
    vertices: NDArray[np.float32]
    vertex_colors: NDArray[np.uint8]
    triangles: NDArray[np.uint32]
    heights: Optional[NDArray[np.float32]]
    grid: Optional[Dict[str, float]]
    calibration: Dict[str, float]
    calibration_sigma: Dict[str, float]
    calibration_prior_sigma: Dict[str, float]
    timings_s: Dict[str, float]
    warnings: List[str]

class Comparison:
    verdict: str
    reasons: List[str]
    warnings: List[str]
    T_reference_current: Optional[NDArray[np.float64]]
    motion: Optional[NDArray[np.float64]]
    covariance: Optional[NDArray[np.float64]]
    correction: Optional[Dict[str, Optional[float]]]
    u95: Optional[Dict[str, Optional[float]]]
    deviation_m: Optional[NDArray[np.float32]]
    distance_m: Optional[NDArray[np.float32]]
    deviation_after_m: Optional[NDArray[np.float32]]
    deformation: Optional[Dict[str, NDArray[np.float32]]]
    def to_json(self) -> str: ...

def reconstruct(
    recording: Path, preset: str = "best", progress: Optional[Progress] = None
) -> Scene: ...
def compare(
    reference: Scene,
    current: Scene,
    preset: str = "best",
    region_m: Sequence[Sequence[float]] = (),
    isocentre_m: Optional[Sequence[float]] = None,
    shift_tolerance_mm: float = 3.0,
    rotation_tolerance_deg: float = 1.0,
    posture: str = "HFS",
    marker_kind: str = "room",
    T_iec_reference: Optional[Union[NDArray[np.float64], Sequence[Sequence[float]]]] = None,
) -> Comparison: ...
def evaluate(
    suite: Path, preset: str = "best", progress: Optional[Progress] = None
) -> Dict[str, Any]: ...
