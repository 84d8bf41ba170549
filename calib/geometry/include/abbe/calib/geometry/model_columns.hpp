#pragma once
/// The non-zero columns of a model at one state of the machine.

#include <cstddef>
#include <span>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib {

/// Derivative of V with respect to one parameter.
struct Column {
  std::size_t parameter = 0;
  /// dimensionless for a parameter in m; in m/rad for a parameter in rad
  Vector3 dV_dU = Vector3::Zero();
};

/// The non-zero columns of a model at one state of the machine: a sparse 3 x n matrix. It is stored
/// in memory of the caller, so that it can be filled repeatedly without allocation. Parameters are
/// in ascending order.
class ModelColumns {
 public:
  explicit ModelColumns(std::span<Column> memory) : memory_(memory) {}

  void clear() { count_ = 0; }
  /// Appends a column. The memory must have space for it.
  void push(std::size_t parameter, const Vector3& dV_dU) { memory_[count_++] = {parameter, dV_dU}; }

  [[nodiscard]] std::size_t size() const { return count_; }
  [[nodiscard]] std::span<const Column> span() const { return memory_.first(count_); }

 private:
  std::span<Column> memory_;
  std::size_t count_ = 0;
};

}  // namespace abbe::calib
