#define ABBE_SWEEP_WIDTH 2
#define ABBE_SWEEP_NAME sweep_baseline
#include "sweep_kernel.inc"
