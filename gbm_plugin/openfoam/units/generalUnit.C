// What stands on OpenFOAM's own templates: common parts, the viscosity and the lean schemes.
// As one unit: most of a compiler's time goes into OpenFOAM's headers and templates, read and made once here.

#include "common/allowedEntries.C"
#include "common/besideSolver.C"
#include "common/consistentStart.C"
#include "common/feedback.C"
#include "common/keepEarlier.C"
#include "common/kinematicViscosity.C"
#include "laminar/constantViscosity.C"
#include "interpolation/leanCubic.C"
#include "fiberCoupling/sampling/schemeSampler.C"
