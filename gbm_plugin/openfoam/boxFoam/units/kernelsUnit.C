// The arithmetic on arrays.
// As one unit: most of a compiler's time goes into OpenFOAM's headers and templates, read and made once here.

#include "differences.C"
#include "waveNumbers.C"
#include "kernels.C"
#include "adamsBashforth3.C"
