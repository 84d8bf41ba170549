#include "sparse/sweep.hpp"

namespace abbe::calib::sparse {

SweepFunction fastest_sweep() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f")) return sweep_avx512;
  if (__builtin_cpu_supports("avx2")) return sweep_avx2;
#endif
  return sweep_baseline;
}

}  // namespace abbe::calib::sparse
