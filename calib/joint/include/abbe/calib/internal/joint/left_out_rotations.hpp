#pragma once
/// Rotations that a part with another tool has in addition to the common tables (joint/part.hpp).

#include <Eigen/Core>
#include <vector>

#include "abbe/calib/joint/part.hpp"

namespace abbe::calib::joint {

/// The rotations that the common tables of one tool t leave out (joint/part.hpp), for a part with
/// the tool t + `further_m`. Each rotation has one table.
class LeftOutRotations {
 public:
  LeftOutRotations(const CommonTables&, const Vector3& further_m);

  /// Number of nodes of all tables; 0 for the tool of the common tables.
  [[nodiscard]] std::size_t size() const { return size_; }
  /// Matrix (3 x size()): effect of the rotations on V at a reading.
  [[nodiscard]] Eigen::Matrix3Xd B(const Vector3& reading_m) const;
  /// Matrix (basis.size() x size()): effect of the rotations on the parameters of the common tables
  /// if these are determined with the other tool, in datum G2. DegenerateGeometry as
  /// estimation::Datum::transformation().
  [[nodiscard]] Result<Eigen::MatrixXd> of_parameters() const;

 private:
  struct Rotation {
    std::size_t axis = 0, offset = 0, nodes = 0;
    Vector3 displacement_m = Vector3::Zero();  ///< displacement of the tool point per unit of
                                               ///< rotation
  };
  const CommonTables& common_;
  std::vector<Rotation> rotations_;
  std::size_t size_ = 0;
};

}  // namespace abbe::calib::joint
