#pragma once
/// The content of the files, before the true machine is made from it. Each group of tables has its
/// own reader, which sets its part.

#include <cstdint>
#include <string>

#include "abbe/sim/random_truth.hpp"
#include "setup_file.hpp"

namespace abbe::sim {

struct SetupDraft {
  LoadedSetup setup;
  RandomTruthOptions random;
  std::string truth_file;
  std::string path_file;
  std::string machine_file;
  std::string artefact_file;
  std::int64_t seed = 1;
  double encoder_noise = 5e-9;
  /// drift of the tracker at the end of the motion
  Eigen::Vector3d drift_at_end_m = Eigen::Vector3d::Zero();
  bool drift_is_random_walk = false;
  bool nest_visits = true;
};

}  // namespace abbe::sim
