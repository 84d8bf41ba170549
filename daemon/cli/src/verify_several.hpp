#pragma once
/// Output of `abbe verify MODEL MODEL ...`: one row per model.

#include "abbe/tasks/verify.hpp"

namespace abbe::daemon {

void print_json(const SeveralOutcome& outcome);
void print_summary(const SeveralOutcome& outcome);

}  // namespace abbe::daemon
