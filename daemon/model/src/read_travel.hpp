#pragma once
/// The members of model.json about the direction of travel: `backlash`, the differences that the
/// run determined, and `travel`, all differences with their covariance, on which V depends.

#include <optional>
#include <vector>

#include "abbe/calib/model/backlash.hpp"
#include "model_reader.hpp"

namespace abbe::daemon {

/// Empty in models without backlash.
[[nodiscard]] std::vector<calib::Backlash> read_backlash(ModelReader& in);

struct StoredTravel {
  calib::TravelDifferences differences;
  std::vector<calib::Backlash> list;  ///< the differences with names and positions
};
/// nullopt in models whose V does not depend on the direction of travel, and in models of earlier
/// versions. `parameters`: number of parameters of the model.
[[nodiscard]] std::optional<StoredTravel> read_travel(ModelReader& in, std::size_t parameters);
/// Adds a fault for the first difference that does not belong to the tables of the model.
void check_names(ModelReader& in, const StoredTravel& travel, const calib::VolumetricModel& model);

}  // namespace abbe::daemon
