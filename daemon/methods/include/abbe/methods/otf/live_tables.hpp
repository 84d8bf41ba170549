#pragma once
/// Tables of an on-the-fly run that are computed while the machine moves
/// (calib/otf/live/running_estimate.hpp). The points of the run are shared with the acquisition and
/// not copied, so that they can be accumulated again when a better pose of the tracker is known.
/// This class changes neither points nor model nor hash of the run. Not for the RT path and not for
/// the hub: tables() takes up to a second. Used by one thread at a time.

#include <cstddef>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/otf/live/running_estimate.hpp"
#include "abbe/config/config.hpp"
#include "abbe/methods/otf/acquisition.hpp"
#include "abbe/pipeline/session_status.hpp"

namespace abbe::daemon {

class OtfLiveTables {
 public:
  /// BadInput for a machine without tables.
  [[nodiscard]] static Result<OtfLiveTables> of(const Config& config);

  /// Takes the points and legs that the acquisition has added since the last call. O(1) per point.
  void take(RunNews&& news);
  /// DataInsufficient until the machine has reached three vertices that span a plane.
  [[nodiscard]] Result<LiveTables> tables();

 private:
  OtfLiveTables(const Config& config, calib::otf::Machine machine,
                calib::otf::RunningEstimate estimate);
  void add_points();
  void add(const RunPoint& point);
  [[nodiscard]] const RunPoint& point(std::size_t i) const;

  EnvironmentUseOptions environment_use_;
  EnvironmentEffect environment_;
  calib::MachineNodes nodes_;
  std::vector<calib::otf::Nest> nests_;  // points in a nest do not belong to the path
  calib::otf::RunningEstimate estimate_;
  std::vector<RunPoints::Chunk> chunks_;
  std::vector<RunPoint> tail_;
  std::vector<LegBegun> legs_;
  // first point and first leg that the estimate does not contain yet
  std::size_t next_point_ = 0, next_leg_ = 0;
};

}  // namespace abbe::daemon
