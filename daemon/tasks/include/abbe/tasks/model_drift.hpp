#pragma once
/// Has the machine changed from one model to a later one?

#include <string>

#include "abbe/base/error.hpp"
#include "abbe/calib/model/model_drift.hpp"
#include "abbe/tasks/model_source.hpp"

namespace abbe::daemon {

/// Names of the earlier model `a` and the later model `b`.
struct ModelDriftArguments {
  std::string a, b;
  StoreOption store{};
  double false_alarm = calib::DriftOptions{}.false_alarm;  ///< probability
  bool other_machine = false;
};

struct ModelDrift {
  calib::DriftTest test;
  std::string machine_a, machine_b;
  std::string different_machines;  ///< empty: they are the same
};

/// Usage: models of different machines that `other_machine` does not allow. DataInsufficient: the
/// models cannot be compared table by table. BadInput: `false_alarm` is not between 0 and 1.
[[nodiscard]] Result<ModelDrift> model_drift(const ModelDriftArguments&);

}  // namespace abbe::daemon
