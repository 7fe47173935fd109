"""The fibers of a run as tubes in their box, drawn by ParaView:

    pvpython docs/paraview/picture.py openfoam_case/report/fibers_wrapped.pvd fibers.png

Without a display: xvfb-run -a pvpython ... (Debian: paraview, python3-paraview, xvfb).
"""

import sys

from paraview import simple as pv

fibers = pv.PVDReader(FileName=sys.argv[1])
tubes = pv.Tube(Input=fibers, Scalars=["POINTS", "radius"], VaryRadius="By Absolute Scalar", Capping=1)
tubes.NumberofSides = 16

view = pv.GetActiveViewOrCreate("RenderView")
view.ViewSize, view.ViewTime = [1400, 1200], fibers.TimestepValues[-1]
view.UseColorPaletteForBackground, view.Background = 0, [1, 1, 1]
view.OrientationAxesVisibility = 0
shown = pv.Show(tubes, view)
pv.ColorBy(shown, ("POINTS", "curvature"))
shown.RescaleTransferFunctionToDataRange(False)
pv.GetColorTransferFunction("curvature").ApplyPreset("Rainbow Uniform", True)
shown.SetScalarBarVisibility(view, False)
shown.Specular = 0.4
box = pv.Show(pv.Outline(Input=fibers), view)
box.DiffuseColor, box.AmbientColor = [0.3] * 3, [0.3] * 3

pv.ResetCamera(view)
camera = pv.GetActiveCamera()
camera.Azimuth(-30)
camera.Elevation(20)
pv.SaveScreenshot(sys.argv[2], view)
