"""The fibers of a run as tubes, drawn by ParaView without a display:

    pvpython tools/picture.py openfoam_case/report/fibers_wrapped.pvd fibers.png
"""

import sys

from paraview.simple import *  # noqa: F403  (ParaView's own way)

series, picture = sys.argv[1:3]
fibers = PVDReader(FileName=series)  # noqa: F405
tube = Tube(Input=fibers, Scalars=["POINTS", "radius"], VaryRadius="By Absolute Scalar", NumberofSides=12)  # noqa: F405
view = GetActiveViewOrCreate("RenderView")  # noqa: F405
view.ViewSize = [1200, 1000]
view.ViewTime = fibers.TimestepValues[-1]
display = Show(tube, view)  # noqa: F405
ColorBy(display, ("POINTS", "curvature"))  # noqa: F405
display.RescaleTransferFunctionToDataRange(True)
view.ResetActiveCameraToPositiveX()
ResetCamera(view)  # noqa: F405
SaveScreenshot(picture, view)  # noqa: F405
