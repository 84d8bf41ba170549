#pragma once
/// The rotations that tables of one target leave out, for a part with another tool
/// (joint/part.hpp).

#include <Eigen/Core>
#include <vector>

#include "abbe/calib/joint/part.hpp"

namespace abbe::calib::joint {

/// One table per rotation that the common tables do not have, for the tool t + `further_m`.
class LeftOutRotations {
 public:
  LeftOutRotations(const CommonTables&, const Vector3& further_m);

  /// Number of nodes of all tables; 0 for the tool of the common tables.
  [[nodiscard]] std::size_t size() const { return size_; }
  /// 3 x size(): effect on V at a reading.
  [[nodiscard]] Eigen::Matrix3Xd B(const Vector3& reading_m) const;
  /// basis.size() x size(): effect on the parameters that the same tables have for the other tool,
  /// in datum G2. DegenerateGeometry as estimation::Datum::transformation().
  [[nodiscard]] Result<Eigen::MatrixXd> of_parameters() const;

 private:
  struct Rotation {
    std::size_t axis = 0, offset = 0, nodes = 0;
    Vector3 displacement_m = Vector3::Zero();  ///< of the tool per rotation
  };
  const CommonTables& common_;
  std::vector<Rotation> rotations_;
  std::size_t size_ = 0;
};

}  // namespace abbe::calib::joint
