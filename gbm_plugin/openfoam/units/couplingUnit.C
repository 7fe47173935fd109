// The fibers and forcing.
// As one unit: most of a compiler's time goes into OpenFOAM's headers and templates, read and made once here.

#include "fiberCoupling/fiberFamily.C"
#include "fiberCoupling/fiberDaemon.C"
#include "fiberCoupling/fiberCloud.C"
#include "fiberCoupling/fiberCoupling.C"
#include "fiberFeedback/fiberFeedback.C"
#include "forcing/flowStatistics.C"
#include "forcing/turbulenceForcing.C"
#include "linearForcing/linearForcing.C"
#include "eswaranPope/normals.C"
#include "eswaranPope/shellProcess.C"
#include "eswaranPope/waveSum.C"
#include "eswaranPope/cellRows.C"
#include "eswaranPope/eswaranPope.C"
