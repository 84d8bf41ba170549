#if defined(__x86_64__)
#define ABBE_SWEEP_WIDTH 4
#define ABBE_SWEEP_NAME sweep_avx2
#include "sweep_kernel.inc"
#endif
