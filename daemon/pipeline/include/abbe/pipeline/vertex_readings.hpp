#pragma once
/// What the scales read while the machine stands at the vertices of its path. A path file that is
/// not the one the control drives would become an error of the machine in the model. Ordinary
/// world; not thread-safe.

#include <cstddef>
#include <optional>
#include <string>

#include "abbe/calib/geometry.hpp"

namespace abbe::daemon {

struct VertexReading {
  std::size_t vertex = 0;
  calib::Vector3 reading_m = calib::Vector3::Zero();
  calib::Vector3 path_m = calib::Vector3::Zero();  ///< what the scales should read there
  calib::Vector3 u_m = calib::Vector3::Zero();     ///< standard uncertainty of the reading
  double speed_m_per_s = 0.0;
};

class VertexReadings {
 public:
  /// Between two points. A machine that is faster does not stand: a control that rounds the corners
  /// has no reading there.
  static constexpr double kStands_m_per_s = 1e-3;

  /// `tolerance_m`: by which a standing machine may miss its command (following error, in-position
  /// window).
  explicit VertexReadings(double tolerance_m) : tolerance_m_(tolerance_m) {}

  /// Readings near a vertex, in the order of time; the slowest and latest of a vertex counts.
  /// Returns what the vertex before contradicts, once this is another one.
  [[nodiscard]] std::optional<std::string> take(const VertexReading& reading);
  /// The machine stands elsewhere now, and its run has not begun.
  void forget() { slowest_.reset(); }
  /// Of the last vertex.
  [[nodiscard]] std::optional<std::string> contradiction() const;

 private:
  double tolerance_m_;
  std::optional<VertexReading> slowest_;
};

}  // namespace abbe::daemon
