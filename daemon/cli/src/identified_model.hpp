#pragma once
/// The common part of every `abbe identify METHOD`: options of the result, and
/// printing the verdict.

#include <CLI/App.hpp>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/model/gate.hpp"
#include "abbe/tasks/identified_model.hpp"

namespace abbe::daemon {

/// The variables that receive the options of the result.
struct ResultOptions {
  std::string& keep;
  bool& json;
  std::string &out, &pdf;
};
/// Adds --keep, --json, --out and --pdf. The variables in `options` must outlive `command`.
void add_result_options(CLI::App& command, const ResultOptions& options);

/// Adds --accept NAME, which may be repeated.
void add_accept_option(CLI::App& command, std::vector<std::string>& accept);

/// Adds --pdf FILE.
void add_pdf_option(CLI::App& command, std::string& pdf);

/// Prints the held-out residuals and the decision of the gate to stdout.
void print_verdict(const calib::Verdict& verdict);

/// The exit code for the verdict: 0, or the exit code of a refusal.
[[nodiscard]] int exit_code(const calib::Verdict& verdict);

}  // namespace abbe::daemon
