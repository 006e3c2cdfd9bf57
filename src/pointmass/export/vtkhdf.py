"""Frames as one file of VTK's HDF5 format, which ParaView plays."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from pointmass.export.exporter import About
from pointmass.export.vtp import particles
from pointmass.frame import Frame

LEVEL = 4  # of compression, of 9


def write_vtkhdf(frames: Iterable[Frame], path: Path, about: About) -> None:
    """What `write_vtp` writes of a frame, for all frames, with their times in single precision, in one compressed file.

    Meshes with vertices of their own, such as colliders, are left out: they would be written for each frame; `.pvd`
    has them.
    """
    from vtkmodules.vtkIOHDF import vtkHDFWriter

    writer = vtkHDFWriter()
    source = _source(iter(frames), about.times)
    writer.SetInputConnection(source.GetOutputPort())
    writer.SetFileName(str(path))
    writer.SetWriteAllTimeSteps(True)
    writer.SetCompressionLevel(LEVEL)
    done = writer.Write()
    source.finish()
    if not done:
        raise OSError(writer.GetErrorCode(), "VTK could not write it")


def _source(frames: Iterator[Frame], times: tuple[float, ...]) -> Any:
    """What VTK asks for the frames, one after the other."""
    from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
    from vtkmodules.vtkCommonDataModel import vtkPolyData
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as Pipeline

    class Source(VTKPythonAlgorithmBase):
        error: BaseException | None = None

        def __init__(self) -> None:
            super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkPolyData")  # type: ignore[no-untyped-call]

        def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
            information = outputs.GetInformationObject(0)
            information.Set(Pipeline.TIME_STEPS(), times, len(times))
            information.Set(Pipeline.TIME_RANGE(), (times[0], times[-1]), 2)
            return 1

        def RequestData(self, request: Any, inputs: Any, outputs: Any) -> int:
            if self.error is None:
                try:
                    frame = next(frames)
                    result = vtkPolyData.GetData(outputs)
                    result.ShallowCopy(particles(frame))
                    result.GetInformation().Set(result.DATA_TIME_STEP(), frame.time)
                except (
                    BaseException
                ) as error:  # VTK would ask for the frame for ever: it is given empty ones to the end
                    self.error = error
            return 1

        def finish(self) -> None:
            """Say what went wrong, and ask for what comes after the last frame."""
            if self.error is not None:
                raise self.error
            next(frames, None)

    return Source()
