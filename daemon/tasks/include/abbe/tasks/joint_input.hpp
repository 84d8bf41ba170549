#pragma once
/// The measured data of a joint identification: every run, array and bar of parts.toml, identified
/// and judged by its own method, as part of a joint identification.

#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/calib/joint/judge.hpp"
#include "abbe/calib/model/gate.hpp"
#include "abbe/config/config.hpp"
#include "abbe/tasks/progress.hpp"

namespace abbe::daemon {

struct IdentifyJointArguments {
  std::string machine, parts, keep;
  std::optional<std::string> estimator;  // estimator for the runs; without a value: as in [otf]
  std::optional<double> u_scale_ppm;     // default: the value of the configured tracker
  double false_alarm = calib::joint::JointOptions{}.false_alarm;
  bool scales_corrected = false, accept_path_orientation = false;
};

/// Facts about a part for the report.
struct PartFacts {
  std::string name, method, files;
  std::size_t observations = 0;
  std::optional<calib::VolumetricModel> own_model{};  ///< tables; nullopt for an array or a bar
  calib::Verdict verdict;                             ///< verdict on this part alone
};

struct JointInput {
  JointInput() = default;
  // Moving is possible although `runs` points to elements of `observations`: these elements keep
  // their addresses when the deque is moved.
  JointInput(JointInput&&) = default;
  JointInput& operator=(JointInput&&) = default;
  JointInput(const JointInput&) = delete;
  JointInput& operator=(const JointInput&) = delete;
  ~JointInput() = default;

  Config config;
  std::vector<InputFile> sources;
  std::optional<calib::joint::CommonTables> common{};  ///< common tables of the first run
  std::vector<calib::joint::Part> parts{};             ///< runs, arrays, bars
  std::vector<PartFacts> facts{};                      ///< one per part
  /// observations of the runs; `runs` points to them
  std::deque<calib::otf::Observations> observations{};
  std::vector<calib::joint::RunOfPart> runs{};
  /// meaning of the readings in the first recorded run
  std::optional<MeaningEntries> recorded_readings{};
};

/// The text of an error about a part begins with the name of the part. Errors: Io; BadInput with
/// file and line; DataInsufficient.
[[nodiscard]] Result<JointInput> read_joint_input(const IdentifyJointArguments&, const Progress&);

}  // namespace abbe::daemon
