#if defined(__x86_64__)
#define ABBE_SWEEP_WIDTH 8
#define ABBE_SWEEP_NAME sweep_avx512
#include "sweep_kernel.inc"
#endif
