#include "abbe/calib/internal/sparse/sweep.hpp"

#include "sweep_functions.hpp"

namespace abbe::calib::sparse {

std::vector<SweepVariant> sweep_variants() {
  std::vector<SweepVariant> variants;
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f")) variants.push_back({"AVX-512", sweep_avx512});
  if (__builtin_cpu_supports("avx2")) variants.push_back({"AVX2", sweep_avx2});
#endif
  variants.push_back({"baseline", sweep_baseline});
  return variants;
}

}  // namespace abbe::calib::sparse
