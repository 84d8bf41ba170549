#pragma once
/// Compares the scale readings at the vertices of the path with the path. If the path file is not
/// the path that the control follows, the difference would appear in the model as an error of the
/// machine. Not for the RT path; not thread-safe.

#include <cstddef>
#include <optional>
#include <string>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::daemon {

struct VertexReading {
  std::size_t vertex = 0;
  calib::Vector3 reading_m = calib::Vector3::Zero();
  calib::Vector3 path_m = calib::Vector3::Zero();  ///< expected reading at the vertex
  calib::Vector3 u_m = calib::Vector3::Zero();     ///< standard uncertainty of the reading
  double speed_m_per_s = 0.0;
};

class VertexReadings {
 public:
  /// A machine slower than this between two points is at standstill. A control that rounds the
  /// corner at a vertex is faster; such a vertex has no reading.
  static constexpr double kStands_m_per_s = 1e-3;

  /// `tolerance_m`: how far a machine at standstill may be from the commanded position (following
  /// error, in-position window).
  explicit VertexReadings(double tolerance_m) : tolerance_m_(tolerance_m) {}

  /// Takes a reading near a vertex; call in order of time. Of the readings at one vertex, the one
  /// with the lowest speed is used, and of several equally slow ones the latest. At the first
  /// reading of another vertex, returns the contradiction() of the previous one.
  [[nodiscard]] std::optional<std::string> take(const VertexReading& reading);
  /// Discards the reading of the current vertex. Call it when the machine moves there before its
  /// run has begun.
  void forget() { slowest_.reset(); }
  /// Message if the reading of the last vertex differs from the path by more than the allowed
  /// difference; nullopt: it does not.
  [[nodiscard]] std::optional<std::string> contradiction() const;

 private:
  double tolerance_m_;
  std::optional<VertexReading> slowest_;
};

}  // namespace abbe::daemon
