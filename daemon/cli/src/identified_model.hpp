#pragma once
/// The common part of every `abbe identify METHOD`: options of the result, and
/// printing the verdict.

#include <CLI/App.hpp>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/calib/model/gate.hpp"
#include "abbe/tasks/identified_model.hpp"

namespace abbe::daemon {

/// Adds --keep, --json and --out.
void add_result_options(CLI::App& command, std::string& keep, bool& json, std::string& out);

/// Prints the held-out residuals and the decision of the gate to stdout.
void print_verdict(const calib::Verdict& verdict);

/// 0, or the exit code of a refusal.
[[nodiscard]] int exit_code(const calib::Verdict& verdict);

}  // namespace abbe::daemon
