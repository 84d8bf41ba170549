#include "triangle_update.hpp"

#include <cmath>
#include <vector>

#define ABBE_ALWAYS_INLINE inline __attribute__((always_inline))

namespace abbe::calib::estimation {
namespace {

/// The Householder reflection I - tau v v^T that makes a column of [triangle; rows] zero below the
/// diagonal of the triangle. The element of v at the diagonal is 1.
struct Reflection {
  double tau = 0.0;
  std::vector<double*> rows;  ///< rows that are not zero in the column
  std::vector<double> v;      ///< elements of v for these rows
};

/// Computes the reflection of a column and the new diagonal element, which is not negative.
void reflect_column(Reflection& r, double& diagonal, double* rows, std::size_t count,
                    std::size_t width, std::size_t column) {
  r.rows.clear();
  r.v.clear();
  double squares = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    double* row = rows + i * width;
    if (const double value = row[column]; value != 0.0) {
      r.rows.push_back(row);
      r.v.push_back(value);
      squares += value * value;
      row[column] = 0.0;
    }
  }

  // The sum is zero by underflow: where the rows contain nothing about some unknowns, the rounding
  // errors that remain become smaller by 16 digits from column to column. Squares of values below
  // 1e-154 are zero.
  if (squares == 0.0) {
    r.rows.clear();
    return;
  }

  // The reflection gives the diagonal the value -norm: for a diagonal >= 0, the sum diagonal + norm
  // then loses no digits by cancellation. apply() changes the sign of the triangle's row, so that
  // the diagonal becomes +norm.
  const double norm = std::sqrt(diagonal * diagonal + squares);
  const double pivot = diagonal + norm;
  r.tau = pivot / norm;
  for (double& v : r.v) {
    v /= pivot;
  }
  diagonal = norm;
}

/// sum = top + rows^T v, over the columns from `begin` to `end`. Four rows are added at a time, so
/// that `sum` is read and written less often. Each element is summed in the order of the rows.
ABBE_ALWAYS_INLINE void project(const Reflection& r, const double* top, double* __restrict sum,
                                std::size_t begin, std::size_t end) {
  const std::size_t n = r.rows.size();
  for (std::size_t c = begin; c < end; ++c) {
    sum[c] = top[c];
  }

  std::size_t i = 0;
  for (; i + 4 <= n; i += 4) {
    const double *a = r.rows[i], *b = r.rows[i + 1], *c = r.rows[i + 2], *d = r.rows[i + 3];
    const double va = r.v[i], vb = r.v[i + 1], vc = r.v[i + 2], vd = r.v[i + 3];
    for (std::size_t k = begin; k < end; ++k) {
      sum[k] = sum[k] + va * a[k] + vb * b[k] + vc * c[k] + vd * d[k];
    }
  }

  for (; i < n; ++i) {
    const double* row = r.rows[i];
    const double v = r.v[i];
    for (std::size_t k = begin; k < end; ++k) {
      sum[k] += v * row[k];
    }
  }
}

/// Applies the reflection to the columns from `begin` to `end`; `sum` is the result of project().
/// Also changes the sign of `top`, the row of the triangle.
ABBE_ALWAYS_INLINE void apply(const Reflection& r, double* top, double* __restrict sum,
                              std::size_t begin, std::size_t end) {
  for (std::size_t c = begin; c < end; ++c) {
    sum[c] *= r.tau;
    top[c] = sum[c] - top[c];
  }

  for (std::size_t i = 0; i < r.rows.size(); ++i) {
    double* __restrict row = r.rows[i];
    const double v = r.v[i];
    for (std::size_t c = begin; c < end; ++c) {
      row[c] -= v * sum[c];
    }
  }
}

/// Makes the columns of `rows` zero, one after another. `sum` has `width` elements.
ABBE_ALWAYS_INLINE void reflect_all(double* triangle, double* rows, std::size_t count,
                                    std::size_t width, double* sum) {
  Reflection r;
  r.rows.reserve(count);
  r.v.reserve(count);

  for (std::size_t column = 0; column + 1 < width; ++column) {
    double* top = triangle + column * width;
    reflect_column(r, top[column], rows, count, width, column);
    if (!r.rows.empty()) {
      project(r, top, sum, column + 1, width);
      apply(r, top, sum, column + 1, width);
    }
  }
}

/// The loops of reflect_all() are compiled for each width of the vector registers. All give the
/// same bits: each element is computed by itself, and fused multiply-add is not used.
void reflect_all_baseline(double* triangle, double* rows, std::size_t count, std::size_t width,
                          double* sum) {
  reflect_all(triangle, rows, count, width, sum);
}

#if defined(__x86_64__)
__attribute__((target("avx2"))) void reflect_all_avx2(double* triangle, double* rows,
                                                      std::size_t count, std::size_t width,
                                                      double* sum) {
  reflect_all(triangle, rows, count, width, sum);
}
#endif

using ReflectAll = decltype(&reflect_all_baseline);

ReflectAll reflect_all_of_processor() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) {
    return reflect_all_avx2;
  }
#endif
  return reflect_all_baseline;
}

}  // namespace

void update_triangle(double* triangle, double* rows, std::size_t count, std::size_t unknowns) {
  static const ReflectAll of_processor = reflect_all_of_processor();
  std::vector<double> sum(unknowns + 1);
  of_processor(triangle, rows, count, unknowns + 1, sum.data());
}

}  // namespace abbe::calib::estimation
