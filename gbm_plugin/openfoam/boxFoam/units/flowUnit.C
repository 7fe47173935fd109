// The flow, its start and its step.
// As one unit: most of a compiler's time goes into OpenFOAM's headers and templates, read and made once here.

#include "boxVelocity.C"
#include "boxFlow.C"
#include "momentumSources.C"
#include "flowState.C"
#include "refusals.C"
#include "boxFoam.C"
