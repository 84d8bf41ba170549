#pragma once
/// Tests whether the machine has changed between an earlier and a later model.

#include <string>

#include "abbe/base/error.hpp"
#include "abbe/calib/model/model_drift.hpp"
#include "abbe/tasks/model_source.hpp"

namespace abbe::daemon {

/// Names of the earlier model `a` and the later model `b`.
struct ModelDriftArguments {
  std::string a, b;
  StoreOption store{};
  double false_alarm = calib::DriftOptions{}.false_alarm;  ///< probability of a false alarm
  bool other_machine = false;
};

struct ModelDrift {
  calib::DriftTest test;
  std::string machine_a, machine_b;
  /// text that the models are of different machines; empty: they are of the same machine
  std::string different_machines;
};

/// Usage: models of different machines although `other_machine` is false. DataInsufficient: the
/// models cannot be compared table by table. BadInput: `false_alarm` is not between 0 and 1.
[[nodiscard]] Result<ModelDrift> model_drift(const ModelDriftArguments&);

}  // namespace abbe::daemon
